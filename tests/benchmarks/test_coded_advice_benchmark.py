"""The benchmark of advice on coded frames: what it judges and counts is what it says, and its record shows no loss."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from benchmarks import coded_advice, common
from pipeline.condition.estimate import Condition, NoiseState
from pipeline.condition.summary import summarise
from pipeline.control.state import CameraState


def test_gains_are_judged_with_the_noise_of_the_frame():
    """A surface that falls with noise alone: twice the light at the same time gains more where there is more noise."""

    def ap_percent(sigma_dn, motion_px, level):
        return 90.0 - sigma_dn

    surface, state = SimpleNamespace(ap_percent=ap_percent, level=0.5), CameraState(0.008, 4.0)
    longer = SimpleNamespace(best_exposure_ms=16.0, best_iso=200.0, motion_px=1.0)
    gains = [coded_advice.gained(longer, state, true_dn, 0.4, surface) for true_dn in (0.0, 2.0, 5.0)]
    assert 0 <= gains[0] < 0.01 < gains[1] < gains[2]
    same = SimpleNamespace(best_exposure_ms=8.0, best_iso=400.0, motion_px=1.0)
    assert coded_advice.gained(same, state, 5.0, 0.4, surface) == pytest.approx(0.0)


def test_the_bound_stands_for_an_estimate():
    nothing = summarise(np.full(3, np.nan))
    state = NoiseState((), SimpleNamespace(), (1, 3), nothing, np.zeros((1, 3)), 0.0, at_most_dn=4.5)
    made = coded_advice.as_if_estimated(Condition(SimpleNamespace(), state))
    assert float(made.noise.summary.value) == float(made.noise.summary.high) == 4.5


def test_only_other_settings_count_as_moved():
    table = pd.DataFrame({"moved": [True, True, False], "gain_percent": [2.0, -1.0, 0.0]})
    summary = coded_advice.summarised(table)
    assert summary == {
        "count": 3,
        "moved": 2,
        "unjudged": 0,
        "lost": 1,
        "least_gain_percent": -1.0,
        "mean_gain_percent": 0.5,
    }
    assert coded_advice.summarised(table[2:])["least_gain_percent"] == 0.0


def test_advice_whose_gain_is_unknown_is_counted_as_unjudged():
    table = pd.DataFrame({"moved": [True, True, False], "gain_percent": [2.0, np.nan, 0.0]})
    summary = coded_advice.summarised(table)
    assert (summary["count"], summary["moved"], summary["unjudged"], summary["lost"]) == (3, 1, 1, 0)
    assert summary["mean_gain_percent"] == 2.0


def test_the_record_has_no_loss_within_the_bound():
    record = json.loads((common.RESULTS / "coded_advice.json").read_text(encoding="utf-8"))
    within, at = record[coded_advice.WITHIN], record[coded_advice.AT]
    assert sum(cell["moved"] for cell in within.values()) > 100
    assert sum(cell["lost"] for cell in within.values()) == 0 < sum(cell["lost"] for cell in at.values())
    assert sum(cell["unjudged"] for cell in within.values()) < 30
