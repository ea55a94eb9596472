"""The paper's two worked examples (Wischow et al. 2023, Sec. VI), simulated on rendered views.

Example 1: 760 px/s, ISO 400 and 4 ms with about 20 DN of noise; the rule trades noise for blur: ISO 100 and 16 ms.
Example 2: a robot's built-in exposure control against fixed settings (8 ms, ISO 100) and one jump of the rule to
3.73 ms after three seconds. The paper's three average precisions come from three drives; here all settings look at the
same views. Noise grows with the gain as the paper assumes (``noise_gain: linear``).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.bisection import bisected
from pipeline.camera.exposure import Camera, Motion, noise_generator
from pipeline.control.motion import motion_length
from pipeline.control.observation import estimates
from pipeline.control.policies.iopc_target import alpha
from pipeline.control.simulation import example_pictures
from pipeline.control.simulation.measured_surface import light_for_level, monitor
from pipeline.control.simulation.replay import BRIGHTNESS_LEVELS_PER_MS, PERIOD_MS, replay
from pipeline.control.simulation.scoring import average_precision
from pipeline.control.simulation.tables import CONTROLLER_AP, EXAMPLE_STEPS, RESPONSE
from pipeline.control.simulation.views import View
from pipeline.control.state import CameraState
from pipeline.detection import opened
from pipeline.detection.base import Detections
from pipeline.detection.classes import CLASS_MAPS
from pipeline.detection.inference import detections_in
from pipeline.detection.matching import overlaps
from pipeline.streams import stream

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.detection.settings import EvaluationSettings

SPEED_1_PX_S, MOTION_1_PX, TARGET_1_PX = 760.0, 3, 12
SPEED_2_PX_S, MOTION_2_PX, TARGET_2_PX = 15.0 / 0.008, 15, 7
SIGMA_1_DN = 20.0
WAIT_MS = 3000.0
LABEL = "car"
EXAMPLES = {"1": "sim_yolov4_car", "2": "robot"}
"""Number of an example -> its name in the published file."""
_LEVELS = 64.0
_AT = 1  # 0.1 of Nyquist among the eight frequencies
_IOU = 0.5


@dataclass(frozen=True)
class Shot:
    """One setting that the views are seen at.

    Attributes:
        name: unique.
        state: settings.
        speed_px_s: of the image.
        brightness: linear mean level at these settings; the light follows from it.
        full_well_e: of the sensor, which sets the noise.
    """

    name: str
    state: CameraState
    speed_px_s: float
    brightness: float
    full_well_e: float


def shots(camera: Camera, full_well_e: float) -> list[Shot]:
    """All settings of both examples.

    Args:
        camera: its sensor, for Example 2.
        full_well_e: full well that gives Example 1 its noise (`noisy_full_well`).
    """
    level = 0.5**camera.gamma
    start = CameraState.of(4, 400)
    final = start.traded(alpha(MOTION_1_PX, TARGET_1_PX))
    one = [
        Shot("1/reference", CameraState.of(4, 100), 0.0, level, 1e6),
        Shot("1/corrupted", start, SPEED_1_PX_S, level, full_well_e),
        Shot("1/gain_reduced", CameraState.of(4, 100), SPEED_1_PX_S, level / 4.0, full_well_e),
        Shot("1/final", final, SPEED_1_PX_S, level, full_well_e),
    ]
    first = CameraState.of(8, 100)
    second = first.traded(alpha(MOTION_2_PX, TARGET_2_PX))
    well = camera.sensor.full_well_e
    typical = float(np.median(BRIGHTNESS_LEVELS_PER_MS)) / _LEVELS
    two = [
        Shot("2/initial", first, SPEED_2_PX_S, typical * first.exposure_ms, well),
        Shot("2/final", second, SPEED_2_PX_S, typical * first.exposure_ms, well),
    ]
    times = replay(BRIGHTNESS_LEVELS_PER_MS)
    for index in range(10, 50, 8):  # the built-in controller, once it has left its start
        state = CameraState.of(float(times[index]), 100)
        mean = min(BRIGHTNESS_LEVELS_PER_MS[index] * state.exposure_ms / _LEVELS, 1.0)
        two.append(Shot(f"2/built_in_{index}", state, SPEED_2_PX_S, mean, well))
    return [*one, *two]


def noisy_full_well(camera: Camera, radiance: NDArray[np.float32]) -> float:
    """Full well at which (4 ms, ISO 400) has 20 DN of noise at kept brightness, by bisection."""
    thin = radiance[::8, ::8]

    def noise(full_well_e: float) -> float:
        at = replace(camera, noise_gain="linear", sensor=replace(camera.sensor, full_well_e=full_well_e))
        light = light_for_level(at, thin, 0.5, 0.004) / 4.0
        return at.sigma_dn(at.electrons(thin, 0.004, light), 4.0, 0.004)

    exponent = bisected(lambda exponent: noise(2.0**exponent) < SIGMA_1_DN, np.log2(100.0), np.log2(1e6), 30)
    return float(2.0**exponent)


def measure(
    view: View,
    *,
    camera: Camera,
    chosen: Sequence[Shot],
    kind: str,
    options: str,
    seed: int,
    window: example_pictures.Window | None = None,
) -> list[dict[str, Any]]:
    """One view at every setting: detections and estimates; in the window's view its picture too (``cut``)."""
    radiance = view.radiance()
    results = []
    for shot in chosen:
        at = replace(camera, noise_gain="linear", sensor=replace(camera.sensor, full_well_e=shot.full_well_e))
        encoded = min(shot.brightness, 0.95) ** (1.0 / camera.gamma)
        light = light_for_level(at, radiance, encoded, shot.state.exposure_s) / shot.state.gain
        frame = at.expose(
            radiance, shot.state.exposure_s, shot.state.gain, noise_generator(seed, "examples", view.name),
            light=light, motion=Motion(shot.speed_px_s),
        )  # fmt: skip
        detected = detections_in(opened(kind, options), frame.image, kind)
        sigma, mtf = estimates(monitor().frame(frame.image))
        results.append(
            {
                "boxes": detected.boxes,
                "score": detected.score,
                "label": detected.label,
                "sigma": float("nan") if sigma is None else float(sigma.value),
                "mtf": np.full((2, 8), np.nan) if mtf is None else np.asarray(mtf.value),
                "estimate": mtf,
                "blur_px": frame.blur_px,
                "best": best_score(detected, view, LABEL),
                "cut": None
                if window is None or window.view != view.name
                else example_pictures.cut(frame.image, detected, window),
            }
        )
    return results


def pictures(
    seen: Sequence[tuple[View, Sequence[Mapping[str, Any]]]], chosen: Sequence[Shot], window: example_pictures.Window
) -> tuple[dict[str, NDArray[np.uint8]], dict[str, Any]]:
    """The window's view at every setting: see `pipeline.control.simulation.example_pictures.gallery`."""
    (parts,) = [parts for view, parts in seen if view.name == window.view]
    cuts = {
        (EXAMPLES[shot.name.split("/")[0]], shot.name.split("/")[1]): part["cut"]
        for shot, part in zip(chosen, parts, strict=True)
    }
    return example_pictures.gallery(cuts, window)


def best_score(found: Detections, view: View, label: str) -> float:
    """Mean over the objects of a view of the best score of a detection on each; 0 where missed, NaN without any."""
    boxes = np.array([[b.x1, b.y1, b.x2, b.y2] for b in view.boxes if b.label == label and not b.ignore]).reshape(-1, 4)
    if not len(boxes):
        return float("nan")
    mine = found.where(found.label == label)
    if not len(mine):
        return 0.0
    shared = overlaps(mine.boxes, boxes, 0.0)[0] >= _IOU
    return float(np.where(shared, mine.score[:, None], 0.0).max(axis=0).mean())


def tables(
    seen: Sequence[tuple[View, Sequence[Mapping[str, Any]]]],
    chosen: Sequence[Shot],
    criteria: EvaluationSettings,
    seed: int,
) -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    """Steps of both examples, the response over time, and the controllers' average precision.

    Returns:
        schemas `EXAMPLE_STEPS`, `RESPONSE` and `CONTROLLER_AP`.
    """
    import pandas as pd

    views = [view for view, _ in seen]
    sharp = np.nanmedian([parts[0]["mtf"] for _, parts in seen], axis=0)
    rows, pools = [], {}
    for number, shot in enumerate(chosen):
        parts = [results[number] for _, results in seen]
        detected = [Detections.of(part["boxes"], part["score"], part["label"]) for part in parts]
        pools[shot.name] = detected
        score = average_precision(detected, views, criteria, stream(seed, "examples"))
        with np.errstate(all="ignore"):
            mtf = np.nanmedian([part["mtf"] for part in parts], axis=0)
        lengths = [motion_length(part["estimate"], sharp).value_px for part in parts if part["estimate"] is not None]
        example, step = shot.name.split("/")
        rows.append(
            {
                "example": EXAMPLES[example],
                "step": step,
                "exposure_ms": shot.state.exposure_ms,
                "iso": shot.state.iso,
                "sigma_dn": _median([part["sigma"] for part in parts]),
                "mtf_at_0.1": float((mtf / sharp)[:, _AT].mean()),
                "blur_px": parts[0]["blur_px"],
                "detection_score": _mean([part["best"] for part in parts]),
                "estimated_blur_px": _median(lengths),
                "ap_percent": score.ap_percent,
                "low_percent": score.low_percent,
                "high_percent": score.high_percent,
            }
        )
    cars = replace(CLASS_MAPS["sim"], wanted={LABEL: LABEL})
    built_in = [name for name in pools if name.startswith("2/built_in")]
    precision = []
    for controller, names in (
        ("camera_default", built_in), ("fixed_parameters", ["2/initial"]), ("proposed", ["2/final"])
    ):  # fmt: skip
        results = [one for name in names for one in pools[name]]
        score = average_precision(results, views * len(names), criteria, stream(seed, "controllers"), cars)
        values = {"low_percent": score.low_percent, "high_percent": score.high_percent}
        precision.append({"controller": controller, "car_ap_percent": score.ap_percent, **values})
    return (
        EXAMPLE_STEPS.conform(pd.DataFrame(rows)),
        response(),
        CONTROLLER_AP.conform(pd.DataFrame(precision)),
    )


def response() -> pd.DataFrame:
    """Exposure and gain over time of the built-in controller and of the rule: schema `RESPONSE`."""
    import pandas as pd

    rows = []
    first = CameraState.of(8, 100)
    second = first.traded(alpha(MOTION_2_PX, TARGET_2_PX))
    for index, time_ms in enumerate(replay(BRIGHTNESS_LEVELS_PER_MS)):
        at = index * PERIOD_MS
        state = first if at <= WAIT_MS else second
        for controller, exposure_ms, iso in (
            ("camera_default", float(time_ms), 100.0),
            ("proposed", state.exposure_ms, state.iso),
        ):
            for quantity, value in (("exposure_ms", exposure_ms), ("iso", iso)):
                rows.append({"controller": controller, "quantity": quantity, "time_ms": at, "value": value})
    return RESPONSE.conform(pd.DataFrame(rows))


def _median(values: Sequence[float]) -> float:
    known = [value for value in values if np.isfinite(value)]
    return float(np.median(known)) if known else float("nan")


def _mean(values: Sequence[float]) -> float:
    known = [value for value in values if np.isfinite(value)]
    return float(np.mean(known)) if known else float("nan")
