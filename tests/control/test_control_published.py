"""What the paper published of control: the built-in controller's response, and its two decisions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from control_makers import CAMERA, performance, scalar, seen_mtf

from pipeline import control
from pipeline.control.observation import Observation
from pipeline.control.policy import ControlledCamera
from pipeline.control.simulation.replay import BRIGHTNESS_LEVELS_PER_MS, replay
from pipeline.control.state import CameraState, Limits

PAPER = Path(__file__).resolve().parents[2] / "data/paper/controller_response.csv"


def published():
    table = pd.read_csv(PAPER)
    rows = table[(table["controller"] == "camera_default") & (table["quantity"] == "exposure_ms")]
    return rows["value"].to_numpy()


def test_published_response_of_the_built_in_controller_is_replayed():
    ours, paper = replay(BRIGHTNESS_LEVELS_PER_MS), published()
    assert len(ours) == len(paper) == 51
    difference = (ours - paper)[:48]  # the last samples of the published curve lie off its grid
    assert np.sqrt(np.mean(difference**2)) < 0.05
    assert np.abs(difference).max() < 0.05
    assert np.sqrt(np.mean((ours - paper) ** 2)) < 0.05


def test_published_cuts_are_a_quarter_and_happen_three_times():
    ours = replay(BRIGHTNESS_LEVELS_PER_MS)
    ratios = ours[1:] / ours[:-1]
    assert (ratios[ratios < 0.999] == pytest.approx(0.75, abs=1e-12)) and (ratios < 0.999).sum() == 3


@pytest.mark.parametrize(
    ("start", "motion_px", "sigma_dn", "target_px", "alpha", "exposure_ms", "iso"),
    [((4, 400), 3.0, 20.0, 12.0, 0.25, 16.0, 100.0), ((8, 100), 15.0, 1.0, 7.0, 15 / 7, 3.733, 214.3)],
)
def test_published_decisions(start, motion_px, sigma_dn, target_px, alpha, exposure_ms, iso):
    """Example 1: alpha 1/4; Example 2: alpha 15/7 (the plot shows ISO 224 where alpha gives 214)."""
    policy = control.create("iopc_target", camera=CAMERA, performance=performance(), target_px=target_px, target=None)
    state = CameraState.of(*start)
    seen = Observation(np.full((8, 8), 0.5, np.float32), 0.5, 0.0, scalar(sigma_dn), seen_mtf(motion_px))
    decision = policy.decide(seen, state)
    assert state.exposure_s / decision.state.exposure_s == pytest.approx(alpha, rel=0.02)
    assert decision.state.exposure_ms == pytest.approx(exposure_ms, rel=0.02)
    assert decision.state.iso == pytest.approx(iso, rel=0.02)


def test_published_decision_in_whole_pixels_is_exact():
    from pipeline.control.policies.iopc_target import alpha

    assert alpha(3, 12) == 0.25 and alpha(15, 7) == 15 / 7


def test_published_law_takes_time_before_gain():
    policy = control.create("prosilica", camera=ControlledCamera(Limits(exposure_max_s=0.5)))
    state = CameraState.of(1, 100)
    for _ in range(30):
        image = np.full((8, 8), min(1.0, 0.03 * state.exposure_ms), np.float32)
        state = policy.decide(Observation(image, float(image[0, 0]), 0.0), state).state
    assert state.gain == 1.0 and 0.03 * state.exposure_ms == pytest.approx(0.47, abs=0.03)


def test_published_law_holds_from_its_lower_to_its_upper_level():
    """Levels of 64, both ends of the band included."""
    policy = control.create("prosilica", camera=CAMERA)
    assert [policy.factor(level / 64) for level in (29.0, 30.5, 31.0, 31.9)] == [1.0] * 4
    assert policy.factor(32.0 / 64) == 0.75 and policy.factor(28.9 / 64) > 1.0
