"""``camera-monitor noise``: the noise of one's own pictures."""

from __future__ import annotations

from pathlib import Path

import click


@click.command("noise")
@click.argument("paths", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--estimator", default="pca", show_default=True, help="pca, bf, wavelet, immerkaer, or a plug-in's name")
@click.option("--tile", "tile_px", default=128, show_default=True, help="side of a tile, pixels")
@click.option("--every", default=1, show_default=True, type=click.IntRange(min=1), help="of a video, each n-th frame")
@click.option("--csv", "table", type=click.Path(path_type=Path), help="also write one row per tile here")
@click.option(
    "--map", "maps", type=click.Path(path_type=Path), help="folder for pictures with the tiles' noise drawn in"
)
def command(
    paths: tuple[Path, ...], estimator: str, tile_px: int, every: int, table: Path | None, maps: Path | None
) -> None:
    """Estimate the noise of PATHS: pictures, videos, or folders of them.

    Prints, per frame, the robust median over its tiles with their range, in grey levels (DN, 0..255), and how many
    tiles the estimator abstained on (saturated or flat).
    """
    from tqdm import tqdm

    from pipeline import noise
    from pipeline.cli.overlay import noise_overlay
    from pipeline.cli.pictures import expand, read
    from pipeline.datasets.patches import cut, tiles
    from pipeline.errors import InputError
    from pipeline.statistics import robust
    from pipeline.store import write_image, write_text
    from pipeline.streams import stream

    method = noise.create(estimator)
    rows = ["picture,x_px,y_px,size_px,sigma_dn,abstained,reason"]
    failed = 0
    click.echo(f"{'sigma DN':>9} {'min':>7} {'max':>7} {'tiles':>6} {'abstained':>9}  picture")
    for path in tqdm(expand(paths), delay=2, leave=False):
        try:
            for name, image in read(path, every):
                squares = tiles(image.shape, min(tile_px, *image.shape), "cover")
                found = method.estimate(cut(image, squares))
                whole = robust(found.sigma_dn, stream(0, "cli", "noise"), draws=1)
                numbers = f"{whole.median:9.2f} {whole.minimum:7.2f} {whole.maximum:7.2f}"
                click.echo(f"{numbers} {len(squares):6d} {whole.abstained:9d}  {name}")
                for square, sigma, reason in zip(squares, found.sigma_dn, found.reason, strict=True):
                    place = f"{square.x_px},{square.y_px},{square.size_px}"
                    rows.append(f'"{name}",{place},{sigma:.4f},{bool(reason)},{reason}')
                if maps is not None:
                    drawn = noise_overlay(image, squares, found.sigma_dn)
                    write_image(maps / f"{Path(name).name.replace('#', '-')}.noise.png", drawn)
        except InputError as error:
            failed += 1
            click.echo(f"set aside: {error}", err=True)
    if table is not None:
        write_text(table, "\n".join(rows) + "\n")
    if failed:
        raise InputError(f"{failed} of the files given could not be used; see above")
