"""``camera-monitor noise``: the noise of one's own pictures."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pipeline.cli.ending_signals import held
from pipeline.cli.options.frame_samples import tiles_option
from pipeline.cli.options.given_paths import GivenPath
from pipeline.cli.options.video_codec import codec_option

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pipeline.condition.estimate import NoiseState

COLUMNS = (
    "picture", "x_px", "y_px", "size_px", "sigma_dn", "sigma_at_most_dn", "abstained", "reason", "frame_sigma_dn",
    "white_sigma_dn", "noise_correlation", "frame_white_sigma_dn", "frame_noise_correlation",
)  # fmt: skip
HEADER = (
    f"{'sigma DN':>9} {'at most':>7} {'min':>7} {'max':>7} {'tiles':>6} {'abstained':>9} {'white':>6} {'corr.':>6}"
    "  picture"
)


@click.command("noise")
@click.argument("paths", nargs=-1, required=True, type=GivenPath())
@click.option(
    "--estimator",
    "--noise",
    "estimator",
    default="adaptive",
    show_default=True,
    help="adaptive, cellwise, correlated, pca, bf, wavelet, immerkaer, or a plug-in's",
)
@click.option(
    "--tile", "tile_px", default=128, show_default=True, type=click.IntRange(8, 4096),
    help="side of a tile, pixels; at least 48 for adaptive, 8 to 48 for other estimators",
)  # fmt: skip
@tiles_option
@click.option("--every", default=1, show_default=True, type=click.IntRange(min=1), help="of a video, each n-th frame")
@click.option("--csv", "table", type=GivenPath(), help="also write one row per tile here")
@click.option(
    "--map", "maps", type=GivenPath(),
    help="folder for pictures with the tiles' noise drawn in; those of its last run there go",
)  # fmt: skip
@codec_option
def command(
    paths: tuple[Path, ...], estimator: str, tile_px: int, most_tiles: int, every: int, table: Path | None,
    maps: Path | None, codec: str | None,
) -> None:  # fmt: skip
    """Estimate the noise of PATHS: pictures, videos, or folders of them.

    Prints, per frame, the robust median over its tiles with their range, in grey levels (DN, 0..255), how many tiles
    the estimator abstained on, the part of the noise that is white, as the sensor's is before the camera smooths it
    (DN), and the correlation of the noise of adjacent pixels (0: white; ``-``: not separated); bars beside the picture
    are left out. A frame whose tiles mostly abstain because of a codec or filter, or of which less than a quarter
    answer, has no median (``frame_sigma_dn`` of the CSV is nan), and its map no number: the tiles that answer then are
    mostly grain that looks like noise. Behind a codec it has a bound. The same estimator as ``camera-monitor health``
    unless another is named.
    """
    from tqdm import tqdm

    from pipeline import noise
    from pipeline.cli.frames.given_files import expand
    from pipeline.cli.frames.names import result_stem
    from pipeline.cli.frames.pictures import least_side_px, readable
    from pipeline.cli.frames.set_aside import SetAside
    from pipeline.cli.results.growing_files import RowFile
    from pipeline.cli.results.output_folder import OutputFolder
    from pipeline.cli.results.refusals import refuse_foreign_file, refuse_input
    from pipeline.condition import noise_of_frame
    from pipeline.errors import InputError, printable
    from pipeline.noise.base import smallest_patch_px
    from pipeline.store import write_image

    method = noise.create(estimator)
    least_tile_px = smallest_patch_px(method)
    if tile_px < least_tile_px:
        raise InputError(
            f"--tile {tile_px}: the noise estimator {estimator} takes tiles of at least {least_tile_px} px"
        )
    files = expand(paths)
    set_aside = SetAside()
    if table is not None:
        refuse_input(table, "--csv", files)
        refuse_foreign_file(table, "--csv", ",".join(COLUMNS[:4]))
    with contextlib.ExitStack() as stack:
        folder = stack.enter_context(OutputFolder(maps, "noise", "--map", files)) if maps is not None else None
        rows = stack.enter_context(RowFile(table, COLUMNS)) if table is not None else None
        click.echo(HEADER)
        frames = readable(files, every, least_px=least_side_px(method))
        for name, image, problem, coding in tqdm(frames, delay=2, leave=False, unit=" frames"):
            try:
                if image is None:
                    raise InputError(problem)
                known = coding.or_by(codec or "")
                state = noise_of_frame(
                    method, image, tile_px, most_tiles, codec=known.codec, quantiser=known.quantiser, name=estimator
                )
            except InputError as error:
                set_aside.add(name, error)
                continue
            click.echo(f"{_numbers(state)}  {printable(name)}")
            with held():  # all rows and the map of a frame, or none
                if rows is not None:
                    for row in _tile_rows(name, state):
                        rows.write(row)
                if folder is not None:
                    write_image(folder.claim(result_stem(name), ".noise.png"), _map(image, state))
    set_aside.refuse()


def _numbers(state: NoiseState) -> str:
    """The noise of a frame as text under `HEADER`."""
    from pipeline.cli.results.numbers import text_number

    whole = state.summary
    values = (whole.value, state.at_most_dn, whole.least, whole.greatest, state.white_sigma_dn, state.correlation)
    level, bound, least, most, white, correlation = (text_number(float(value), 2) for value in values)
    tiles = f"{len(state.patches):6d} {whole.abstained:9d}"
    return f"{level:>9} {bound:>7} {least:>7} {most:>7} {tiles} {white:>6} {correlation:>6}"


def _tile_rows(name: str, state: NoiseState) -> Iterator[dict[str, Any]]:
    """A row of `COLUMNS` for every tile of a frame."""
    import numpy as np

    estimate = state.estimate
    unknown = np.full(len(state.patches), np.nan)
    bounds, whites, correlations = (
        unknown if values is None else values
        for values in (estimate.at_most_dn, estimate.white_sigma_dn, estimate.correlation)
    )
    for tile, sigma, most_dn, reason, *parts in zip(
        state.patches, estimate.sigma_dn, bounds, estimate.reason, whites, correlations, strict=True
    ):
        values = (
            name, tile.x_px, tile.y_px, tile.size_px, f"{sigma:.4f}", f"{most_dn:.4f}", bool(reason), str(reason),
            f"{state.summary.value:.4f}",
            *(f"{value:.4f}" for value in (*parts, state.white_sigma_dn, state.correlation)),
        )  # fmt: skip
        yield dict(zip(COLUMNS, values, strict=True))


def _map(image: NDArray[np.float32], state: NoiseState) -> NDArray[np.uint8]:
    """A frame with the noise of its tiles drawn in; without numbers where the frame has none."""
    import numpy as np

    from pipeline.cli.results.noise_overlay import noise_overlay

    without_level = np.isnan(state.summary.value)
    sigma_dn = np.full(len(state.patches), np.nan) if without_level else state.estimate.sigma_dn
    return noise_overlay(image, state.patches, sigma_dn)
