"""Average precision of views: what its interval rests on."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from control_makers import judged_with

from pipeline.cluster_intervals import bias_corrected
from pipeline.control.simulation.scoring import average_precision
from pipeline.control.simulation.views import View
from pipeline.datasets.frame import Box
from pipeline.detection.base import Detections
from pipeline.streams import stream

BOX = (10.0, 10.0, 60.0, 60.0)


def judged(moments):
    """Sixteen viewpoints with a car each, which is found from every other one, at each of so many moments."""
    seen, detections = [], []
    for number in range(16):
        for moment in range(moments):
            name = f"evaluation-{number:04d}"
            seen.append(View(f"{name}-{moment}", name, moment, Path(), (Box("car", *BOX),)))
            boxes = np.array([BOX] if number % 2 else np.zeros((0, 4)))
            detections.append(Detections.of(boxes, np.ones(len(boxes)), ["car"] * len(boxes)))
    return average_precision(detections, seen, judged_with(), stream(1, "score"))


def test_moments_of_a_viewpoint_do_not_narrow_the_interval():
    once, often = judged(1), judged(4)
    assert (often.ap_percent, often.viewpoints, often.objects) == (50.0, 16, 64)
    ends = (once.low_percent, once.high_percent)
    assert (often.low_percent, often.high_percent) == pytest.approx(ends)
    assert ends == pytest.approx(bias_corrected(once.draws, 50.0, 16)) and 0.0 < ends[0] < 50.0 < ends[1] < 100.0
