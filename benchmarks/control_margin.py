"""Margin against a fall of light (`pipeline.control.precision.margin`) on random drives that are none of the scenarios.

    python benchmarks/control_margin.py [--out FILE] [--drives N] [--first N] [--margins M ...]

Light and speed of a drive are random: two steps of light by up to four stops either way, at half of the drives one
sudden speed, delays of 0 and 2 frames. Noise, motion and brightness follow in closed form from the radiance of a
rendered view; the policy sees them as estimates with the monitor's calibration, its shrinking of short motion (by a
third below 6 px) and scatter of 6 %. It asks the surface of the other viewpoints; the surface of its viewpoints is the
judge. The differences to the first margin are paired over drives, with their 95 % interval. No detector runs. Needs
``dvc repro control_surface``.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks import common  # noqa: E402

common.one_thread()

import numpy as np  # noqa: E402
from numpy.typing import NDArray  # noqa: E402

from pipeline import control  # noqa: E402
from pipeline.camera.exposure import SATURATED_LEVEL, Camera  # noqa: E402
from pipeline.control.motion import motion_mtf  # noqa: E402
from pipeline.control.observation import Estimate, Observation, Outcome  # noqa: E402
from pipeline.control.performance import Performance  # noqa: E402
from pipeline.control.policy import ControlledCamera  # noqa: E402
from pipeline.control.simulation.views import View, folds, views  # noqa: E402
from pipeline.control.state import CameraState, DelayLine, Limits  # noqa: E402
from pipeline.streams import stream  # noqa: E402

FRAMES, FIRST_COUNTED, FALL_STOPS = 36, 6, 2.0
SHORT_PX, SHORT_FACTOR, LONG_FACTOR, LONGEST_SEEN_PX, SCATTER = 6.0, 0.65, 0.95, 22.8, 0.06
THINNING = 16
BLANK = np.zeros((1, 1), np.float32)


@dataclass(frozen=True)
class Drive:
    """Light and speed of every frame, and the delay."""

    number: int
    light: list[float]
    speed_px_s: list[float]
    delay_frames: int

    def after_fall(self) -> NDArray[np.bool_]:
        """Frames taken before new settings can take effect after a fall of light by two stops or more."""
        falls = np.flatnonzero(np.diff(np.log2(self.light)) < -FALL_STOPS) + 1
        steps = np.arange(FRAMES)
        return np.any([(steps >= fall) & (steps <= fall + self.delay_frames) for fall in falls], axis=0) & (steps > 0)


def drive(number: int) -> Drive:
    """A random drive."""
    draw = stream(number, "random drive")
    light, speed = 2.0 ** draw.uniform(-4, 0), float(np.exp(draw.uniform(*np.log([60, 1500]))))
    steps = set(draw.choice(np.arange(8, FRAMES - 6), 2, replace=False).tolist())
    sudden = int(draw.integers(8, FRAMES - 6)) if draw.random() < 0.5 else -1
    lights, speeds = [], []
    for step in range(FRAMES):
        if step in steps:
            light = float(np.clip(light * 2.0 ** draw.uniform(-4, 4), 1 / 24, 1.0))
        if step == sudden:
            speed = float(np.exp(draw.uniform(*np.log([60, 1500]))))
        lights.append(light)
        speeds.append(speed)
    return Drive(number, lights, speeds, (0, 0, 2)[number % 3])


def truth(
    camera: Camera, radiance: NDArray[np.float32], state: CameraState, light: float, speed: float
) -> tuple[Outcome, float]:
    """Noise, motion and mean level of a frame, in closed form, and the fraction of its pixels at white."""
    electrons = camera.electrons(radiance, state.exposure_s, light)
    level = np.clip(electrons * state.gain / camera.sensor.full_well_e, 0.0, 1.0)
    mean = float((level ** (1.0 / camera.gamma)).mean())
    here = Outcome(camera.sigma_dn(electrons, state.gain, state.exposure_s), speed * state.exposure_s, mean)
    return here, float((level >= SATURATED_LEVEL).mean())


def seen(here: Outcome, saturated: float, surface: Performance, draw: np.random.Generator) -> Observation:
    """What estimators with the monitor's errors make of a frame."""
    length = min(here.motion_px * (SHORT_FACTOR if here.motion_px < SHORT_PX else LONG_FACTOR), LONGEST_SEEN_PX)
    length *= float(np.exp(draw.normal(0.0, SCATTER)))
    estimated, true = surface.calibration
    scale = np.interp(here.sigma_dn, true, estimated / true)
    sigma = np.asarray(max(here.sigma_dn * scale * np.exp(draw.normal(0.0, SCATTER)), 0.05))
    along = [motion_mtf(length, surface.reference, index, 0.0) for index in range(8)]
    horizontal = np.clip(2.0 * np.array(along) - surface.reference[1], 0.0, 1.0)  # their mean is over both axes
    mtf = np.stack([horizontal, surface.reference[1]])
    band = Estimate(mtf, np.clip(mtf - 0.01, 0, 1), np.clip(mtf + 0.01, 0, 1))
    return Observation(
        BLANK, here.mean_level, saturated, Estimate(sigma, np.asarray(0.9 * sigma), np.asarray(1.1 * sigma)), band
    )


def judged(surface: Performance, here: Outcome, saturated: float) -> float:
    """Average precision of a frame on a surface: none beyond it or of white pixels; darker frames as the darkest."""
    level = float(np.clip(here.mean_level, surface.darkest_level, surface.level))
    return (1.0 - saturated) * float(np.nan_to_num(surface.ap_percent(here.sigma_dn, here.motion_px, level)))


def precision(item: Drive, margin: float, view: View, asked: Performance, judge: Performance) -> NDArray[np.float64]:
    """Average precision of every frame of a drive."""
    limits = Limits(exposure_steps_per_stop=6, gain_step_db=1.0, delay_frames=item.delay_frames)
    camera = ControlledCamera(limits)
    policy = control.create("iopc_optimal", camera=camera, performance=asked, margin=margin)
    radiance = view.radiance()[::THINNING, ::THINNING]
    state = limits.nearest(0.008, 2.0)
    line, results = DelayLine.filled(state, item.delay_frames), []
    for step, (light, speed) in enumerate(zip(item.light, item.speed_px_s, strict=True)):
        here, saturated = truth(camera.formation, radiance, state, light, speed)
        results.append(judged(judge, here, saturated))
        decision = policy.decide(seen(here, saturated, asked, stream(item.number, "estimates", step)), state)
        state = line.next(decision.state)
    return np.array(results)


def compared(results: Sequence[NDArray[np.float64]]) -> list[dict[str, float]]:
    """Mean of every margin and its paired difference to the first with the half width of its 95 % interval."""
    rows = []
    for values in results:
        difference = values - results[0]
        half = 1.96 * float(difference.std()) / max(len(difference) - 1, 1) ** 0.5
        means = {"ap_percent": values.mean(), "difference": difference.mean(), "half_width": half}
        rows.append({name: round(float(value), 2) for name, value in means.items()})
    return rows


def main(arguments: list[str] | None = None) -> None:
    """Measure and write the record."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--drives", type=int, default=96)
    parser.add_argument("--first", type=int, default=2000)
    parser.add_argument("--margins", type=float, nargs="+", default=[0.07, 0.0, 0.2, 0.3])
    options = parser.parse_args(arguments)
    every = folds(views(ROOT / "data/sim", moments=1), 8, 2)
    load = {f"{kind}{fold}": Performance.load(ROOT / f"data/control_surface/{kind}{fold}.npz")
            for kind in ("fold", "without_fold") for fold in (0, 1)}  # fmt: skip
    whole: list[list[float]] = [[] for _ in options.margins]
    calm: list[list[float]] = [[] for _ in options.margins]
    after: list[list[float]] = [[] for _ in options.margins]
    for number in range(options.first, options.first + options.drives):
        item, fold = drive(number), number % 2
        view = every[fold][number // 2 % len(every[fold])]
        falls = item.after_fall()
        counted = np.arange(FRAMES) >= FIRST_COUNTED
        for index, margin in enumerate(options.margins):
            ap = precision(item, margin, view, load[f"without_fold{fold}"], load[f"fold{fold}"])
            whole[index].append(float(ap[counted].mean()))
            calm[index].append(float(ap[counted & ~falls].mean()))
            if falls.any():
                after[index].append(float(ap[falls].mean()))
    record = {
        "machine": common.machine("numpy"),
        "drives": options.drives,
        "first_drive": options.first,
        "drives_with_a_fall": len(after[0]),
        "margins": options.margins,
        "all_frames": compared([np.array(part) for part in whole]),
        "frames_after_a_fall": compared([np.array(part) for part in after]),
        "other_frames": compared([np.array(part) for part in calm]),
    }
    print(common.write("control_margin", record, options.out))


if __name__ == "__main__":
    common.run(main)
