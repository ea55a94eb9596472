"""Average precision of a set of views, mean over the classes, with bootstrap draws that pair policies.

Viewpoints are resampled, the same ones for every policy and condition drawn from equal streams, so that differences are
paired. A class that no view shows is left out of the mean. Intervals are wider for few viewpoints
(`pipeline.cluster_intervals`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pipeline.cluster_intervals import bias_corrected
from pipeline.control.simulation.views import View
from pipeline.detection.average_precision import class_mean
from pipeline.detection.base import Detections
from pipeline.detection.classes import CLASS_MAPS, ClassMap
from pipeline.streams import stream

if TYPE_CHECKING:
    from pipeline.detection.settings import EvaluationSettings


@dataclass(frozen=True, eq=False)
class Score:
    """Average precision of a set of views.

    Attributes:
        ap_percent: mean over the classes present; NaN without any object.
        low_percent, high_percent: bootstrap 95 % interval over viewpoints.
        objects: to be found, all classes.
        draws: (B,) percent.
        viewpoints: that show an object, of the class with the fewest.
    """

    ap_percent: float
    low_percent: float
    high_percent: float
    objects: int
    draws: NDArray[np.float64]
    viewpoints: int


def average_precision(
    detections: Sequence[Detections],
    seen: Sequence[View],
    criteria: EvaluationSettings,
    generator: np.random.Generator,
    words: ClassMap = CLASS_MAPS["sim"],
) -> Score:
    """Judge detections.

    Args:
        detections: one entry per view.
        seen: the views.
        criteria: the rules.
        generator: of the bootstrap; equal generators resample the same viewpoints.
        words: classes of the views' labels.
    """
    truths = [words.truth(view.boxes, criteria.min_height_px, criteria.min_visible_fraction) for view in seen]
    root = generator.integers(0, 2**63, dtype=np.uint64)
    resample, viewpoints = partial(stream, int(root), "viewpoints"), [view.viewpoint for view in seen]
    mean = class_mean(detections, truths, words.classes, criteria, resample, viewpoints)
    low, high = bias_corrected(mean.draws, mean.ap_percent, mean.clusters, bounds=(0.0, 100.0))
    return Score(mean.ap_percent, low, high, mean.objects, mean.draws, mean.clusters)
