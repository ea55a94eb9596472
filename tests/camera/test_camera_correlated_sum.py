"""The variance of sums of independent, equal and alternating terms."""

import numpy as np
import pytest

from pipeline.camera.correlated_sum import NEIGHBOURS, sum_variance
from pipeline.streams import stream


def test_the_variance_of_a_sum_of_moving_averages():
    """Of a mean over k independent terms the sum varies as that of the terms themselves."""
    drawn = stream(0, "moving averages").normal(size=(2000, 300))
    smooth = (drawn[2:] + drawn[1:-1] + drawn[:-2]) / 3
    for terms, least in ((drawn, 1.0), (smooth, 0.85)):  # weights fall with the distance, so that some is left out
        ratio = sum_variance(terms).mean() / terms.sum(axis=0).var()
        assert least - 0.15 < ratio < 1.15
    assert np.square(smooth).sum(axis=0).mean() / smooth.sum(axis=0).var() < 0.4


@pytest.mark.parametrize("count", [1, 2, NEIGHBOURS, 50])
def test_it_is_never_negative(count):
    alternating = (-1.0) ** np.arange(count)
    assert sum_variance(alternating[:, None])[0] >= 0
