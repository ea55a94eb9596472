"""Cameras, surfaces and observations for tests of control, all made from formulas."""

from __future__ import annotations

import copy
import functools
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline.camera.exposure import Camera
from pipeline.control.motion import CYCLES_PER_PX, motion_mtf
from pipeline.control.observation import Estimate, Observation, Outcome
from pipeline.control.performance import Performance
from pipeline.control.policy import ControlledCamera
from pipeline.control.state import CameraState, Limits
from pipeline.curves.cells import Cells
from pipeline.curves.surface import Surface
from pipeline.detection.settings import EvaluationSettings
from pipeline.store import write_image
from pipeline.streams import stream

REFERENCE = np.tile(np.exp(-2.0 * CYCLES_PER_PX), (2, 1))
SIGMAS, SIZES = np.arange(0.0, 41.0, 5.0), np.array([0.0, 3, 7, 11, 15, 21, 31])
CAMERA = ControlledCamera(Limits(), Camera())


def judged_with(draws: int = 300) -> EvaluationSettings:
    """Rules of the paper with so many resamples."""
    return EvaluationSettings(
        rule="paper", iou_threshold=0.5, min_height_px=25.0, min_visible_fraction=0.3, bootstrap_draws=draws
    )


def formula_ap(sigma_dn, motion_px):
    """A smooth surface that falls with noise and with motion."""
    return 95.0 * np.exp(-np.asarray(sigma_dn, float) / 30.0) * np.exp(-((np.asarray(motion_px, float) / 14.0) ** 2))


def made_once(make: Callable[..., Performance]) -> Callable[..., Performance]:
    """Tabulates a surface once a process; each caller has a copy, whose attributes are its own to change."""
    cached = functools.cache(make)

    @functools.wraps(make)
    def copied(*arguments: float) -> Performance:
        return copy.copy(cached(*arguments))

    return copied


@made_once
def performance() -> Performance:
    """`formula_ap` measured at the knots of the control surface."""
    mtf = motion_mtf(SIZES, REFERENCE, 0)[::-1]
    shape = (len(SIGMAS), len(SIZES))
    sigma = np.repeat(SIGMAS[:, None] + 1.0, len(SIZES), 1)
    ap = formula_ap(sigma, SIZES[None, ::-1])
    draws = np.clip(ap[None] + np.linspace(-3, 3, 21)[:, None, None], 0, 100)
    cells = Cells(SIGMAS, mtf, np.ones(shape, np.int64), sigma, np.broadcast_to(mtf, shape).copy(), ap, draws, 0)
    return Performance(Surface(cells), REFERENCE, 0, float(SIZES[-1]))


@made_once
def darker_performance(bonus_percent: float) -> Performance:
    """`performance` beside one of frames at a mean level of 0.25 that are so many points better."""
    bright = performance()
    cells = bright.surface.cells
    ap = np.clip(cells.ap_percent + bonus_percent, 0.0, 100.0)
    draws = np.clip(cells.draws + bonus_percent, 0.0, 100.0)
    dark = Performance(Surface(replace(cells, ap_percent=ap, draws=draws)), REFERENCE, 0, float(SIZES[-1]), 0.25)
    return Performance(bright.surface, REFERENCE, 0, float(SIZES[-1]), 0.5, [dark])


@made_once
def performance_of_three_levels() -> Performance:
    """`performance` beside ones of darker frames, at 0.3 and 0.18, that were measured up to 20 DN, as by default."""
    bright = performance()
    cells = bright.surface.cells
    least = slice(0, 5)  # rows up to 20 DN
    rows = {name: getattr(cells, name)[least] for name in ("sigma_bins_dn", "count", "sigma_dn", "mtf", "ap_percent")}
    some = replace(cells, draws=cells.draws[:, least], **rows)
    dark = [Performance(Surface(some), REFERENCE, 0, float(SIZES[-1]), level) for level in (0.3, 0.18)]
    return Performance(bright.surface, REFERENCE, 0, float(SIZES[-1]), 0.5, dark)


def seen_mtf(motion_px: float, direction_deg: float = 0.0) -> Estimate:
    """What an exact estimator gives for motion."""
    turn = np.deg2rad(direction_deg)
    lengths = motion_px * np.abs([np.cos(turn), np.sin(turn)])
    mtf = REFERENCE * np.abs(np.sinc(lengths[:, None] * CYCLES_PER_PX))
    return Estimate(mtf, np.clip(mtf - 0.01, 0, 1), np.clip(mtf + 0.01, 0, 1))


def scalar(value: float) -> Estimate:
    """A scalar estimate with a narrow interval."""
    return Estimate(np.float64(value), np.float64(0.95 * value), np.float64(1.05 * value))


class Scene:
    """A grey scene under a camera: brightness, noise and motion follow from the settings in closed form.

    Args:
        light: 1 gives a mean linear level of 0.25 at 8 ms and gain 1.
        speed_px_s: of the image.
        camera: the camera.
        size_px: side of the pictures.
    """

    def __init__(self, light: float = 1.0, speed_px_s: float = 0.0, camera: Camera | None = None, size_px: int = 64):
        self.light, self.speed_px_s, self.camera, self.size_px = light, speed_px_s, camera or Camera(), size_px

    def linear_level(self, state: CameraState) -> float:
        return 0.25 * self.light * state.total_exposure_s / 0.008

    def truth(self, state: CameraState) -> Outcome:
        level = self.linear_level(state)
        sigma = float(self.camera.sigma_dn_at(level, state.gain, state.exposure_s)) if level < 1 else 0.0
        return Outcome(sigma, self.speed_px_s * state.exposure_s, min(level, 1.0) ** (1 / self.camera.gamma))

    def observe(self, state: CameraState, silent: bool = False) -> Observation:
        here = self.truth(state)
        ramp = np.linspace(0.8, 1.2, self.size_px, dtype=np.float32)
        image = np.clip(here.mean_level * ramp[None] * np.ones((self.size_px, 1), np.float32), 0, 1)
        image = (np.rint(image * 255) / 255).astype(np.float32)
        saturated = float(np.mean(image >= 0.99))
        if silent or saturated > 0.5 or here.mean_level < 0.01:
            return Observation(image, float(image.mean()), saturated, reason="silent", truth=self.truth)
        return Observation(
            image, float(image.mean()), saturated, scalar(max(here.sigma_dn, 0.05)), seen_mtf(here.motion_px),
            truth=self.truth,
        )  # fmt: skip


def make_views(root: Path, viewpoints: int = 2, moments: int = 2) -> Path:
    """Rendered views below a folder: textured squares of 224 x 224 px, one box of each class."""
    folder = root / "evaluation"
    folder.mkdir(parents=True)
    for number in range(viewpoints):
        for moment in range(moments):
            name = f"evaluation-{number:04d}-{moment}"
            coarse = stream(1, "views", number).random((28, 28)) * 1.2
            radiance = np.kron(coarse, np.ones((8, 8))).astype(np.float32)
            write_image(folder / f"{name}.png", np.clip(0.4 * radiance, 0, 1) ** (1 / 2.2))
            np.savez(folder / f"{name}.radiance.npz", radiance=radiance.astype(np.float16))
            boxes = [
                {"label": label, "box": [20 + 60 * k, 40, 70 + 60 * k, 120], "visible_fraction": 1.0, "pixels": 900}
                for k, label in enumerate(("car", "person"))
            ]
            (folder / f"{name}.json").write_text(json.dumps({"boxes": boxes}), encoding="utf-8")
    return root
