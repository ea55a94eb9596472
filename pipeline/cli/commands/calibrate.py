"""``camera-monitor calibrate``: the sharpness of the user's camera, measured once and stored under a name."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from pipeline.cli.options.given_paths import GivenPath

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


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
    # Estimators are loaded only now, once no option or picture can be refused any more.
    from pipeline.cli.calibration.charts import edge_mtf, star_mtf, storable
    from pipeline.cli.calibration.contrast import MOST_EMPTY_FRACTION, refuse_without_contrast
    from pipeline.cli.calibration.sharp_scenes import from_scenes

    if chart is None:
        _refuse_other_sizes(frames)
        measured = None
        stored = from_scenes(name, frames, blur_name, calibrate_estimator)
    else:
        measured = edge_mtf(frames, areas) if rays is None else star_mtf(frames, rays)
        refuse_without_contrast(measured, f"the {chart} chart", "focus the camera on it", MOST_EMPTY_FRACTION)
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
