"""``camera-monitor calibrate``: the sharpness of the user's camera, measured once and stored under a name."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

LEAST_MTF = 0.05  # a chart's MTF is not taken below this: it is noise there


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
@click.argument("paths", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--chart", type=click.Choice(["edge", "star"]), help="PATHS show a chart instead of scenes")
@click.option(
    "--area", "areas", multiple=True, type=_Area(),
    help="with --chart edge: where a slanted edge crosses the picture; may be repeated, applies to every picture",
)  # fmt: skip
@click.option("--rays", type=click.IntRange(4, 2000), help="with --chart star: bright rays in a turn, an even number")
@click.option("--calibrate-estimator", is_flag=True, help="scenes: also correct the estimator's error (minutes)")
@click.option("--blur", "blur_name", default="spectral", show_default=True, help="blur estimator to calibrate")
def command(
    name: str, paths: tuple[Path, ...], chart: str | None, areas: tuple[tuple[int, int, int, int], ...],
    rays: int | None, calibrate_estimator: bool, blur_name: str,
) -> None:  # fmt: skip
    """Calibrate the camera NAME from PATHS and store it, so that --camera NAME reports blur relative to it.

    PATHS are pictures of ordinary scenes that are known to be sharp (some tens of different scenes are enough); or,
    with --chart, a chart taken by this camera, upright and in focus: a slanted edge, near-vertical and near-horizontal
    (two pictures or two --area), or a sinusoidal or black and white Siemens star whose rays reach 0.05 of Nyquist; its
    contrast there counts as full.

    Prints the MTF of the camera and the file, which is in the user's configuration folder (CAMERA_MONITOR_HOME).
    """
    from pipeline.camera.mtf import DIRECTIONS, FREQUENCIES
    from pipeline.cli import camera_store
    from pipeline.cli.package_version import version
    from pipeline.cli.pictures import expand, read
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
    frames = [(file, image) for path in expand(paths) for file, image in read(path)]
    shape = frames[0][1].shape
    for file, image in frames:
        if image.shape != shape:
            sizes = f"{image.shape[1]}x{image.shape[0]} px, {frames[0][0]} {shape[1]}x{shape[0]} px"
            raise InputError(f"{file} is {sizes}; calibrate one size at a time")
    hashes: dict[str, str] = {}
    mtf: NDArray[np.float64] | None
    fit = None
    if chart == "edge":
        mtf = edge_mtf(frames, areas)
    elif chart == "star":
        assert rays is not None
        mtf = star_mtf([image for _, image in frames], rays)
    else:
        mtf, fit, hashes = _from_scenes([image for _, image in frames], blur_name, calibrate_estimator)
    stored = camera_store.StoredCamera(
        name=name, kind=f"{chart} chart" if chart else "fit" if fit else "sharp frames", blur_estimator=blur_name,
        weights_sha256=hashes, size_px=(shape[0], shape[1]), frames=len(frames),
        sharp_mtf=None if mtf is None else mtf.tolist(), fit=fit, version=version(),
    )  # fmt: skip
    if mtf is not None:
        click.echo(f"{'Nyquist':10} {' '.join(f'{frequency:5.2f}' for frequency in FREQUENCIES)}")
        for direction, curve in zip(DIRECTIONS, mtf, strict=True):
            click.echo(f"{direction:10} {' '.join(f'{value:5.2f}' for value in curve)}")
    if fit is not None:
        before, after = fit["error_percent"]
        click.echo(f"mean absolute error on {fit['samples']} blurred patches: {before:.1f} %, calibrated {after:.1f} %")
    click.echo(f"written to {camera_store.save(stored)}")


def edge_mtf(
    frames: list[tuple[str, NDArray[np.float32]]], areas: tuple[tuple[int, int, int, int], ...]
) -> NDArray[np.float64]:
    """(2, 8) MTF from slanted edges, the mean of those of each axis.

    Args:
        frames: names and pictures (H, W) in [0, 1].
        areas: (x, y, width, height) px of the edges in every picture; none for the whole picture.

    Raises:
        InputError: an area outside of a picture, no slanted edge, or none of one axis.
    """
    import numpy as np

    from pipeline.camera.mtf import DIRECTIONS
    from pipeline.camera.slanted_edge import measure
    from pipeline.errors import InputError

    curves: dict[str, list[NDArray[np.float64]]] = {direction: [] for direction in DIRECTIONS}
    for name, image in frames:
        for x, y, width, height in areas or [(0, 0, image.shape[1], image.shape[0])]:
            if x + width > image.shape[1] or y + height > image.shape[0]:
                raise InputError(f"--area {x},{y},{width},{height} is not inside of {name}")
            try:
                edge = measure(image[y : y + height, x : x + width])
            except InputError as error:
                raise InputError(f"{name}: {error}") from None
            curves[edge.direction].append(edge.mtf)
    for direction, tilt in zip(DIRECTIONS, ("vertical", "horizontal"), strict=True):
        if not curves[direction]:
            raise InputError(f"no nearly {tilt} edge, which gives the {direction} MTF; add one by a picture or --area")
    return np.maximum(np.stack([np.mean(curves[direction], axis=0) for direction in DIRECTIONS]), LEAST_MTF)


def star_mtf(images: list[NDArray[np.float32]], rays: int) -> NDArray[np.float64]:
    """(2, 8) MTF from Siemens stars, the mean over pictures.

    Args:
        images: (H, W) in [0, 1].
        rays: bright rays in a full turn, an even number, which makes the star point-symmetric.

    Raises:
        InputError: an odd number of rays, or a star too small for the lowest frequency.
    """
    import numpy as np

    from pipeline.camera import star
    from pipeline.camera.star_centre import point_of_symmetry
    from pipeline.errors import InputError

    if rays % 2:
        raise InputError(f"--rays {rays}: expected an even number, whose centre can be located by symmetry")
    curves = []
    for image in images:
        contrast = star.measure_mtf(image, point_of_symmetry(image), rays, amplitude=1.0)
        if not contrast.max() > 0.02:
            raise InputError("no Siemens star of that number of rays in the picture; check --rays")
        curves.append(contrast / contrast[:, :1])
    return np.clip(np.mean(curves, axis=0), LEAST_MTF, 1.0)


def _from_scenes(
    images: list[NDArray[np.float32]], blur_name: str, calibrate_estimator: bool
) -> tuple[NDArray[np.float64] | None, dict[str, Any] | None, dict[str, str]]:
    """The MTF that the estimator reports of sharp frames, or its calibration, and the hashes of its weights."""
    import numpy as np

    from pipeline import blur
    from pipeline.blur.base import PATCH_PX, Estimator
    from pipeline.blur.camera_calibration import Calibration, CameraFittable, calibrate
    from pipeline.datasets.patches import cut, tiles
    from pipeline.errors import InputError
    from pipeline.recording.provenance import blur_weights

    estimator = blur.create(blur_name)
    cuts = [cut(image, tiles(image.shape, PATCH_PX, "cover")) for image in images if min(image.shape) >= PATCH_PX]
    if not cuts:
        raise InputError(f"sharp pictures: none is as large as a patch of {PATCH_PX} px; give whole frames")
    patches = np.concatenate(cuts)
    hashes = blur_weights(blur_name)
    if calibrate_estimator:
        camera = calibrate(estimator, patches)
        if not isinstance(camera, Calibration):
            raise InputError(
                f"--calibrate-estimator: the calibration of {blur_name} cannot be stored; leave the option out"
            )
        return None, camera.content(), hashes
    if not isinstance(estimator, Estimator) or isinstance(estimator, CameraFittable):
        raise InputError(f"--blur {blur_name}: its calibration cannot be stored; choose spectral, pmp or gbb")
    made = estimator.divided(patches)
    assert made.sharp_mtf is not None
    return np.maximum(made.sharp_mtf, LEAST_MTF), None, hashes
