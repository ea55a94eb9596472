"""The wavelet baseline is scikit-image's, patch by patch."""

from __future__ import annotations

import numpy as np
import pytest
from skimage.restoration import estimate_sigma

from pipeline import noise
from pipeline.streams import stream


def test_equals_scikit_image() -> None:
    patches = 0.5 + stream(1, "wavelet").normal(0, 0.05, (4, 1, 96, 64))
    patches[2] = 0.25
    estimate = noise.create("wavelet").estimate(np.clip(patches, 0, 1))
    for index in (0, 1, 3):
        expected = 255 * estimate_sigma(np.clip(patches[index, 0], 0, 1))
        assert estimate.sigma_dn[index] == pytest.approx(expected, rel=1e-12)
    assert estimate.abstained[2]
