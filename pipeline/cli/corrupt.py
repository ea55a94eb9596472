"""``camera-monitor corrupt``: pictures at a named noise level or blur, with their truth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@click.command("corrupt")
@click.argument("paths", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--out", required=True, type=click.Path(path_type=Path), help="folder for the pictures and their truth")
@click.option("--effect", default="combined", show_default=True, help="photon, dcsn, readout, combined or sensor")
@click.option("--sigma-dn", default=0.0, show_default=True, help="standard deviation of the noise, grey levels 0..255")
@click.option("--blur", default=None, help="defocus, linear_motion or nonlinear_motion")
@click.option("--size-px", default=None, type=float, help="size of the blur kernel, pixels")
@click.option(
    "--mtf50", default=None, type=float, help="instead of a size: where contrast falls to half, fraction of Nyquist"
)
@click.option("--angle-deg", default=0.0, show_default=True, help="direction of motion blur, counter-clockwise")
@click.option("--camera", default="physical", show_default=True, help="physical, authors or authors_2022")
@click.option("--seed", default=1, show_default=True, help="same seed, same picture name: same noise")
def command(
    paths: tuple[Path, ...],
    out: Path,
    effect: str,
    sigma_dn: float,
    blur: str | None,
    size_px: float | None,
    mtf50: float | None,
    angle_deg: float,
    camera: str,
    seed: int,
) -> None:
    """Corrupt PATHS, pictures or folders of them, as a noisier or blurrier camera would have seen them.

    Writes NAME.png and NAME.json, the truth: noise asked for and reached, clipped share, kernel, its MTF.
    """
    import numpy as np
    from tqdm import tqdm

    from pipeline import store
    from pipeline.camera import mtf
    from pipeline.camera.levels import corrupt
    from pipeline.cli.pictures import expand, read
    from pipeline.errors import InputError
    from pipeline.streams import stream

    psf = _kernel(blur, size_px, mtf50, angle_deg, seed)
    for path in tqdm(expand(paths), delay=2, leave=False):
        for _, image in read(path):
            target = out / f"{path.stem}.png"
            if target.resolve() == path.resolve():
                raise InputError(f"--out {out}: would overwrite {path}; name another folder")
            generator = stream(seed, "corrupt", path.stem, effect, sigma_dn)
            shown = corrupt(image, effect, sigma_dn=sigma_dn, generator=generator, psf=psf, camera=camera)  # type: ignore[arg-type]
            truth = {**shown.row(), "blur": blur, "angle_deg": angle_deg, "camera": camera, "seed": seed}
            if psf is not None:
                truth |= {"kernel": psf, "mtf": shown.mtf, "mtf50": mtf.mtf50(psf), "frequencies": mtf.FREQUENCIES}
            store.write_image(target, np.asarray(shown.image))
            store.write_json(target.with_suffix(".json"), truth)
    click.echo(f"written to {out}")


def _kernel(
    blur: str | None, size_px: float | None, mtf50: float | None, angle_deg: float, seed: int
) -> NDArray[np.floating] | None:
    """The kernel asked for, or None.

    Raises:
        InputError: a size without a kind, or neither or both of size and MTF50.
    """
    from pipeline.camera.levels import psf_for_mtf50
    from pipeline.camera.psf import create
    from pipeline.errors import InputError
    from pipeline.streams import stream

    if blur is None:
        if size_px is not None or mtf50 is not None:
            raise InputError("--size-px and --mtf50 need --blur KIND")
        return None
    if mtf50 is not None and size_px is None:
        return psf_for_mtf50(blur, mtf50, angle_deg=angle_deg)[1]
    if size_px is None or mtf50 is not None:
        raise InputError(f"--blur {blur} needs either --size-px or --mtf50")
    return create(blur, size_px, angle_deg, stream(seed, "psf", blur, float(size_px)))
