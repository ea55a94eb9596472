"""Saturated pixels: one rule for every estimator."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline import noise
from pipeline.blur.base import unusable
from pipeline.camera.saturation import (
    BLACK_BELOW_DN,
    SATURATED,
    WHITE_ABOVE_DN,
    is_saturated,
    saturated_fraction,
    saturated_pixels,
)
from pipeline.streams import stream


@given(st.integers(0, 255))
def test_pixels_that_round_to_black_or_white_are_saturated(level):
    image = np.full((1, 1), level / 255, np.float32)
    assert saturated_pixels(image)[0, 0] == (level in (0, 255))
    assert saturated_pixels(image)[0, 0] == (level <= BLACK_BELOW_DN or level >= WHITE_ABOVE_DN)


@given(st.integers(0, 64), st.sampled_from([0.0, 1.0]))
def test_fraction_counts_both_ends(count, end):
    patch = np.full((1, 8, 8), 0.5, np.float32)
    patch.reshape(-1)[:count] = end
    assert saturated_fraction(patch)[0] == count / 64
    assert is_saturated(patch, 0.25)[0] == (count >= 16)


def test_no_patches():
    assert saturated_fraction(np.empty((0, 1, 8, 8), np.float32)).shape == (0,)


def half_white(size_px, extra):
    """A textured patch, half of whose pixels, and some more or fewer, are white."""
    patch = 0.2 + 0.5 * stream(1, "half white").random((size_px, size_px), dtype=np.float32)
    patch.reshape(-1)[: size_px * size_px // 2 + extra] = 1.0
    return patch[None, None]


@pytest.mark.parametrize("extra", [-1, 0])
def test_blur_and_noise_estimators_agree_on_a_patch_with_half_of_its_pixels_white(extra):
    expected = SATURATED if extra == 0 else ""
    assert unusable(half_white(192, extra))[0] == expected
    assert noise.create("pca").estimate(half_white(128, extra)).reason[0] == expected
