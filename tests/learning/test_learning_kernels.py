"""Training kernels: every one a valid blur, from a family wide enough to hold the kernels of the study."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.camera import mtf
from pipeline.camera.psf.kernel import centroid_px
from pipeline.errors import InputError
from pipeline.learning import kernels
from pipeline.streams import stream


@given(st.integers(0, 10**6))
def test_every_kernel_is_a_blur(seed):
    kernel = kernels.draw(stream(seed, "test"))
    assert kernel.shape == (kernels.CANVAS_PX, kernels.CANVAS_PX) and kernel.dtype == np.float32
    assert kernel.min() >= 0 and abs(float(kernel.sum()) - 1) < 1e-5
    assert (mtf.sample(kernel) <= 1 + 1e-6).all()


def test_nearly_all_kernels_are_centred_and_let_low_frequencies_pass():
    """Not all: light of a stop that is cut at a greatest value no longer counts for the middle (up to 3 px off)."""
    drawn = kernels.block(0, 7, count=1000)
    off_px = [np.abs(centroid_px(kernel)).max() for kernel in drawn]
    assert np.quantile(off_px, 0.98) < 1
    assert np.quantile([mtf.sample(kernel)[:, 0] for kernel in drawn], 0.01) > 0.3


def test_an_unknown_distribution_is_refused():
    with pytest.raises(InputError, match="no distribution 'paper'; did you mean 'paper_like'"):
        kernels.draw(stream(1, "test"), "paper")


def test_blocks_are_functions_of_their_number():
    first, again, other = (kernels.block(index, 7, count=5) for index in (3, 3, 4))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_bank_keeps_what_it_drew(tmp_path):
    fresh = kernels.bank(260, 3)
    kept = kernels.bank(260, 3, folder=tmp_path)
    assert np.array_equal(fresh, kept) and np.array_equal(kept, kernels.bank(260, 3, folder=tmp_path))
    assert np.array_equal(fresh[:250], kernels.block(0, 3).astype(np.float16))
    assert not np.array_equal(fresh, kernels.bank(260, 3, purpose="validation kernels"))


def test_paths_have_the_size_that_was_asked_for():
    """A straight path of size s has the MTF of a line of length s - 1 spread over a pixel, along itself."""
    generator = stream(1, "test")
    path = np.linspace(0, 1, kernels.POINTS) + 0j
    results = []
    for _ in range(20):
        kernel = kernels._along(generator, path, np.ones(kernels.POINTS), 15.0)
        results.append(mtf.sample(kernel)[0, :3])
    expected = mtf.line(14, mtf.FREQUENCIES[:3])
    assert np.abs(np.median(results, axis=0) - expected).max() < 0.03


def test_strengths_cover_the_range_from_sharp_to_21_px():
    """At the second frequency, where the paper's blurs differ most, the bank is spread over all of [0.1, 1]."""
    values = mtf.sample(kernels.block(0, 1))[:, :, 1].ravel()
    shares = np.histogram(values, bins=[0, 0.2, 0.4, 0.6, 0.8, 1.0001])[0] / len(values)
    assert (shares > 0.05).all(), shares


def test_bent_paths_are_bent():
    generator = stream(2, "test")
    ratios = []
    for _ in range(60):
        path, light = kernels.bent(generator)
        assert path.shape == light.shape == (kernels.POINTS,) and (light > 0).all()
        ratios.append(np.abs(np.diff(path)).sum() / np.abs(path[-1] - path[0]))
    assert np.median(ratios) > 1.1 and np.isfinite(path).all()
