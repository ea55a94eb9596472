"""The benchmark of noise budgets: its cases differ from the camera assumed in what they name, and it counts rightly."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from benchmarks import common, noise_budget
from pipeline.camera.exposure import Camera
from pipeline.camera.sensor import named
from pipeline.condition.noise_budget import Explanation, FrameBudget

CAMERA = Camera(named("automotive_3um"), radiance_at_full_scale=1.0, reference_exposure_s=0.008)
GREY = np.full((128, 128), 0.5, np.float32)


def spread_dn(case: str) -> tuple[float, float]:
    image = 255.0 * noise_budget.taken(GREY, CAMERA, 0.008, 8.0, case, "test").astype(np.float64)
    return float(image.mean()), float(image.std())


def test_cases_are_equally_bright_and_noisy_as_they_are_called():
    """At one grey level variances of sources add: photon noise doubles with the gain, 3 DN are added in squares."""
    mean, assumed = spread_dn("as assumed")
    for case in noise_budget.CASES:
        assert spread_dn(case)[0] == pytest.approx(mean, abs=0.5), case
    assert spread_dn("gain x 2")[1] / assumed == pytest.approx(2.0**0.5, rel=0.06)
    assert spread_dn("gain x 0.5")[1] / assumed == pytest.approx(0.5**0.5, rel=0.06)
    assert spread_dn("3 DN added")[1] == pytest.approx(np.hypot(assumed, 3.0), rel=0.05)
    pattern = noise_budget.PATTERN * mean / CAMERA.gamma
    assert spread_dn("pattern 4 %")[1] == pytest.approx(np.hypot(assumed, pattern), rel=0.05)
    louder = noise_budget.louder(CAMERA)
    readout = [camera.sensor.at_gain(8.0).readout_sigma_e(300.0) for camera in (louder, CAMERA)]
    assert readout[0] == pytest.approx(2 * readout[1])


def test_departures_and_causes_are_counted():
    agreed = FrameBudget(3.0, 3.0, 1.0, 0.9, 1.1, {"photon": 1.0}, 9, "agrees")
    gain, added = Explanation("gain", 2.0, 0.02), Explanation("added", 2.0, 0.01)
    more = replace(agreed, ratio=1.5, verdict="more", explanations=(added, gain))
    unknown = replace(agreed, ratio=float("nan"), verdict="unknown")
    row = noise_budget.summarised([agreed, more, replace(more, explanations=(added,)), unknown], "gain")
    assert (row["frames"], row["agrees"], row["more"], row["less"], row["unknown"]) == (4, 1, 2, 0, 1)
    assert row["mean_ratio"] == pytest.approx(4.0 / 3.0, abs=1e-3)
    assert row["cause_stated"] == 0.5 and row["cause_first"] == 0.0
    assert "cause_stated" not in noise_budget.summarised([agreed], "gain")


def test_the_committed_record_has_no_departure_from_a_camera_as_assumed():
    record = json.loads((common.RESULTS / "noise_budget.json").read_text(encoding="utf-8"))
    rights = [cases["as assumed"] for cases in record["results"].values()] + [record["raw"]["as recorded"]]
    assert all(row["more"] + row["less"] == 0 and row["agrees"] > row["frames"] / 4 for row in rights)
    doubled = [cases["gain x 2"] for cases in record["results"].values()]
    assert all(row["more"] >= 0.9 * row["frames"] and row["cause_stated"] >= 0.7 for row in doubled)
