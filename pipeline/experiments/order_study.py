"""The order of photon noise and blur, and the light they act in: what both change for estimators and a detector.

Frames are corrupted by photon noise and linear motion under ``camera.order`` paper or detector and ``camera.light``
encoded or linear, with the same draws. Compared are the noise estimate with the noise really present, the MTF estimate
with that of the uncorrupted frame times the kernel's (AMAE), and average precision.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.camera import mtf as mtf_of
from pipeline.camera.levels import corrupt
from pipeline.camera.psf import create as create_psf
from pipeline.camera.settings import CameraSettings
from pipeline.camera.truth import LIGHTS, ORDERS
from pipeline.datasets.frame import Frame
from pipeline.datasets.selection import scene_of
from pipeline.detection.average_precision import evaluate
from pipeline.detection.base import Detections
from pipeline.detection.classes import ClassMap
from pipeline.statistics import bootstrap_interval
from pipeline.store import Schema
from pipeline.streams import stream

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.condition import ConditionMonitor
    from pipeline.detection.base import Detector

EFFECT = "photon"
STUDY = Schema(
    "order study",
    {
        "order": "string",
        "light": "string",
        "motion_px": "float64",
        "target_sigma_dn": "float64",
        "clipped_sigma_dn": "float64",  # present in the frames, mean
        "estimated_sigma_dn": "float64",  # median of the frames' estimates
        "sigma_low_dn": "float64",
        "sigma_high_dn": "float64",
        "amae_percent": "float64",  # of the system MTF, median of the frames
        "amae_low_percent": "float64",
        "amae_high_percent": "float64",
        "ap_percent": "float64",  # mean over the classes
        "ap_low_percent": "float64",
        "ap_high_percent": "float64",
        "frames": "int64",
        "blur_abstained": "int64",
        "noise_abstained": "int64",
    },
    {"motion_px": "px", "target_sigma_dn": "DN", "amae_percent": "%", "ap_percent": "%"},
)


@dataclass(frozen=True)
class Corruption:
    """One condition of the study."""

    order: str
    light: str
    motion_px: float
    sigma_dn: float


def conditions(sizes_px: Sequence[float], levels_dn: Sequence[float]) -> list[Corruption]:
    """All conditions: every order, light, length and level."""
    return [
        Corruption(order, light, float(size), float(level))
        for light in LIGHTS
        for order in ORDERS
        for size in sizes_px
        for level in levels_dn
    ]


@lru_cache(maxsize=1)
def _opened(kind: str, options: str) -> tuple[ConditionMonitor, Detector]:
    from pipeline import detection
    from pipeline.condition import ConditionMonitor

    return ConditionMonitor(), detection.create(kind, **json.loads(options))


def look(
    frame: Frame, *, chosen: Sequence[Corruption], camera: CameraSettings, kind: str, options: str, seed: int
) -> list[dict[str, Any]]:
    """One frame under every condition: estimates, truth and detections."""
    monitor, detector = _opened(kind, options)
    sharp = frame.image()
    system = np.asarray(monitor.frame(sharp).mtf.value)
    found = []
    for one in chosen:
        at = replace(camera, order=one.order, light=one.light)  # type: ignore[arg-type]
        kernel = create_psf("linear_motion", one.motion_px) if one.motion_px > 1 else None
        made = corrupt(
            sharp, EFFECT, sigma_dn=one.sigma_dn, generator=stream(seed, "order study", frame.name), psf=kernel,
            sensor=at.sensor, poisson=at.poisson, order=at.order, light=at.light,
        )  # fmt: skip
        condition = monitor.frame(made.image)
        truth = system if kernel is None else system * mtf_of.sample(kernel)
        detected = detector.detect([made.image])[0]
        found.append(
            {
                "clipped_sigma_dn": made.sigma_clipped_dn,
                "sigma_dn": float(condition.sigma_dn.value),
                "amae_percent": 100.0 * float(np.abs(np.asarray(condition.mtf.value) - truth).mean()),
                "boxes": detected.boxes,
                "score": detected.score,
                "label": detected.label,
            }
        )
    return found


def table(
    frames: Sequence[Frame],
    found: Sequence[Sequence[Mapping[str, Any]]],
    chosen: Sequence[Corruption],
    words: ClassMap,
    judge: Any,
    seed: int,
) -> pd.DataFrame:
    """Conditions side by side: schema `STUDY`.

    Args:
        frames: looked at.
        found: what `look` gave, one entry per frame.
        chosen: the conditions.
        words: what the dataset's labels mean to the detector.
        judge: section ``detection.judge`` of the configuration.
        seed: of the bootstraps.
    """
    import pandas as pd

    truths = [words.truth(frame.boxes, judge.lowest_px, judge.least_visible) for frame in frames]
    scenes = [scene_of("sim", frame.name) for frame in frames]
    rows = []
    for number, one in enumerate(chosen):
        parts = [each[number] for each in found]
        detected = [Detections.of(part["boxes"], part["score"], part["label"]) for part in parts]
        results = evaluate(
            detected, truths, words.classes, judge.rule, judge.overlap, stream(seed, "order study"),
            judge.bootstrap_draws, scenes,
        )  # fmt: skip
        known = [result for result in results.values() if result.objects]
        draws = 100.0 * np.mean([result.draws for result in known], axis=0) if known else np.array([np.nan])
        finite = draws[np.isfinite(draws)]
        ends = np.percentile(finite, [2.5, 97.5]) if len(finite) else (np.nan, np.nan)
        row: dict[str, Any] = {
            "order": one.order,
            "light": one.light,
            "motion_px": one.motion_px,
            "target_sigma_dn": one.sigma_dn,
            "clipped_sigma_dn": float(np.mean([part["clipped_sigma_dn"] for part in parts])),
            "ap_percent": 100.0 * float(np.mean([r.average_precision for r in known])) if known else float("nan"),
            "ap_low_percent": float(ends[0]),
            "ap_high_percent": float(ends[1]),
            "frames": len(parts),
        }
        for name, value, low, high, silent in (
            ("sigma_dn", "estimated_sigma_dn", "sigma_low_dn", "sigma_high_dn", "noise_abstained"),
            ("amae_percent", "amae_percent", "amae_low_percent", "amae_high_percent", "blur_abstained"),
        ):
            values = np.array([part[name] for part in parts])
            good = values[np.isfinite(values)]
            row[value] = float(np.median(good)) if len(good) else float("nan")
            row[low], row[high] = bootstrap_interval(good, stream(seed, "order study", name), draws=200)
            row[silent] = int(len(values) - len(good))
        rows.append(row)
    return STUDY.conform(pd.DataFrame(rows))
