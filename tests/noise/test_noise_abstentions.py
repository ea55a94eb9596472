"""Rules by which the default noise estimator abstains: each one alone, and which reason stands."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pipeline.noise.abstentions import (
    FILTERED,
    FILTERED_DN,
    FORESHORTENED,
    LARGEST_DN,
    LEAST_GRAIN_CORRELATION,
    UNDETECTED_LOW_DN,
    WEAK_DN,
    Evidence,
    reasons,
)
from pipeline.noise.base import ALTERNATING, BEYOND, COMPRESSED, FLAT, STREAKED, UNCERTAIN
from pipeline.noise.traces.codec import Traces

NONE = np.zeros(1, bool)
CLEAR = Traces(NONE, NONE, NONE, NONE)


def evidence(traces: dict[str, bool] | None = None, **changes: Any) -> Evidence:
    """Of one patch with 5 DN of noise that is answered, but for what is changed."""
    level = {"sigma_dn": 5.0, "low_dn": 4.0, "high_dn": 6.0, "weight": 1.0, "reaches_too_far": False}
    level |= {"correlation": 0.5, "anisotropy": 0.0, "flat_correlation": 0.0}
    level |= {"streaks": False, "alternates": False}
    of_codec = replace(CLEAR, **{name: np.array([value]) for name, value in (traces or {}).items()})
    return Evidence(traces=of_codec, **{name: np.array([value]) for name, value in (level | changes).items()})


def reason(traces: dict[str, bool] | None = None, known: str = "", **changes: Any) -> str:
    return str(reasons(evidence(traces, **changes), np.array([known], dtype=object))[0])


def test_an_answer_stands_and_so_does_what_was_known_before():
    assert reason() == ""
    assert reason(known=FLAT, reaches_too_far=True, alternates=True, streaks=True) == FLAT


def test_a_wide_interval_is_no_answer_unless_noise_is_weak():
    assert reason(reaches_too_far=True) == UNCERTAIN
    assert reason({"strong": True}, reaches_too_far=True) == COMPRESSED
    weak = {"sigma_dn": 1.0, "low_dn": 0.5, "high_dn": 0.99 * WEAK_DN, "reaches_too_far": True}
    assert reason(**weak) == ""
    assert reason({"quantised": True, "detail": True}, **weak) == COMPRESSED  # it may flicker
    assert reason({"quantised": True}, **weak) == ""


@pytest.mark.parametrize("trace", ["quantised", "suspected"])
def test_zero_is_no_answer_where_a_codec_may_have_removed_noise(trace):
    zero = {"sigma_dn": 0.1, "low_dn": 0.0, "high_dn": 1.0}
    assert reason({trace: True, "detail": True}, **zero) == COMPRESSED
    assert reason({trace: True}, **zero) == reason(**zero) == ""  # no detail is left to flicker, or there is no codec
    assert reason({trace: True, "detail": True}, **(zero | {"low_dn": UNDETECTED_LOW_DN})) == ""


def test_grain_that_is_finer_along_columns_belongs_to_the_ground():
    grain = {"correlation": LEAST_GRAIN_CORRELATION + 0.01, "anisotropy": FORESHORTENED + 0.01}
    assert reason(**grain) == UNCERTAIN
    other_way = {"anisotropy": -2 * FORESHORTENED}  # finer along rows, as no ground plane's is
    for changed in ({"correlation": 0.2}, {"anisotropy": 0.1}, other_way, {"weight": 0.4}, {"high_dn": 2.0}):
        assert reason(**(grain | changed)) == "", changed


def test_what_a_filter_leaves_at_edges_is_no_white_noise():
    left = {"weight": 0.2, "flat_correlation": FILTERED + 0.01}
    assert reason(**left) == UNCERTAIN
    assert reason(**left, sigma_dn=FILTERED_DN) == reason(**(left | {"weight": 0.5})) == ""
    assert reason(weight=0.2, flat_correlation=FILTERED) == ""


def test_more_noise_than_the_networks_know_is_no_answer():
    assert reason(low_dn=LARGEST_DN + 1, sigma_dn=80.0, high_dn=90.0) == BEYOND


def test_streaks_and_alternation_have_names_of_their_own():
    assert reason(streaks=True) == reason(streaks=True, reaches_too_far=True) == STREAKED
    assert reason({"strong": True}, streaks=True) == ""  # a codec streaks too
    assert reason(alternates=True) == reason(alternates=True, streaks=True, reaches_too_far=True) == ALTERNATING
