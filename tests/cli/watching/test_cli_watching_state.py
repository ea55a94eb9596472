"""The state of the last frames that ``camera-monitor watch`` puts beside each."""

from __future__ import annotations

import numpy as np

from pipeline.cli.watching.state import RollingState

SHARP = dict.fromkeys(("mtf", "mtf_low", "mtf_high"), np.full((2, 8), 0.9)) | {"blur": "sharp", "blur_direction": ""}
PARTS = {"white_sigma_dn": 1.0, "noise_correlation": 0.5}


def test_the_rolling_state_forgets():
    state = RollingState(2)
    noise = {"sigma_dn": 2.0, "sigma_high_dn": 3.0, "sigma_at_most_dn": 3.0} | PARTS
    row = {**noise, "median_dn": 90.0, "ap_percent": np.nan, "flags": "dark", **SHARP}
    assert state.add(row)["flags"] == {"dark": 1.0}
    assert state.add({**row, "flags": ""})["flags"] == {"dark": 0.5}
    result = state.add({**row, "flags": "", "sigma_dn": 12.0, "white_sigma_dn": 11.0, "noise_correlation": np.nan})
    assert (result["white_sigma_dn"], result["noise_correlation"]) == (6.0, 0.5)
    assert result["flags"] == {} and result["frames"] == 2 and result["sigma_dn"] == 7.0
    assert result["words"] == "sharp; noise moderate" and np.isnan(result["ap_percent"])


def test_the_rolling_state_does_not_take_the_frames_that_have_an_estimate_for_those_that_a_codec_hides():
    state, clear = RollingState(3), {"median_dn": 90.0, "flags": "", **SHARP, **PARTS}
    coded = {**clear, "sigma_dn": np.nan, "sigma_high_dn": np.nan, "sigma_at_most_dn": 14.0, "ap_percent": np.nan}
    noisy = {**clear, "sigma_dn": 18.0, "sigma_high_dn": 20.0, "sigma_at_most_dn": 20.0, "ap_percent": 25.0}
    for row in (coded, coded, noisy):
        result = state.add(row)
    assert np.isnan([result["sigma_dn"], result["ap_percent"]]).all() and result["sigma_at_most_dn"] == 14
    assert np.isnan([result["white_sigma_dn"], result["noise_correlation"]]).all()
    result = state.add(noisy)
    assert (result["sigma_dn"], result["ap_percent"], result["sigma_at_most_dn"]) == (18, 25, 20)
    boundless, state = {**coded, "sigma_at_most_dn": np.nan}, RollingState(3)
    for row in (coded, boundless, boundless):
        result = state.add(row)
    assert np.isnan(result["sigma_at_most_dn"])
