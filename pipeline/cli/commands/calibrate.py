"""``camera-monitor calibrate``: the sharpness of the user's camera, measured once and stored under a name."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pipeline.cli.options.given_paths import GivenPath

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pipeline.cli.calibration.camera_store import StoredCamera

MOST_EMPTY_FRACTION = 0.5  # of the 16 values of an MTF that may lie at or below the estimators' floor
MOST_EMPTY_FRACTION_FIT = 0.25  # likewise where the pictures are blurred further, to correct the estimator


class _Area(click.ParamType):
    name = "X,Y,WIDTH,HEIGHT"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, int, int, int]:
        """Four whole numbers, the last two above 0."""
        parts = str(value).split(",")
        numbers = [int(part) if part.strip().isdigit() else -1 for part in parts]
        if len(parts) != 4 or min(numbers) < 0 or min(numbers[2:]) == 0:
            self.fail(f"{value}: expected X,Y,WIDTH,HEIGHT in pixels, e.g. 100,50,200,120", param, ctx)
        x, y, width, height = numbers
        return x, y, width, height


@click.command("calibrate")
@click.argument("name")
@click.argument("paths", nargs=-1, required=True, type=GivenPath())
@click.option("--chart", type=click.Choice(["edge", "star"]), help="PATHS show a chart instead of scenes")
@click.option(
    "--area", "areas", multiple=True, type=_Area(),
    help="with --chart edge: where a slanted edge crosses the picture; may be repeated, applies to every picture",
)  # fmt: skip
@click.option("--rays", type=click.IntRange(24, 2000), help="with --chart star: bright rays in a turn, even")
@click.option("--calibrate-estimator", is_flag=True, help="scenes: also correct the estimator's error (a minute)")
@click.option("--blur", "blur_name", default="spectral", show_default=True, help="blur estimator to calibrate")
def command(
    name: str, paths: tuple[Path, ...], chart: str | None, areas: tuple[tuple[int, int, int, int], ...],
    rays: int | None, calibrate_estimator: bool, blur_name: str,
) -> None:  # fmt: skip
    """Calibrate the camera NAME from PATHS and store it, so that --camera NAME reports blur relative to it.

    PATHS are pictures of ordinary scenes that are known to be sharp (some tens of different scenes are enough); or,
    with --chart, a chart taken by this camera, upright and in focus: a slanted edge, near-vertical and near-horizontal
    (tilted by about 5 degrees; two pictures or two --area, of any size), or a sinusoidal or black and white Siemens
    star whose rays reach 0.05 of Nyquist, which takes 12 pixels of diameter a ray (36 rays: 424 px); its contrast there
    counts as full. Print charts in two greys that reflect light as 4 : 1: behind a tone curve those of black and white
    are read too low (16 : 1 by up to 0.07).

    Warns of pictures that do not look sharp, and of those without a patch that can be measured, which it leaves out;
    refuses pictures without contrast at most frequencies, charts clipped at black or white or with too much noise for
    their contrast and size, and a star whose number of rays is not that of --rays. Warns of a camera that sharpens,
    whose MTF exceeds 1; it is stored as 1 there.

    Prints the MTF of the camera, of a chart as measured, and the file, which is in the user's configuration folder
    (CAMERA_MONITOR_HOME).
    """
    from pipeline.cli.calibration import camera_store
    from pipeline.cli.calibration.charts import edge_mtf, star_mtf, storable
    from pipeline.cli.frames.given_files import expand
    from pipeline.cli.frames.pictures import read
    from pipeline.cli.package_version import version
    from pipeline.errors import InputError
    from pipeline.executor import one_thread

    one_thread()
    camera_store.path_of(name)
    if areas and chart != "edge":
        raise InputError("--area is for --chart edge")
    if (rays is not None) != (chart == "star"):
        raise InputError("--chart star and --rays NUMBER belong together")
    if calibrate_estimator and chart is not None:
        raise InputError("--calibrate-estimator is for pictures of scenes, not for a chart")
    frames = [(file, image) for path in expand(paths) for file, image, _ in read(path)]
    if chart is None:
        _refuse_other_sizes(frames)
        measured = None
        stored = _from_scenes(name, frames, blur_name, calibrate_estimator)
    else:
        measured = edge_mtf(frames, areas) if rays is None else star_mtf(frames, rays)
        _refuse_without_contrast(measured, f"the {chart} chart", "focus the camera on it", MOST_EMPTY_FRACTION)
        stored = camera_store.StoredCamera(
            name=name, kind=f"{chart} chart", blur_estimator=blur_name, weights_sha256={}, size_px=None,
            frames=len(frames), sharp_mtf=storable(measured).tolist(), fit=None, version=version(),
        )  # fmt: skip
    replaced = camera_store.path_of(name).is_file()
    file = camera_store.save(stored)  # before anything is printed: a full or closed output loses nothing
    if stored.sharp_mtf is not None:
        _print_mtf(stored.sharp_mtf if measured is None else measured.tolist())
    if stored.fit is not None:
        before, after = stored.fit["error_percent"]
        samples = stored.fit["samples"]
        click.echo(f"mean absolute error on {samples} blurred patches: {before:.1f} %, calibrated {after:.1f} %")
    click.echo(f"written to {file}")
    if replaced:
        click.echo(f"replaces the stored calibration of {name}")


def _refuse_other_sizes(frames: list[tuple[str, NDArray[np.float32]]]) -> None:
    """Raises InputError for scenes of several sizes; a chart's MTF does not depend on where it was cropped."""
    from pipeline.errors import InputError

    first, shape = frames[0][0], frames[0][1].shape
    for file, image in frames:
        if image.shape != shape:
            sizes = f"{image.shape[1]}x{image.shape[0]} px, {first} {shape[1]}x{shape[0]} px"
            raise InputError(f"{file} is {sizes}; calibrate one size at a time")


def _print_mtf(mtf: list[list[float]]) -> None:
    """A line of frequencies, and one of contrast for each direction, (2, 8)."""
    from pipeline.camera.mtf import DIRECTIONS, FREQUENCIES

    click.echo(f"{'Nyquist':10} {' '.join(f'{frequency:5.2f}' for frequency in FREQUENCIES)}")
    for direction, curve in zip(DIRECTIONS, mtf, strict=True):
        click.echo(f"{direction:10} {' '.join(f'{value:5.2f}' for value in curve)}")


def _from_scenes(
    camera: str, frames: list[tuple[str, NDArray[np.float32]]], blur_name: str, calibrate_estimator: bool
) -> StoredCamera:
    """The MTF that the estimator reports of sharp frames, or its calibration; warns of frames that give no estimate."""
    import numpy as np

    from pipeline import blur
    from pipeline.answers import asked
    from pipeline.blur.base import Estimator
    from pipeline.blur.camera_calibration import Calibration, CameraFittable, calibrate
    from pipeline.cli.calibration.camera_store import StoredCamera
    from pipeline.cli.calibration.charts import LEAST_MTF
    from pipeline.cli.package_version import version
    from pipeline.condition.estimate import readable_patches
    from pipeline.errors import InputError, printable
    from pipeline.recording.provenance import blur_weights

    estimator = blur.create(blur_name)
    if not calibrate_estimator and (not isinstance(estimator, Estimator) or isinstance(estimator, CameraFittable)):
        raise InputError(f"--blur {blur_name}: its calibration cannot be stored; choose spectral, pmp or gbb")
    hashes = blur_weights(blur_name)
    names, cuts, mtfs = [], [], []
    for (name, _), part in zip(frames, readable_patches([image for _, image in frames]), strict=True):
        mtf = asked(f"blur estimator '{blur_name}'", estimator.estimate, part, "mtf").mtf
        answered = mtf[np.isfinite(mtf).all(axis=(1, 2))]
        if not len(answered):
            click.echo(
                f"warning: {printable(name)}: no patch can be measured (only shading and noise, saturated or covered); "
                "left out",
                err=True,
            )
            continue
        names.append(name)
        cuts.append(part)
        mtfs.append(answered)
    if not names:
        raise InputError("sharp pictures: no patch can be measured; give sharp pictures with structure")
    patches = np.concatenate(cuts)
    unsharp = _check_sharpness(names, mtfs, MOST_EMPTY_FRACTION_FIT if calibrate_estimator else MOST_EMPTY_FRACTION)
    fit = sharp_mtf = None
    if calibrate_estimator:
        fitted = calibrate(estimator, patches)
        if not isinstance(fitted, Calibration):
            raise InputError(
                f"--calibrate-estimator: the calibration of {blur_name} cannot be stored; leave the option out"
            )
        fit = fitted.content()
    else:
        assert isinstance(estimator, Estimator)
        divisor = estimator.divided(patches).sharp_mtf
        assert divisor is not None
        sharp_mtf = np.maximum(divisor, LEAST_MTF).tolist()
    height_px, width_px = frames[0][1].shape
    return StoredCamera(
        name=camera, kind="fit" if fit else "sharp frames", blur_estimator=blur_name, weights_sha256=hashes,
        size_px=(height_px, width_px), frames=len(names), sharp_mtf=sharp_mtf, fit=fit, version=version(),
        unsharp=unsharp,
    )  # fmt: skip


def _check_sharpness(names: list[str], mtfs: list[NDArray[Any]], most_empty_fraction: float) -> int:
    """Warn of pictures whose contrast falls to half too early; refuse them where too little contrast is left.

    Args:
        names: of the pictures.
        mtfs: (N, 2, 8) of the patches of each that the estimator answered, at least one.
        most_empty_fraction: see `_refuse_without_contrast`.

    Returns:
        how many pictures it warned of.

    Raises:
        InputError: see `_refuse_without_contrast`.
    """
    import numpy as np

    from pipeline.condition.summary import unsharp

    advice = "give pictures known to be sharp" + (
        ", or leave --calibrate-estimator out" if most_empty_fraction < MOST_EMPTY_FRACTION else ""
    )
    _refuse_without_contrast(np.median(np.concatenate(mtfs), axis=0), "the sharp pictures", advice, most_empty_fraction)
    doubts = [unsharp(np.median(mtf, axis=0)) for mtf in mtfs]
    for name, doubt in zip(names, doubts, strict=True):
        if doubt:
            click.echo(f"warning: {name} {doubt}; leave it out, or take it anew", err=True)
    return sum(map(bool, doubts))


def _refuse_without_contrast(mtf: NDArray[np.floating], subject: str, advice: str, most_empty_fraction: float) -> None:
    """Raises InputError for an MTF that estimates cannot be divided by.

    Args:
        mtf: (2, 8) at `pipeline.camera.mtf.FREQUENCIES`.
        subject: what it is of.
        advice: what else to give.
        most_empty_fraction: of the values that may lie at or below `pipeline.blur.base.SHARP_FLOOR`, beside those
            of the lowest frequency, which never may.
    """
    import numpy as np

    from pipeline.blur.base import SHARP_FLOOR
    from pipeline.errors import InputError

    empty = np.asarray(mtf) <= SHARP_FLOOR
    if empty.mean() > most_empty_fraction or empty[:, 0].any():
        raise InputError(
            f"{subject}: no contrast is left (MTF at most {SHARP_FLOOR:g}) at {empty.sum()} of {empty.size} values, so "
            f"that blur relative to them means nothing; {advice}"
        )
