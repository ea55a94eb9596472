"""The frame in which a policy loses most against another."""

from __future__ import annotations

import pandas as pd
import pytest

from pipeline.control.simulation.largest_loss import largest_loss
from pipeline.control.state import CameraState


def table(ours, light=(1.0,) * 6, speed=(100.0,) * 6, action="move"):
    """A policy with some average precision per step beside one of 80 % throughout, in two folds, the second 10 less."""
    rows = [
        {
            "policy": name, "fold": fold, "step": step, "light": light[step], "speed_px_s": speed[step],
            "exposure_ms": 4.0 if name == "ours" else 8.0, "iso": 100.0 * (1 + fold), "action": action,
            "ap_percent": ap - (10.0 if name == "ours" and fold == 1 else 0.0),
        }
        for name, values in (("ours", ours), ("other", (80.0,) * 6))
        for fold in (0, 1) for step, ap in enumerate(values)
    ]  # fmt: skip
    return pd.DataFrame(rows)


def test_largest_loss_names_the_frame_the_settings_and_the_change_before():
    falls = (1.0, 1.0, 1.0, 0.1, 0.1, 0.1)
    loss = largest_loss(table((90, 90, 90, 60, 95, 95), light=falls), "ours", "other")
    assert loss.step == 3 and loss.loss_percent == pytest.approx(25.0)
    assert (loss.change, loss.frames_after) == ("fall of light", 0)
    assert loss.state == CameraState.of(4.0, 200.0) and loss.other_state == CameraState.of(8.0, 200.0)
    later = largest_loss(table((90, 90, 90, 90, 90, 60), light=falls), "ours", "other")
    assert (later.step, later.change, later.frames_after) == (5, "fall of light", 2)


@pytest.mark.parametrize(
    ("changes", "change", "after"),
    [
        ({"light": (0.1, 0.1, 0.1, 0.1, 0.9, 0.9)}, "rise of light", 1),
        ({"speed": (100.0,) * 4 + (900.0,) * 2}, "rise of speed", 1),
        ({"action": "abstained"}, "abstention", 0),
        ({}, "", 0),
    ],
)
def test_largest_loss_names_what_changed(changes, change, after):
    loss = largest_loss(table((95, 95, 95, 95, 95, 60), **changes), "ours", "other")
    assert (loss.step, loss.change, loss.frames_after) == (5, change, after)


def test_largest_loss_near_the_start_and_none():
    loss = largest_loss(table((95, 60, 95, 95, 95, 95)), "ours", "other")
    assert (loss.step, loss.change, loss.frames_after) == (1, "start", 1)
    assert largest_loss(table((95,) * 6), "ours", "other") is None
    assert largest_loss(table((95, float("nan"), 95, 95, 95, 95)), "ours", "other") is None
