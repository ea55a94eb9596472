"""Clipped transitions: told from white of exactly full scale by the slope at which saturation sets in."""

import numpy as np
import pytest
from scipy.special import ndtr

from pipeline.camera.clipping import ENDS, clipping, refuse_clipped, saturated_at
from pipeline.errors import InputError

POSITION_PX = np.arange(-10, 10, 0.25)


def of_edge(low_dn, high_dn, sigma_px=0.7):
    """`clipping` at black and white of a Gaussian edge, stored in 8 bit."""
    levels = np.rint(np.clip(low_dn + (high_dn - low_dn) * ndtr(POSITION_PX / sigma_px), 0, 255)) / 255
    return [clipping(levels, saturated_at(levels, end).astype(float)) for end in ENDS]


@pytest.mark.parametrize("sigma_px", [0.5, 0.7, 1.0, 2.0, 4.0])
def test_what_is_cut_off_shows_and_full_scale_does_not(sigma_px):
    assert of_edge(40, 250, sigma_px) == [0, 0]
    assert max(of_edge(0, 255, sigma_px)) < 0.09
    for high in (270, 300, 350):
        black, white = of_edge(40, high, sigma_px)
        assert black == 0 and white > 0.15
        mirrored = of_edge(255 - high, 215, sigma_px)
        assert mirrored[1] == 0 and mirrored[0] > 0.15


def test_noise_free_plateaus_alone_have_none():
    flat = np.ones(20)
    assert clipping(flat, saturated_at(flat, "white").astype(float)) == 0


def test_the_error_names_the_end_and_the_exposure():
    refuse_clipped("edge", [0.1, 0.1], 0.15)
    for clippings, words in (
        ([0.2, 0.1], "edge: clipped at black, .* expose longer"),
        ([0.1, 0.2], "edge: clipped at white, .* expose less"),
        ([0.2, 0.2], "edge: clipped at black and white, .* less contrast"),
    ):
        with pytest.raises(InputError, match=words):
            refuse_clipped("edge", clippings, 0.15)
