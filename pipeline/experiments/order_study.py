"""The order of photon noise and blur, and the light they act in: what both change for estimators and a detector.

Frames are corrupted by photon noise and linear motion under ``camera.order`` paper or detector and ``camera.light``
encoded or linear, with the same draws. Compared are the noise estimate with the noise really present, the MTF estimate
with that of the uncorrupted frame times the kernel's (AMAE), and average precision.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.camera import mtf as mtf_of
from pipeline.camera.corruption import corrupt
from pipeline.camera.psf import create as create_psf
from pipeline.camera.settings import CameraSettings
from pipeline.camera.truth import LIGHTS, ORDERS
from pipeline.cluster_intervals import NO_INTERVAL, bias_corrected, resamples
from pipeline.datasets.frame import Frame
from pipeline.datasets.selection import scenes_of
from pipeline.detection.average_precision import MeanResult, class_mean
from pipeline.detection.base import Detections
from pipeline.detection.classes import ClassMap
from pipeline.detection.inference import detections_in
from pipeline.experiments.intervals import frame_interval, median
from pipeline.store import Schema
from pipeline.streams import stream

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

    from pipeline.condition import ConditionMonitor
    from pipeline.detection.base import Detector
    from pipeline.detection.settings import EvaluationSettings

EFFECT = "photon"
EFFECT_DRAWS = 2000
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


EFFECTS = Schema(
    "order study, effects",
    {
        "order": "string",
        "light": "string",
        # noise: from least to strongest, mean over all motion but none; motion: from none to longest, at least noise
        "cause": "string",
        "measure": "string",  # amae_percent or ap_percent
        "before": "float64",
        "after": "float64",
        "change": "float64",  # paired over frames (AMAE, mean) or over the bootstrap's scenes (AP)
        "low": "float64",
        "high": "float64",
    },
    {"change": "percent points"},
)


@dataclass(frozen=True)
class Corruption:
    """One condition of the study."""

    order: str
    light: str
    motion_px: float
    sigma_dn: float


def conditions(sizes_px: Sequence[float], target_sigmas_dn: Sequence[float]) -> list[Corruption]:
    """All conditions: every order, light, length and level."""
    return [
        Corruption(order, light, float(size), float(level))
        for light in LIGHTS
        for order in ORDERS
        for size in sizes_px
        for level in target_sigmas_dn
    ]


@lru_cache(maxsize=1)
def _opened(kind: str, options: str) -> tuple[ConditionMonitor, Detector]:
    from pipeline import detection
    from pipeline.condition import ConditionMonitor

    return ConditionMonitor(), detection.create(kind, **json.loads(options))


def measure(
    frame: Frame, *, chosen: Sequence[Corruption], camera: CameraSettings, kind: str, options: str, seed: int
) -> list[dict[str, Any]]:
    """One frame under every condition: estimates, truth and detections."""
    monitor, detector = _opened(kind, options)
    sharp = frame.image()
    system = np.asarray(monitor.frame(sharp).mtf.value)
    entries = []
    for item in chosen:
        at = replace(camera, order=item.order, light=item.light)  # type: ignore[arg-type]
        kernel = create_psf("linear_motion", item.motion_px) if item.motion_px > 1 else None
        made = corrupt(
            sharp, EFFECT, sigma_dn=item.sigma_dn, generator=stream(seed, "order study", frame.name), psf=kernel,
            sensor=at.sensor, poisson=at.poisson, order=at.order, light=at.light,
        )  # fmt: skip
        condition = monitor.frame(made.image)
        truth = system if kernel is None else system * mtf_of.sample(kernel)
        detected = detections_in(detector, made.image, kind)
        entries.append(
            {
                "clipped_sigma_dn": made.clipped_sigma_dn,
                "sigma_dn": float(condition.sigma_dn.value),
                "amae_percent": 100.0 * float(np.abs(np.asarray(condition.mtf.value) - truth).mean()),
                "boxes": detected.boxes,
                "score": detected.score,
                "label": detected.label,
            }
        )
    return entries


def precisions(
    frames: Sequence[Frame],
    found: Sequence[Sequence[Mapping[str, Any]]],
    chosen: Sequence[Corruption],
    words: ClassMap,
    criteria: EvaluationSettings,
    seed: int,
) -> list[MeanResult]:
    """Average precision under every condition.

    The draws resample the same scenes for every condition and class, so that differences are paired.

    Args:
        frames: looked at.
        found: what `measure` gave, one entry per frame.
        chosen: the conditions.
        words: what the dataset's labels mean to the detector.
        criteria: section ``detection.evaluation`` of the configuration.
        seed: of the bootstrap.
    """
    truths = [words.truth(frame.boxes, criteria.min_height_px, criteria.min_visible_fraction) for frame in frames]
    scenes = list(scenes_of(frames).values())
    scores = []
    for number in range(len(chosen)):
        parts = [each[number] for each in found]
        detected = [Detections.of(part["boxes"], part["score"], part["label"]) for part in parts]
        resample = partial(stream, seed, "order study")
        scores.append(class_mean(detected, truths, words.classes, criteria, resample, scenes))
    return scores


@dataclass(frozen=True, eq=False)
class Study:
    """Measurements under every condition, and the tables of them.

    Attributes:
        measured: what `measure` gave, one entry per frame.
        conditions: the conditions.
        scores: `precisions`.
        seed: of the bootstraps.
    """

    measured: Sequence[Sequence[Mapping[str, Any]]]
    conditions: Sequence[Corruption]
    scores: Sequence[MeanResult]
    seed: int

    def table(self) -> pd.DataFrame:
        """Conditions side by side: schema `STUDY`."""
        import pandas as pd

        rows = []
        for number, (item, score) in enumerate(zip(self.conditions, self.scores, strict=True)):
            parts = [each[number] for each in self.measured]
            low, high = bias_corrected(score.draws, score.ap_percent, score.clusters, bounds=(0.0, 100.0))
            row: dict[str, Any] = {
                "order": item.order,
                "light": item.light,
                "motion_px": item.motion_px,
                "target_sigma_dn": item.sigma_dn,
                "clipped_sigma_dn": float(np.mean([part["clipped_sigma_dn"] for part in parts])),
                "ap_percent": score.ap_percent,
                "ap_low_percent": low,
                "ap_high_percent": high,
                "frames": len(parts),
            }
            for name, value, lower, upper, silent in (
                ("sigma_dn", "estimated_sigma_dn", "sigma_low_dn", "sigma_high_dn", "noise_abstained"),
                ("amae_percent", "amae_percent", "amae_low_percent", "amae_high_percent", "blur_abstained"),
            ):
                values = np.array([part[name] for part in parts])
                row[value] = float(median(values))
                generator = stream(self.seed, "order study", name)
                row[lower], row[upper] = frame_interval(
                    values, np.arange(len(values)), median, generator, draws=200, least=0.0
                )
                row[silent] = int(np.count_nonzero(~np.isfinite(values)))
            rows.append(row)
        return STUDY.conform(pd.DataFrame(rows))

    def effects(self) -> pd.DataFrame:
        """What noise and motion change under each order and light, paired: schema `EFFECTS`.

        Before, after and change of the AMAE are means over the same frames and motions, those that have an estimate
        before and after.

        Returns:
            one row for each order, light, cause and measure; no rows for a cause with one level only.
        """
        import pandas as pd

        amae = np.array([[part["amae_percent"] for part in each] for each in self.measured])
        draws = np.stack([score.draws for score in self.scores])
        values = np.array([score.ap_percent for score in self.scores])
        rows = []
        for order, light in dict.fromkeys((item.order, item.light) for item in self.conditions):
            mine = {
                (item.motion_px, item.sigma_dn): n
                for n, item in enumerate(self.conditions)
                if (item.order, item.light) == (order, light)
            }
            motions, sigmas = (sorted({key[axis] for key in mine}) for axis in (0, 1))
            moving = [motion for motion in motions if motion > motions[0]] or motions
            for cause, before, after in (
                ("noise", [mine[m, sigmas[0]] for m in moving], [mine[m, sigmas[-1]] for m in moving]),
                ("motion", [mine[motions[0], sigmas[0]]], [mine[motions[-1], sigmas[0]]]),
            ):
                if before == after:
                    continue
                head = {"order": order, "light": light, "cause": cause}
                generator = stream(self.seed, "order study", "effects")
                rows.append(_effect(head, "amae_percent", *_paired(amae[:, before], amae[:, after], generator)))
                first, last = values[before].mean(), values[after].mean()
                resampled = draws[after].mean(axis=0) - draws[before].mean(axis=0)
                ends = bias_corrected(resampled, float(last - first), min(score.clusters for score in self.scores))
                rows.append(_effect(head, "ap_percent", first, last, ends))
        return EFFECTS.conform(pd.DataFrame(rows, columns=list(EFFECTS.columns)))


def _paired(
    before: NDArray[np.float64], after: NDArray[np.float64], generator: np.random.Generator
) -> tuple[float, float, tuple[float, float]]:
    """Means of both over the pairs that are known, and a 95 % interval of their difference with frames resampled.

    Args:
        before: (F, M) of F frames, NaN where there is no estimate.
        after: (F, M) likewise.
        generator: of the bootstrap.
    """
    known = np.isfinite(before) & np.isfinite(after)
    paired = known.any(axis=1)
    weight = known[paired] / known[paired].sum(axis=1, keepdims=True)
    first, last = ((np.where(known, part, 0.0)[paired] * weight).sum(axis=1) for part in (before, after))
    if not len(first):
        return np.nan, np.nan, NO_INTERVAL
    change = last - first
    resampled = change[resamples(len(change), EFFECT_DRAWS, generator)].mean(axis=1)
    return first.mean(), last.mean(), bias_corrected(resampled, float(change.mean()), len(change))


def _effect(
    head: Mapping[str, str], measure: str, before: float, after: float, ends: tuple[float, float]
) -> dict[str, Any]:
    low, high = ends
    change = float(after - before)
    return {
        **head, "measure": measure, "before": float(before), "after": float(after), "change": change, "low": low,
        "high": high,
    }  # fmt: skip
