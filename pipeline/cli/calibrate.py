"""``camera-monitor calibrate``: the sharpness of the user's camera, measured once and stored under a name."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pipeline.cli.given_paths import GivenPath

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

LEAST_MTF = 0.05  # a chart's MTF is not taken below this: it is noise there
MOST_EMPTY_FRACTION = 0.5  # of the 16 values of an MTF that may lie at or below the estimators' floor
MOST_EMPTY_FRACTION_FIT = 0.25  # likewise where the pictures are blurred further, to correct the estimator
CIRCLES = (1.0, 0.75, 0.5)  # on which the rays of a star are counted, of the circle of its lowest frequency
LEAST_EXPLAINED = 0.5  # of the variance along each of them; of black and white rays it is 0.8, of other pictures < 0.25
LEAST_AGREEMENT = 0.7  # correlation of the rays on neighbouring circles
LEAST_STAR_AMPLITUDE = 0.02  # of the rays at the lowest frequency, of full scale


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
    (two pictures or two --area, of any size), or a sinusoidal or black and white Siemens star whose rays reach 0.05 of
    Nyquist, which takes 12 pixels of diameter a ray (36 rays: 424 px); its contrast there counts as full.

    Warns of pictures that do not look sharp; refuses pictures without contrast at most frequencies, charts clipped at
    black or white, and a star whose number of rays is not that of --rays.

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
    for file, image in frames if chart is None else []:  # a chart's MTF does not depend on where it was cropped
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
        mtf = star_mtf(frames, rays)
    else:
        mtf, fit, hashes = _from_scenes(frames, blur_name, calibrate_estimator)
    if mtf is not None and chart is not None:
        _refuse_without_contrast(mtf, f"the {chart} chart", "focus the camera on it", MOST_EMPTY_FRACTION)
    stored = camera_store.StoredCamera(
        name=name, kind=f"{chart} chart" if chart else "fit" if fit else "sharp frames", blur_estimator=blur_name,
        weights_sha256=hashes, size_px=None if chart else (shape[0], shape[1]), frames=len(frames),
        sharp_mtf=None if mtf is None else mtf.tolist(), fit=fit, version=version(),
    )  # fmt: skip
    if mtf is not None:
        click.echo(f"{'Nyquist':10} {' '.join(f'{frequency:5.2f}' for frequency in FREQUENCIES)}")
        for direction, curve in zip(DIRECTIONS, mtf, strict=True):
            click.echo(f"{direction:10} {' '.join(f'{value:5.2f}' for value in curve)}")
    if fit is not None:
        before, after = fit["error_percent"]
        click.echo(f"mean absolute error on {fit['samples']} blurred patches: {before:.1f} %, calibrated {after:.1f} %")
    replaced = camera_store.path_of(name).is_file()
    click.echo(f"written to {camera_store.save(stored)}")
    if replaced:
        click.echo(f"replaces the stored calibration of {name}")


def edge_mtf(
    frames: list[tuple[str, NDArray[np.float32]]], areas: tuple[tuple[int, int, int, int], ...]
) -> NDArray[np.float64]:
    """(2, 8) MTF from slanted edges, the mean of those of each axis.

    That of a camera that sharpens may exceed 1, where it is stored as 1: estimators report 1 at most, so that division
    by more would find blur in the camera's own sharp frames.

    Args:
        frames: names and pictures (H, W) in [0, 1].
        areas: (x, y, width, height) px of the edges in every picture; none for the whole picture.

    Raises:
        InputError: an area outside of a picture, no slanted edge, one clipped at black or white, or none of one axis.
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
    mtf = np.stack([np.mean(curves[direction], axis=0) for direction in DIRECTIONS])
    return np.clip(mtf, LEAST_MTF, 1.0)  # estimates of sharpened frames end at 1 too


def star_mtf(frames: list[tuple[str, NDArray[np.float32]]], rays: int) -> NDArray[np.float64]:
    """(2, 8) MTF from Siemens stars, relative to its lowest frequency, the mean over pictures.

    Args:
        frames: names and pictures (H, W) in [0, 1].
        rays: bright rays in a full turn, an even number, which makes the star point-symmetric.

    Raises:
        InputError: an odd or too small number of rays, a star too small for the lowest frequency, with too little
            contrast, clipped at black or white, or with another number of rays, or no star.
    """
    import numpy as np

    from pipeline.camera import star
    from pipeline.camera.star_centre import point_of_symmetry
    from pipeline.errors import InputError

    if rays % 2:
        raise InputError(f"--rays {rays}: expected an even number, whose centre can be located by symmetry")
    if rays < star.LEAST_PERIODS:
        raise InputError(
            f"--rays {rays}: expected at least {star.LEAST_PERIODS}; fewer are too coarse for the highest frequency "
            "but a few pixels from the centre; use a star of more rays"
        )
    curves = []
    for name, image in frames:
        try:
            centre_px = point_of_symmetry(image)
        except InputError as error:
            raise InputError(f"{name}: {error}") from None
        _check_star(name, image, centre_px, rays)
        try:
            star.check_clipping(image, centre_px, rays)
        except InputError as error:
            raise InputError(f"{name}: {error}") from None
        contrast = star.measure_mtf(image, centre_px, rays, amplitude=1.0)
        if contrast[:, 0].min() < LEAST_STAR_AMPLITUDE:
            raise InputError(
                f"{name}: the rays of the star differ by {510 * contrast[:, 0].min():.0f} DN; expected at least "
                f"{510 * LEAST_STAR_AMPLITUDE:.0f}; light the chart better or expose longer"
            )
        curves.append(contrast / contrast[:, :1])
    return np.clip(np.mean(curves, axis=0), LEAST_MTF, 1.0)


def _check_star(name: str, image: NDArray[np.float32], centre_px: tuple[float, float], rays: int) -> None:
    """Raises InputError unless a picture shows a Siemens star of that number of rays, large enough."""
    import numpy as np

    from pipeline.camera import star
    from pipeline.errors import InputError

    radius_px = star.lowest_circle_px(rays)
    x, y = centre_px
    room_px = min(x, y, image.shape[1] - 1 - x, image.shape[0] - 1 - y)
    larger = f"a star of {rays} rays must be {2 * radius_px:.0f} px across"
    mend = "check --rays, take the whole star from nearer by, or use one of fewer rays"
    if room_px < radius_px:
        raise InputError(
            f"{name}: {larger}, but the picture ends {room_px:.0f} px from its centre ({x:.0f}, {y:.0f}); {mend}"
        )
    evidence = star.ray_evidence(image, centre_px, rays, radius_px * np.array(CIRCLES))
    present = (evidence.explained >= LEAST_EXPLAINED) & (evidence.extra_rays == 0)
    if present.all() and evidence.agreement.min() >= LEAST_AGREEMENT:
        return
    if present[-1] and not present[0]:
        raise InputError(f"{name}: {larger}, but its rays end before that; {mend}")
    if (
        evidence.explained.min() >= LEAST_EXPLAINED and (evidence.extra_rays % 2).any()
    ):  # where there are none they turn
        likely = "they do not go all the way round, part of it is hidden or without contrast"
    elif evidence.explained.min() >= LEAST_EXPLAINED and len(set(evidence.extra_rays.tolist())) == 1:
        likely = f"the star seems to have {rays + int(evidence.extra_rays[0])} rays"
    elif evidence.likely_explained >= LEAST_EXPLAINED:
        likely = f"the star seems to have about {evidence.likely_rays} rays"
    else:
        percent = ", ".join(f"{100 * value:.0f}" for value in evidence.explained)
        likely = f"such rays explain {percent} % of the variance along three circles about ({x:.0f}, {y:.0f})"
    raise InputError(
        f"{name}: no Siemens star of {rays} rays: {likely}; expected the bright rays in a full turn, of a star that "
        "fills the picture; check --rays and the picture"
    )


def _from_scenes(
    frames: list[tuple[str, NDArray[np.float32]]], blur_name: str, calibrate_estimator: bool
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
    large = [(name, image) for name, image in frames if min(image.shape) >= PATCH_PX]
    if not large:
        raise InputError(f"sharp pictures: none is as large as a patch of {PATCH_PX} px; give whole frames")
    hashes = blur_weights(blur_name)
    if not calibrate_estimator and (not isinstance(estimator, Estimator) or isinstance(estimator, CameraFittable)):
        raise InputError(f"--blur {blur_name}: its calibration cannot be stored; choose spectral, pmp or gbb")
    cuts = [cut(image, tiles(image.shape, PATCH_PX, "cover")) for _, image in large]
    mtfs = [estimator.estimate(patches).mtf for patches in cuts]
    patches = np.concatenate(cuts)
    if calibrate_estimator:
        _check_sharpness([name for name, _ in large], mtfs, MOST_EMPTY_FRACTION_FIT)
        camera = calibrate(estimator, patches)
        if not isinstance(camera, Calibration):
            raise InputError(
                f"--calibrate-estimator: the calibration of {blur_name} cannot be stored; leave the option out"
            )
        return None, camera.content(), hashes
    assert isinstance(estimator, Estimator)
    made = estimator.divided(patches)
    assert made.sharp_mtf is not None
    _check_sharpness([name for name, _ in large], mtfs, MOST_EMPTY_FRACTION)
    return np.maximum(made.sharp_mtf, LEAST_MTF), None, hashes


def _check_sharpness(names: list[str], mtfs: list[NDArray[Any]], most_empty_fraction: float) -> None:
    """Warn of pictures whose contrast falls to half too early; refuse them where too little contrast is left.

    Args:
        names: of the pictures.
        mtfs: (N, 2, 8) of the patches of each, NaN where the estimator abstained.
        most_empty_fraction: see `_refuse_without_contrast`.

    Raises:
        InputError: see `_refuse_without_contrast`.
    """
    import numpy as np

    from pipeline.cli.health import SHARP_MTF50
    from pipeline.condition.summary import half_contrast

    answered = [mtf[np.isfinite(mtf).all(axis=(1, 2))] for mtf in mtfs]
    every = np.concatenate(answered)
    if len(every):
        advice = "give pictures known to be sharp" + (
            ", or leave --calibrate-estimator out" if most_empty_fraction < MOST_EMPTY_FRACTION else ""
        )
        _refuse_without_contrast(np.median(every, axis=0), "the sharp pictures", advice, most_empty_fraction)
    for name, mtf in zip(names, answered, strict=True):
        mtf50 = float(half_contrast(np.median(mtf, axis=0)).min()) if len(mtf) else float("inf")
        if mtf50 < SHARP_MTF50:
            click.echo(
                f"warning: {name} does not look sharp: contrast falls to half at {mtf50:.2f} of Nyquist, expected "
                f"{SHARP_MTF50:g} or more; blur relative to it will be underestimated; leave it out, or take it anew",
                err=True,
            )


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
