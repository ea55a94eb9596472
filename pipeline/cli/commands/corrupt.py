"""``camera-monitor corrupt``: pictures at a named noise level or blur, with their truth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pipeline.cli.options.given_paths import GivenPath
from pipeline.cli.options.numbers import FiniteRange

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

LARGEST_KERNEL_PX = 255
HALF_LEVEL = 0.5 / 255
"""Weight of a kernel's other pixels below which no 8-bit value changes."""

SMOOTHED_NOTE = (
    "photon noise enters before the blur, which smooths it: less noise is reached than asked for; "
    "--noise-source readout or dcsn enters behind the blur"
)


@click.command("corrupt")
@click.argument("paths", nargs=-1, required=True, type=GivenPath())
@click.option(
    "--out", required=True, type=GivenPath(),
    help="folder for the pictures and their truth; those of its last run there go",
)  # fmt: skip
@click.option("--noise-source", default="combined", show_default=True, help="photon, dcsn, readout, combined or sensor")
@click.option(
    "--sigma-dn", default=0.0, show_default=True, type=FiniteRange(0, 255),
    help="standard deviation of the noise, grey levels 0..255",
)  # fmt: skip
@click.option("--blur", default=None, help="defocus, gaussian, linear_motion or nonlinear_motion")
@click.option("--size-px", default=None, type=FiniteRange(0, LARGEST_KERNEL_PX), help="size of the blur kernel, pixels")
@click.option(
    "--mtf50", default=None, type=FiniteRange(0, 1),
    help="instead of a size (not of nonlinear_motion): where contrast falls to half, fraction of Nyquist",
)  # fmt: skip
@click.option(
    "--angle-deg", default=0.0, show_default=True, type=FiniteRange(-360, 360),
    help="direction of motion blur, counter-clockwise",
)  # fmt: skip
@click.option(
    "--camera", default="physical", show_default=True,
    help="physical, or the paper's program with its quirks and discs: authors, or authors_2022 for that before 12/2022",
)  # fmt: skip
@click.option(
    "--seed", default=1, show_default=True, type=click.IntRange(0, 2**63 - 1),
    help="same seed, same picture name: same noise",
)  # fmt: skip
@click.option(
    "--pipeline", "preset", default=None,
    help="instead: a whole camera with its processing; phone, reflex, dashcam or machine_vision",
)  # fmt: skip
@click.option(
    "--iso", default=800.0, show_default=True, type=FiniteRange(0, 409_600),
    help="setting of the camera of --pipeline, 100 or more; 0 for no noise",
)  # fmt: skip
@click.option(
    "--shots", default=4, show_default=True, type=click.IntRange(2, 64),
    help="with --pipeline: shots of the same scene that the truth is measured from",
)  # fmt: skip
@click.option("--every", default=1, show_default=True, type=click.IntRange(min=1), help="of a video, each n-th frame")
def command(
    paths: tuple[Path, ...],
    out: Path,
    noise_source: str,
    sigma_dn: float,
    blur: str | None,
    size_px: float | None,
    mtf50: float | None,
    angle_deg: float,
    camera: str,
    seed: int,
    preset: str | None,
    iso: float,
    shots: int,
    every: int,
) -> None:
    """Corrupt PATHS, pictures, videos or folders of them, as a noisier or blurrier camera would have seen them.

    Prints per picture the noise asked for and reached (before and after clipping to 0..255) and its file. Writes
    NAME.png and NAME.json, the truth: noise asked for and reached, clipped share, kernel, its MTF. Each frame of a
    video becomes a picture with noise of its own.

    With --pipeline pictures are decoded to linear light and go through a whole camera: raw noise at --iso,
    demosaicing, denoising, sharpening and codec. The truth then holds the noise between --shots of the scene, its
    white part and its correlation between adjacent pixels.
    """
    context = click.get_current_context()
    _check_options(context, preset)
    if preset is not None:
        from pipeline.cli.corruption.processed import run

        run(paths, out, preset, iso, shots, seed, every)
        return
    import numpy as np
    from click.core import ParameterSource

    from pipeline.camera import mtf
    from pipeline.camera.corruption import CAMERAS, conditioned, corrupt
    from pipeline.cli.corruption.kernel import blur_kernel
    from pipeline.cli.corruption.pictures import CorruptedPicture, write_each
    from pipeline.cli.frames.given_files import expand
    from pipeline.cli.frames.pictures import readable
    from pipeline.errors import InputError, did_you_mean
    from pipeline.streams import stream

    _, effects = conditioned(noise_source)
    if camera not in CAMERAS:
        raise InputError(f"--camera {camera}: unknown; {did_you_mean(camera, CAMERAS)}")
    psf = blur_kernel(blur, size_px, mtf50, angle_deg, seed, "physical" if camera == "physical" else "authors")
    idle = psf is not None and float(psf.max()) > 1 - HALF_LEVEL
    if idle and size_px is not None:
        click.echo(f"warning: --blur {blur} --size-px {size_px:g} blurs nothing: it changes no 8-bit value", err=True)
    settings: dict[str, Any] = {"blur": blur, "angle_deg": angle_deg, "camera": camera, "seed": seed}
    if psf is not None:
        settings |= {"kernel": psf, "mtf50": mtf.mtf50(psf), "frequencies": mtf.FREQUENCIES}

    def corrupted(name: str, stem: str, image: NDArray[np.float32]) -> CorruptedPicture:
        if psf is not None and max(psf.shape) > min(image.shape):
            raise InputError(f"the blur kernel of {max(psf.shape)} px is larger than the picture")
        generator = stream(seed, "corrupt", stem, noise_source, sigma_dn)
        shown = corrupt(image, noise_source, sigma_dn=sigma_dn, generator=generator, psf=psf, camera=camera)  # type: ignore[arg-type]
        truth = {**shown.row(), **settings} | ({} if psf is None else {"mtf": shown.mtf})
        line = f"{sigma_dn:9.2f} {shown.unclipped_sigma_dn:8.2f} {shown.clipped_sigma_dn:10.2f}"
        return CorruptedPicture(np.asarray(shown.image), truth, f"{line} {100 * shown.clipped_fraction:9.2f}")

    files = expand(paths)
    header = f"{'asked DN':>9} {'reached':>8} {'clipped to':>10} {'clipped %':>9}"
    smoothed = psf is not None and effects.photon and sigma_dn
    frames = (frame[:3] for frame in readable(files, every))
    written, set_aside = write_each(frames, files, out, header, corrupted, SMOOTHED_NOTE if smoothed else "")
    if written and (psf is None or idle) and context.get_parameter_source("sigma_dn") is ParameterSource.DEFAULT:
        more = "a larger --size-px" if idle else "--blur"
        click.echo(f"warning: these are copies; give --sigma-dn, {more} or --pipeline to corrupt them", err=True)
    set_aside.refuse()


def _check_options(context: click.Context, preset: str | None) -> None:
    """Options of the two kinds of cameras are not mixed.

    Raises:
        InputError: they are.
    """
    from click.core import ParameterSource

    from pipeline.errors import InputError

    processed = {"iso", "shots"}
    sensor = {"noise_source", "sigma_dn", "blur", "size_px", "mtf50", "angle_deg", "camera"}
    for name in sorted(processed if preset is None else sensor):
        if context.get_parameter_source(name) is ParameterSource.COMMANDLINE:
            option = f"--{name.replace('_', '-')}"
            clash = "needs --pipeline NAME" if preset is None else f"is not combined with --pipeline {preset}"
            raise InputError(f"{option}: {clash}")
