"""Smoothing before and dividing after: exact where the estimator is, silent where the quotient would be noise."""

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.blur.base import BlurEstimate, Estimator
from pipeline.blur.denoise import EPSILON, Denoised, divided, expected_amae
from pipeline.camera import mtf
from pipeline.camera.psf.defocus import create as defocus
from pipeline.camera.psf.linear_motion import create as motion
from pipeline.errors import InputError
from pipeline.streams import stream

PAPER = Path(__file__).resolve().parents[2] / "data/paper"


class Oracle(Estimator):
    """Answers a given MTF, times that of the smoothing where the patch was smoothed."""

    def __init__(self, truth, smoothing):
        self.truth, self.smoothing = truth, smoothing

    def measure(self, patches, reason):
        rough = np.abs(np.diff(patches, axis=-1)).mean(axis=(1, 2, 3))
        factor = np.where((rough < 0.05)[:, None, None], self.smoothing, 1.0)
        value = self.truth * factor
        value[reason != ""] = np.nan
        return BlurEstimate(value, reason != "", reason, low=0.9 * value, high=np.minimum(1.1 * value, 1.0))


@pytest.fixture
def patches():
    return stream(1, "rough").random((3, 1, 192, 192)).astype(np.float32)


def make(truth, filter_px=7.0, sigma=20.0):
    smoothing = mtf.sample(defocus(filter_px))
    return Denoised(Oracle(truth, smoothing), lambda batch: np.full(len(batch), sigma), filter_px=filter_px)


def test_the_known_blur_is_divided_out(patches):
    truth = mtf.sample(motion(7.0, 30.0))
    estimate = make(truth).estimate(patches)
    usable = truth * mtf.sample(defocus(7.0)) > EPSILON
    assert usable.sum() >= 8
    assert np.allclose(estimate.mtf[:, usable], truth[usable], atol=1e-6)
    assert np.isnan(estimate.mtf[:, ~usable]).all()
    assert np.allclose(estimate.low[:, usable], 0.9 * truth[usable], atol=1e-6)
    assert np.isnan(estimate.high[:, ~usable]).all()
    assert not estimate.abstained.any() and estimate.kernel is None


def test_patches_without_noise_are_left_alone(patches):
    truth = mtf.sample(motion(7.0, 30.0))
    estimate = make(truth, sigma=9.9).estimate(patches)
    assert np.allclose(estimate.mtf, truth)
    assert np.array_equal(
        make(truth, sigma=10.0).estimate(patches).mtf, make(truth).estimate(patches).mtf, equal_nan=True
    )
    mixed = Denoised(Oracle(truth, mtf.sample(defocus(7.0))), lambda batch: np.array([0.0, 20.0, np.nan]))
    answer = mixed.estimate(patches).mtf
    assert np.allclose(answer[[0, 2]], truth) and np.isnan(answer[1]).any()


def test_nothing_left_is_an_abstention(patches):
    estimate = make(np.full((2, 8), 0.04)).estimate(patches)
    assert estimate.abstained.all() and (estimate.reason == "noise").all()
    flat = make(np.ones((2, 8))).estimate(np.full((1, 1, 192, 192), 0.5, np.float32))
    assert flat.reason.tolist() == ["flat"]


@given(st.lists(st.floats(0, 1), min_size=16, max_size=16), st.lists(st.floats(0, 1), min_size=16, max_size=16))
def test_a_quotient_exists_exactly_where_its_conditions_hold(one, two):
    combined, known = np.array(one).reshape(2, 8), np.array(two).reshape(2, 8)
    result = divided(combined, known)
    allowed = (combined <= known) & (known > EPSILON) & (combined > EPSILON)
    assert np.array_equal(~np.isnan(result), allowed)
    assert np.allclose(result[allowed] * known[allowed], combined[allowed])
    assert (result[allowed] <= 1).all() and (result[allowed] > EPSILON).all()


def test_the_expected_error_is_the_papers():
    """Its supplement's column follows from its Table I: linear motion and defocus of the CNN on Udacity."""
    with (PAPER / "blur_amae.csv").open() as file:
        table = {(row["blur"], row["size_px"]): float(row["amae_percent"]) for row in csv.DictReader(file)
                 if row["dataset"] == "udacity" and row["estimator"] == "cnn"}  # fmt: skip
    with (PAPER / "improved_blur.csv").open() as file:
        for row in csv.DictReader(file):
            result = expected_amae(table["linear_motion", row["d1_px"]], table["defocus", row["d2_px"]])
            assert float(result) == pytest.approx(float(row["expected_amae_percent"]), abs=0.06)


def test_calibration_reaches_the_inner_estimator(patches):
    truth = mtf.sample(motion(3.0, 30.0))
    plain = make(truth, sigma=0.0)
    relative = plain.calibrated(patches)
    assert np.allclose(relative.estimate(patches).mtf, 1.0) and np.allclose(plain.estimate(patches).mtf, truth)


def test_a_filter_that_smooths_nothing_is_refused():
    with pytest.raises(InputError, match="filter_px"):
        make(np.ones((2, 8)), filter_px=1.0)


def test_what_a_calibration_takes_is_the_same_for_noisy_and_quiet_batches(patches):
    """Of smoothed patches the outputs of single networks are of both blurs, so no batch passes them on."""

    class Ensemble(Oracle):
        relative_to = "camera"

        def measure(self, patches, reason):
            answer = super().measure(patches, reason)
            kernels, members = np.ones((len(patches), 3, 3)), np.stack([answer.mtf, answer.mtf], axis=1)
            return replace(answer, kernel=kernels, members=members, half=np.full_like(answer.mtf, 2))

    inner = Ensemble(np.ones((2, 8)), np.ones((2, 8)))
    for sigma in (0.0, 20.0):
        estimator = Denoised(inner, lambda batch, sigma=sigma: np.full(len(batch), sigma))
        answer = estimator.estimate(patches)
        assert all(getattr(answer, name) is None for name in ("kernel", "members", "hidden", "half"))
        assert estimator.relative_to == "camera"
