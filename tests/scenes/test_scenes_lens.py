"""Lens and pixels: the filter has exactly the transfer function it states."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.scenes import lens


@given(samples=st.integers(1, 8), sigma=st.floats(0.0, 2.0))
def test_taps_have_unit_sum_are_symmetric_and_not_negative(samples, sigma):
    weights, positions = lens.taps(samples, sigma)
    assert weights.sum() == pytest.approx(1.0, abs=1e-12)
    assert np.allclose(weights, weights[::-1]) and (weights >= 0).all()
    assert np.allclose(positions, -positions[::-1])
    assert len(weights) % 2 == samples % 2


@pytest.mark.parametrize("samples", [2, 3, 4, 8])
def test_transfer_is_the_lens_times_the_comb_of_samples(samples):
    f = np.linspace(0.01, 0.5, 25)
    comb = np.sin(np.pi * f) / (samples * np.sin(np.pi * f / samples))
    gauss = np.exp(-2 * (np.pi * 0.55 * f) ** 2)
    assert np.allclose(lens.true_mtf(f, samples, 0.55), np.stack([comb * gauss] * 2), atol=1e-4)
    assert np.allclose(lens.true_mtf(f, samples, 0.0)[0], np.abs(comb), atol=1e-12)


def test_direction_multiplies_the_axes():
    f = np.array([0.1, 0.3])
    both = lens.transfer(f * np.cos(0.5), 3) * lens.transfer(f * np.sin(0.5), 3)
    assert np.allclose(lens.true_mtf(f, 3, angle_deg=np.rad2deg(0.5)), both)


@pytest.mark.parametrize("samples", [1, 2, 3, 4])
@pytest.mark.parametrize("sigma", [0.0, 0.55])
def test_a_sinusoid_keeps_its_phase_and_loses_what_the_transfer_says(samples, sigma):
    width, height, f = 60, 7, 0.2
    margin = lens.margin_px(samples, sigma)
    x = (np.arange((width + 2 * margin) * samples) + 0.5) / samples - margin
    rows = (height + 2 * margin) * samples
    dense = np.tile(np.cos(2 * np.pi * f * x).astype(np.float32), (rows, 1))
    image = lens.expose(dense, samples, sigma)
    assert image.shape == (height, width)
    expected = lens.transfer(f, samples, sigma) * np.cos(2 * np.pi * f * (np.arange(width) + 0.5))
    assert np.allclose(image, expected, atol=2e-6)
    assert np.allclose(lens.expose(dense.T.copy(), samples, sigma).T, image, atol=1e-6)


def test_a_constant_stays_what_it_is_up_to_the_border():
    margin = lens.margin_px(3, 0.55)
    dense = np.full((3 * (5 + 2 * margin), 3 * (6 + 2 * margin)), 0.37, np.float32)
    assert np.allclose(lens.expose(dense, 3, 0.55), 0.37, atol=1e-6)
