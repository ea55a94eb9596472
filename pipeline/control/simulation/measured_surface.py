"""The surface that control asks: average precision over noise and motion, formed by the camera that is controlled.

Frames are formed in linear light at constant brightness: the gain sets the noise (the light falls as the gain rises),
the speed of the image sets the motion. All views share light and gain, as they share the camera in the loop: some are
darker and noisier than others. Noise is every 5 DN up to 40, motion up to 31 px; noise and motion of a knot are
the true ones, and the monitor's median estimates at the knots calibrate its estimates of noise. Small and distant
objects count from ``min_height_px`` on. Intervals are as wide as the number of viewpoints asks
(`pipeline.cluster_intervals`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.bisection import bisected
from pipeline.camera.exposure import Camera, Motion, noise_generator
from pipeline.control.motion import motion_mtf
from pipeline.control.performance import Performance
from pipeline.control.simulation.scoring import Score, average_precision
from pipeline.control.simulation.tables import KNOTS
from pipeline.control.simulation.views import View
from pipeline.curves.cells import Cells
from pipeline.curves.surface import Surface
from pipeline.detection import opened
from pipeline.detection.base import Detections
from pipeline.detection.inference import detections_in
from pipeline.errors import InputError
from pipeline.streams import stream

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.condition import ConditionMonitor
    from pipeline.detection.settings import EvaluationSettings

FREQUENCY_INDEX = 0
"""0.054 of Nyquist: the one of the eight frequencies whose MTF falls steadily up to 31 px of motion."""

Measured = tuple[View, Mapping[str, NDArray[Any]]]
"""A view and what `measure` gives for it."""

_LARGEST_GAIN = 4096.0
_LEAST_STEP_DN = 0.05


@dataclass(frozen=True)
class SurfaceDesign:
    """Which conditions are measured.

    Attributes:
        target_sigmas_dn: target noise, rising; 0 is base gain.
        sizes_px: motion, rising; 0 first, for the MTF of sharp frames is the reference.
        target_level: mean encoded level of every frame.
        exposure_s: of every frame.
    """

    target_sigmas_dn: tuple[float, ...]
    sizes_px: tuple[float, ...]
    target_level: float
    exposure_s: float

    def __post_init__(self) -> None:
        for name in ("target_sigmas_dn", "sizes_px"):
            values = list(getattr(self, name))
            if len(values) < 2 or sorted(set(values)) != values or values[0] < 0:
                raise InputError(f"control.surface.{name}: expected at least two rising numbers from 0 on")
        if self.sizes_px[0] != 0:
            raise InputError(
                f"control.surface.sizes_px: begins at {self.sizes_px[0]:g}; expected 0 first, the sharp frames, whose "
                "MTF is the reference of every motion"
            )


@lru_cache(maxsize=1)
def monitor() -> ConditionMonitor:
    """The default condition monitor, kept open by each worker process."""
    from pipeline.condition import ConditionMonitor

    return ConditionMonitor()


def light_for_level(camera: Camera, radiance: NDArray[np.float32], target_level: float, exposure_s: float) -> float:
    """Illumination at which a scene has a mean encoded level at gain 1, by bisection."""
    thin = radiance.reshape(-1)[:: max(1, radiance.size // 20_000)].astype(np.float64)
    unit = thin * exposure_s / (camera.radiance_at_full_scale * camera.reference_exposure_s)

    def mean_level(light: float) -> float:
        return float((np.clip(unit * light, 0.0, 1.0) ** (1.0 / camera.gamma)).mean())

    return float(2.0 ** bisected(lambda stops: mean_level(2.0**stops) >= target_level, -20.0, 20.0, 50))


def gain_for_sigma(
    camera: Camera, radiance: NDArray[np.float32], light: float, exposure_s: float, sigma_dn: float
) -> float:
    """Gain at which noise after the tone curve reaches a target at constant brightness; at least 1."""
    thin = radiance[::8, ::8]

    def noise(gain: float) -> float:
        return camera.sigma_dn(camera.electrons(thin, exposure_s, light / gain), gain, exposure_s)

    if noise(1.0) >= sigma_dn:
        return 1.0
    most_stops = np.log2(_LARGEST_GAIN)
    if noise(2.0**most_stops) < sigma_dn:
        raise InputError(f"control.surface.target_sigmas_dn: this camera does not reach {sigma_dn:g} DN at any gain")
    return float(2.0 ** bisected(lambda stops: noise(2.0**stops) >= sigma_dn, 0.0, most_stops, 30))


@dataclass(frozen=True)
class Exposures:
    """Light and gains that all views are seen with.

    Attributes:
        light: illumination at which the median view has the design's mean level at gain 1.
        gains: for each noise level, that at which the median view has this noise.
    """

    light: float
    gains: tuple[float, ...]


def exposures(views: Sequence[View], camera: Camera, design: SurfaceDesign) -> Exposures:
    """Light and gains of a design: medians over the views.

    Raises:
        InputError: the camera does not reach a noise level at any gain.
    """
    radiances = [view.radiance() for view in views]
    lights = [light_for_level(camera, each, design.target_level, design.exposure_s) for each in radiances]
    light = float(np.median(lights))
    gains = [
        [gain_for_sigma(camera, each, light, design.exposure_s, level) for level in design.target_sigmas_dn]
        for each in radiances
    ]
    return Exposures(light, tuple(float(gain) for gain in np.median(gains, axis=0)))


def measure(
    view: View,
    *,
    camera: Camera,
    design: SurfaceDesign,
    shared: Exposures,
    kind: str,
    options: str,
    estimate: bool,
    seed: int,
) -> dict[str, NDArray[Any]]:
    """Detections and estimates in one view under every condition.

    Args:
        view: to look at.
        camera: forms the frames.
        design: conditions.
        shared: light and gains of all views.
        kind: registry name of the detector.
        options: of the detector, as JSON.
        estimate: whether the monitor is asked.
        seed: of the noise.

    Returns:
        ``condition`` (M,) number of the condition (level-major), ``boxes``, ``score``, ``label`` of detections;
        ``true_sigma`` (C,); ``sigma`` (C,) and ``mtf`` (C, 2, 8) of the monitor, NaN where it abstained or was not run.
    """
    radiance = view.radiance()
    detector = opened(kind, options)
    parts: list[tuple[NDArray[Any], ...]] = []
    count = len(design.target_sigmas_dn) * len(design.sizes_px)
    truth, sigma, mtf = np.zeros(count), np.full(count, np.nan), np.full((count, 2, 8), np.nan)
    for number in range(count):
        gain = shared.gains[number // len(design.sizes_px)]
        size = design.sizes_px[number % len(design.sizes_px)]
        frame = camera.expose(
            radiance, design.exposure_s, gain, noise_generator(seed, "surface", view.name),
            light=shared.light / gain, motion=Motion(size / design.exposure_s),
        )  # fmt: skip
        truth[number] = frame.sigma_dn
        detected = detections_in(detector, frame.image, kind).best()
        parts.append((np.full(len(detected), number), detected.boxes, detected.score, detected.label))
        if estimate:
            condition = monitor().frame(frame.image)
            sigma[number] = float(condition.sigma_dn.value)
            mtf[number] = condition.mtf.value
    position, boxes, score, label = (np.concatenate(column) for column in zip(*parts, strict=True))
    return {
        "condition": position,
        "boxes": boxes.reshape(-1, 4),
        "score": score,
        "label": label.astype(np.str_),
        "true_sigma": truth,
        "sigma": sigma,
        "mtf": mtf,
    }


def performance(
    measured: Sequence[Measured],
    design: SurfaceDesign,
    criteria: EvaluationSettings,
    fold: int,
    seed: int,
    darker: Sequence[Performance] = (),
) -> tuple[Performance, pd.DataFrame]:
    """The surface from views.

    Args:
        measured: views and what `measure` gave.
        design: the conditions.
        criteria: how detections are judged.
        fold: recorded in the table.
        seed: of the bootstrap.
        darker: surfaces of darker frames that stand beside it.

    Returns:
        the surface, and its knots (schema `KNOTS`).

    Raises:
        InputError: the views show no object, or the monitor abstains from every sharp frame.
    """
    levels, sizes = len(design.target_sigmas_dn), len(design.sizes_px)
    reference = _reference(measured)
    mtf = motion_mtf(np.asarray(design.sizes_px), reference, FREQUENCY_INDEX)
    truth = np.median([part["true_sigma"] for _, part in measured], axis=0)
    medians, answered = _estimated(measured, truth)
    grid = _rising(truth.reshape(levels, sizes))
    estimated = _rising(np.median(medians.reshape(levels, sizes), axis=1))
    calibration = np.stack([estimated, _rising(np.median(grid, axis=1))])
    scores = _scores(measured, levels * sizes, criteria, seed)
    table = _knots(measured, design, fold, scores, medians=medians, truth=truth, mtf=mtf, answered=answered)
    cells, viewpoints = _cells(design, scores, grid, mtf), min(score.viewpoints for score in scores)
    longest, level = design.sizes_px[-1], design.target_level
    surface = Surface(cells, scenes=viewpoints)
    return Performance(surface, reference, FREQUENCY_INDEX, longest, level, darker, calibration), table


def of_all_brightnesses(
    measured: Sequence[Sequence[Measured]],
    designs: Sequence[SurfaceDesign],
    criteria: EvaluationSettings,
    fold: int,
    seed: int,
) -> tuple[Performance, pd.DataFrame]:
    """The surface of the brightest design, which carries those of the darker ones.

    Args:
        measured: of each design, views and what `measure` gave.
        designs: the brightest first.
        criteria: how detections are judged.
        fold: recorded in the table.
        seed: of the bootstrap.

    Returns:
        the surface, and the knots of all designs (schema `KNOTS`), the darkest first.

    Raises:
        InputError: see `performance`.
    """
    import pandas as pd

    darker, tables = [], []
    for views, design in zip(measured[:0:-1], designs[:0:-1], strict=True):
        surface, table = performance(views, design, criteria, fold, seed)
        darker.append(surface)
        tables.append(table)
    surface, table = performance(measured[0], designs[0], criteria, fold, seed, darker)
    return surface, pd.concat([*tables, table])


def fold_sets(folds: int) -> dict[str, list[int]]:
    """Folds that each stored surface is of: ``all``, each one, and all without each one (it, if there is no other)."""
    everything = list(range(folds))
    sets = {"all": everything}
    for number in everything:
        sets[f"fold{number}"] = [number]
        sets[f"without_fold{number}"] = [other for other in everything if other != number] or [number]
    return sets


def _reference(measured: Sequence[Measured]) -> NDArray[np.float64]:
    """(2, 8) median MTF of the sharp frames.

    Raises:
        InputError: the monitor abstains from all of them.
    """
    with np.errstate(all="ignore"):
        reference: NDArray[np.float64] = np.nanmedian(np.stack([part["mtf"][0] for _, part in measured]), axis=0)
    if not np.isfinite(reference).all():
        raise InputError("control surface: the monitor abstains from every sharp frame, so there is no reference MTF")
    return reference


def _estimated(
    measured: Sequence[Measured], truth: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """(C,) median estimate of the noise in every condition, the true noise where all abstain; and (C,) estimates."""
    sigma = np.stack([part["sigma"] for _, part in measured])
    answered = np.isfinite(sigma).sum(axis=0)
    medians = [np.nanmedian(sigma[:, n]) if answered[n] else truth[n] for n in range(len(truth))]
    return np.array(medians), answered


def _scores(measured: Sequence[Measured], conditions: int, criteria: EvaluationSettings, seed: int) -> list[Score]:
    """Average precision in every condition, of the same resamples."""
    views, scores = [view for view, _ in measured], []
    for number in range(conditions):
        results = [
            Detections.of(*(part[name][part["condition"] == number] for name in ("boxes", "score", "label")))
            for _, part in measured
        ]
        scores.append(average_precision(results, views, criteria, stream(seed, "control surface")))
    return scores


def _knots(
    measured: Sequence[Measured],
    design: SurfaceDesign,
    fold: int,
    scores: Sequence[Score],
    *,
    medians: NDArray[np.float64],
    truth: NDArray[np.float64],
    mtf: NDArray[np.float64],
    answered: NDArray[np.int64],
) -> pd.DataFrame:
    """The knots as a table: schema `KNOTS`.

    Raises:
        InputError: the views show no object.
    """
    import pandas as pd

    sizes = len(design.sizes_px)
    requested = sum(bool(np.isfinite(part["mtf"]).any() or np.isfinite(part["sigma"]).any()) for _, part in measured)
    rows = [
        {
            "fold": fold,
            "level": design.target_level,
            "target_sigma_dn": design.target_sigmas_dn[number // sizes],
            "motion_px": design.sizes_px[number % sizes],
            "sigma_dn": medians[number],
            "true_sigma_dn": truth[number],
            "mtf": mtf[number % sizes],
            "ap_percent": score.ap_percent,
            "low_percent": score.low_percent,
            "high_percent": score.high_percent,
            "objects": score.objects,
            "estimates": int(answered[number]),
            "estimates_abstained": int(requested - answered[number]),
        }
        for number, score in enumerate(scores)
    ]
    table = KNOTS.conform(pd.DataFrame(rows))
    if not np.isfinite(table["ap_percent"]).all():
        raise InputError("control surface: the views show no object to find; use more viewpoints")
    return table


def _cells(
    design: SurfaceDesign, scores: Sequence[Score], grid: NDArray[np.float64], mtf: NDArray[np.float64]
) -> Cells:
    """One bin per condition, in rising noise and MTF.

    Args:
        design: the conditions.
        scores: of every condition, level-major.
        grid: (levels, sizes) true noise, DN.
        mtf: (sizes,) MTF of each motion.
    """
    turned = slice(None, None, -1)  # MTF rises where motion falls
    precision = np.array([score.ap_percent for score in scores]).reshape(grid.shape)
    draws = np.moveaxis(np.stack([score.draws for score in scores]), 1, 0).reshape(-1, *grid.shape)
    return Cells(
        np.asarray(design.target_sigmas_dn, dtype=float),
        mtf[turned],
        np.ones(grid.shape, dtype=np.int64),
        grid[:, turned],
        np.broadcast_to(mtf[turned], grid.shape).copy(),
        precision[:, turned],
        draws[:, :, turned],
        0,
    )


def _rising(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values that rise along the first axis: noise grows with its level, and scatter does not fold the surface."""
    rising = np.array(values, dtype=np.float64)
    rising[0] = np.maximum(rising[0], _LEAST_STEP_DN)
    for row in range(1, len(rising)):
        rising[row] = np.maximum(rising[row], rising[row - 1] + _LEAST_STEP_DN)
    return rising
