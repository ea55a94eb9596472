"""The MTF: equal to the paper's transform, to closed forms, and its error measure."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pipeline.camera import mtf
from pipeline.camera.psf import create, gaussian
from pipeline.errors import InputError

KERNELS = arrays(np.float64, st.tuples(st.integers(1, 31), st.integers(1, 31)), elements=st.floats(0.001, 1))


@given(KERNELS)
def test_sample_equals_the_transform_of_111_points(weights: np.ndarray) -> None:
    canvas = np.zeros((111, 111))
    canvas[: weights.shape[0], : weights.shape[1]] = weights / weights.sum()
    spectrum = np.abs(np.fft.fft2(canvas))
    expected = np.stack([spectrum[0, mtf.BINS], spectrum[mtf.BINS, 0]])
    assert np.allclose(mtf.sample(weights), expected, atol=1e-12)


@given(KERNELS, st.floats(0.1, 1000))
def test_contrast_is_between_zero_and_one_and_scale_free(weights: np.ndarray, scale: float) -> None:
    sampled = mtf.sample(weights)
    assert sampled.min() >= 0 and sampled.max() <= 1 + 1e-12
    assert np.allclose(mtf.sample(weights * scale), sampled)
    assert np.allclose(mtf.curve(weights, [0.0]), 1)


@given(KERNELS, st.integers(0, 9), st.integers(0, 9))
def test_a_shift_changes_nothing_and_a_turn_swaps_the_directions(weights: np.ndarray, rows: int, columns: int) -> None:
    sampled = mtf.sample(weights)
    assert np.allclose(mtf.sample(np.pad(weights, ((rows, 0), (0, columns)))), sampled)
    assert np.allclose(mtf.sample(np.rot90(weights)), sampled[::-1])


def test_kernels_stack_and_may_exceed_111_px() -> None:
    stack = np.stack([np.eye(121), np.ones((121, 121))])
    assert mtf.sample(stack).shape == (2, 2, 8)
    assert np.allclose(mtf.sample(stack)[1], mtf.sample(np.ones((121, 121))))
    x = np.pi * mtf.FREQUENCIES / 2
    assert np.allclose(mtf.sample(np.ones((121, 121)))[0], np.abs(np.sin(121 * x) / (121 * np.sin(x))))


def test_frequencies_are_those_of_the_papers_axis() -> None:
    assert np.abs(mtf.FREQUENCIES - [0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6]).max() < 0.016


def test_horizontal_motion_lowers_the_horizontal_row_only() -> None:
    horizontal, vertical = mtf.sample(create("linear_motion", 7))
    x = np.pi * mtf.FREQUENCIES / 2
    assert np.allclose(horizontal, np.abs(np.sin(7 * x) / (7 * np.sin(x))), atol=1e-6)
    assert np.allclose(vertical, 1)


def test_closed_forms() -> None:
    assert mtf.disc(0, [0.3]) == pytest.approx([1]) and mtf.line(0, [0.3]) == pytest.approx([1])
    # First zeros: 1.2197 / d for the disc, 1 / L for the line, in cycles per pixel.
    assert mtf.disc(5, [2 * 1.21967 / 5]) == pytest.approx([0], abs=1e-5)
    assert mtf.line(5, [2 / 5]) == pytest.approx([0], abs=1e-12)
    assert mtf.gaussian(2, [0.0, 0.1]) == pytest.approx([1, np.exp(-2 * (np.pi * 2 * 0.05) ** 2)])


def test_mtf50_of_a_gaussian() -> None:
    sigma_px = 3.0
    psf = gaussian.gaussian(sigma_px)
    expected = 2 * np.sqrt(np.log(2) / 2) / (np.pi * np.hypot(sigma_px, np.sqrt(1 / 12)))
    assert mtf.mtf50(psf) == pytest.approx([expected, expected], rel=2e-3)


def test_mtf50_is_infinite_without_blur_and_takes_the_first_crossing() -> None:
    result = mtf.mtf50(create("linear_motion", 15))
    assert mtf.curve(create("linear_motion", 15), result[:1])[0, 0] == pytest.approx(0.5, abs=1e-8)
    assert result[0] < 0.09 and np.isinf(result[1])


@given(arrays(np.float64, (3, 2, 8), elements=st.floats(0, 1)), arrays(np.float64, (2, 8), elements=st.floats(0, 1)))
def test_amae_is_a_mean_absolute_difference(estimate: np.ndarray, truth: np.ndarray) -> None:
    expected = [100 * (np.abs(e[0] - truth[0]).mean() + np.abs(e[1] - truth[1]).mean()) / 2 for e in estimate]
    assert np.allclose(mtf.amae(estimate, truth), expected)
    assert np.allclose(mtf.amae(estimate, truth, skip_missing=True), expected)
    assert np.allclose(mtf.amae(truth, truth), 0)


def test_amae_of_missing_frequencies() -> None:
    truth = np.zeros((2, 8))
    estimate = np.full((2, 8), 0.2)
    estimate[0, 2:] = np.nan
    estimate[0, :2] = 0.4
    assert np.isnan(mtf.amae(estimate, truth))
    assert mtf.amae(estimate, truth, skip_missing=True) == pytest.approx(30)
    estimate[0] = np.nan
    assert mtf.amae(estimate, truth, skip_missing=True) == pytest.approx(20)
    assert np.isnan(mtf.amae(np.full((2, 8), np.nan), truth, skip_missing=True))


@pytest.mark.parametrize(
    "call",
    [
        lambda: mtf.sample(np.ones(5)),
        lambda: mtf.sample(np.zeros((3, 3))),
        lambda: mtf.sample(np.full((3, 3), np.nan)),
        lambda: mtf.mtf50(np.ones((2, 5, 5))),
        lambda: mtf.mtf50(1.0),
        lambda: mtf.mtf50(np.ones((0, 3))),
        lambda: mtf.amae(np.ones((2, 8)), np.ones((2, 5))),
        lambda: mtf.amae(np.ones(8), np.ones(8)),
    ],
)
def test_bad_input_is_refused(call) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(InputError):
        call()
