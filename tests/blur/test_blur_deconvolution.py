"""The parts of blind deconvolution, each against what it should be equal to."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage, signal

from pipeline.blur.deconvolution import (
    block_minima,
    boundary,
    framelet,
    graph,
    informative,
    kernel_update,
    minimal_pixels,
    periodic,
    resample,
    salient,
    support,
    total_variation,
)
from pipeline.blur.deconvolution.failure import NoKernel
from pipeline.blur.deconvolution.graph_problems import GRAPH_WEIGHT, PeriodicProblem
from pipeline.streams import stream

seeds = st.integers(0, 10_000)


def kernel_of(seed, size=9):
    """A sparse non-negative kernel with unit sum."""
    rough = stream(seed, "kernel").random((size, size)) ** 6
    return rough / rough.sum()


# boundaries and resampling


@given(st.integers(1, 3000))
def test_fast_lengths_are_the_next_products_of_small_primes(least):
    def is_fast(length):
        for prime in (2, 3, 5, 7):
            while length % prime == 0:
                length //= prime
        return length in (1, 11, 13)

    result = boundary.fast_length(least)
    assert is_fast(result)
    assert not any(is_fast(length) for length in range(least, result))


def test_laplace_solutions_are_harmonic_and_reproduce_planes():
    border = stream(1, "border").random((14, 23))
    inside = ndimage.laplace(boundary.laplace(border))[1:-1, 1:-1]
    assert np.abs(inside).max() < 1e-12
    plane = np.add.outer(np.arange(9.0), 2 * np.arange(12.0))
    assert boundary.laplace(plane) == pytest.approx(plane, abs=1e-12)


def test_a_wrapped_image_keeps_the_image_and_has_no_edge_at_its_border():
    image = ndimage.gaussian_filter(stream(2, "image").random((60, 70)), 3)
    wrapped = boundary.smooth_wrap(image, (80, 96))
    assert np.array_equal(wrapped[:60, :70], image)
    # across what was the border the signal goes on: no jump larger than the image has itself, but for the one
    # repeated row
    widest = max(np.abs(np.diff(image, axis=axis)).max() for axis in (0, 1))
    assert np.abs(np.roll(wrapped, -1, 1) - wrapped).max() <= widest + 1e-12
    assert wrapped.min() >= image.min() - 1e-12
    assert wrapped.max() <= image.max() + 1e-12


@pytest.mark.parametrize("method", ["linear", "cubic"])
@pytest.mark.parametrize(("before", "after"), [(192, 121), (7, 11), (31, 25), (121, 192)])
def test_resizing_reproduces_constants_and_lines(before, after, method):
    matrix = resample.resize_matrix(before, after, after / before, method)
    assert matrix.sum(axis=1) == pytest.approx(np.ones(after))
    line = matrix @ (np.arange(before) + 0.5)
    inside = slice(4, -4)
    assert line[inside] == pytest.approx((np.arange(after)[inside] + 0.5) * before / after, abs=0.15 * before / after)


def test_upward_linear_resizing_is_opencvs():
    image = stream(3, "image").random((19, 23)).astype(np.float32)
    ours = resample.resize(image, (31, 40), "linear")
    assert ours == pytest.approx(cv2.resize(image, (40, 31), interpolation=cv2.INTER_LINEAR), abs=1e-6)


def test_gaussian_reduction_darkens_a_constant_by_the_taps_it_dropped():
    reduced = resample.gaussian_reduce(np.ones((192, 192)), 0.5**0.5)
    assert reduced.shape == (134, 134)
    assert reduced.max() - reduced.min() < 1e-12
    assert 0.84 < reduced.mean() < 0.99
    assert resample.gaussian_reduce(np.ones((5, 5)), 1.0).shape == (5, 5)


def test_gaussian_reduction_takes_far_taps_as_zero_for_a_program_that_stops_at_underflow():
    image = stream(1, "taps").random((192, 192))
    with np.errstate(all="raise"):
        reduced = resample.gaussian_reduce(image, 0.5**0.5)
    np.testing.assert_array_equal(reduced, resample.gaussian_reduce(image, 0.5**0.5))


@given(seeds, st.integers(5, 13), st.integers(5, 13))
def test_fitting_keeps_what_lies_in_the_middle(seed, before, after):
    kernel = np.zeros((before, before))
    middle = before // 2
    kernel[middle - 1 : middle + 2, middle - 1 : middle + 2] = stream(seed, "fit").random((3, 3)) + 0.1
    fitted = resample.fit(kernel, after)
    assert fitted.shape == (after, after)
    assert fitted.sum() == pytest.approx(kernel.sum())


# kernels


@given(seeds, st.sampled_from([7, 11, 31]))
def test_cleaned_kernels_are_non_negative_with_unit_sum(seed, size):
    kernel = stream(seed, "raw").normal(0.1, 1, (size, size))
    for clean in (support.normalise, support.drop_weak, support.centre_mass, support.centre_box):
        source = kernel if clean in (support.normalise, support.drop_weak) else np.maximum(kernel, 0)
        cleaned = clean(source)
        assert cleaned.min() >= 0
        assert cleaned.sum() == pytest.approx(1)


def test_a_kernel_without_mass_is_no_kernel():
    for lost in (np.zeros((5, 5)), np.full((5, 5), -1.0), np.full((5, 5), np.nan)):
        with pytest.raises(NoKernel):
            support.normalise(lost)


@given(seeds, st.integers(-4, 4), st.integers(-4, 4))
def test_centring_undoes_a_shift(seed, down, right):
    kernel = np.zeros((21, 21))
    kernel[8:13, 8:13] = stream(seed, "shift").random((5, 5)) + 0.2
    centred = support.centre_mass(kernel)
    assert support.centre_mass(support.shifted(centred, down, right)) == pytest.approx(centred)
    rows = np.arange(21) - 10
    assert abs(centred.sum(axis=1) @ rows) <= 0.5 + 1e-9
    boxed = support.centre_box(support.shifted(kernel, down, right))
    assert boxed == pytest.approx(kernel / kernel.sum())


def test_small_islands_are_dropped_and_large_ones_stay():
    kernel = np.zeros((9, 9))
    kernel[4, 3:6] = 0.25
    kernel[1, 1] = kernel[0, 0] = 0.07  # joined by a corner: together heavy enough
    kernel[8, 8] = 0.11
    kernel[8, 0] = 0.05
    cleaned = support.drop_islands(kernel / kernel.sum())
    assert cleaned[8, 0] == 0
    assert cleaned[0, 0] > 0
    assert cleaned[4, 4] > 0


@given(seeds, st.sampled_from([5, 9, 13]))
def test_the_framelet_is_a_tight_frame(seed, size):
    kernel = stream(seed, "framelet").normal(size=(size, size))
    coefficients = framelet.decompose(kernel)
    assert framelet.reconstruct(coefficients) == pytest.approx(kernel)
    assert (coefficients**2).sum() == pytest.approx((kernel**2).sum())
    assert framelet.keep_largest(kernel, 1.0) == pytest.approx(kernel)


def test_keeping_the_largest_coefficients_removes_noise():
    clean = np.zeros((31, 31))
    clean[12:19, 12:19] = 1 / 49
    noisy = clean + stream(4, "noise").normal(0, 1e-3, clean.shape)
    kept = framelet.keep_largest(noisy)
    assert np.abs(kept - clean).sum() < 0.35 * np.abs(noisy - clean).sum()


@pytest.mark.parametrize("size", [9, 17])  # dense and Fourier operator
@pytest.mark.parametrize("pad", [0, 40])
def test_the_kernel_update_recovers_the_kernel_that_blurred(size, pad):
    kernel = kernel_of(5, size)
    sharp = np.zeros((2, 90, 90))
    sharp[:, 20:70, 20:70] = stream(5, "gradients").normal(size=(2, 50, 50))
    blurred = np.stack([signal.fftconvolve(one, kernel, mode="same") for one in sharp])
    result = kernel_update.solve(sharp, blurred, size, ridge=1e-9, pad=pad, steps=300)
    assert result == pytest.approx(kernel, abs=1e-6)


def test_both_operators_of_the_kernel_update_agree(monkeypatch):
    sharp = stream(6, "gradients").normal(size=(2, 64, 64))
    blurred = ndimage.gaussian_filter(sharp, (0, 1, 1))
    dense = kernel_update.solve(sharp, blurred, 11, ridge=2.0)
    monkeypatch.setattr(kernel_update, "_DENSE_UP_TO", 0)
    assert kernel_update.solve(sharp, blurred, 11, ridge=2.0) == pytest.approx(dense, abs=1e-12)


@given(seeds, st.floats(0.2, 5.0))
def test_the_kernel_does_not_depend_on_the_brightness_scale(seed, scale):
    sharp = stream(seed, "gradients").normal(size=(2, 40, 40))
    blurred = ndimage.gaussian_filter(sharp, (0, 1, 1))
    one = kernel_update.solve(sharp, blurred, 7, ridge=2.0)
    other = kernel_update.solve(scale * sharp, scale * blurred, 7, ridge=2.0 * scale**2)
    assert other == pytest.approx(one, abs=1e-6)


# gradients


def test_the_first_threshold_leaves_enough_pixels_of_every_orientation():
    image = ndimage.gaussian_filter(stream(7, "image").random((47, 47)), 1)
    threshold = salient.first_threshold(image, 9)
    px, py = salient.gradients(image)
    strong = px**2 + py**2 >= threshold
    angle = np.degrees(np.arctan(py / px))
    counts = [(strong & (angle >= low) & (angle < low + 45)).sum() for low in (0, 45, -45, -90)]
    assert min(counts) >= 180
    above = px**2 + py**2 >= threshold + salient.GRID
    assert min((above & (angle >= low) & (angle < low + 45)).sum() for low in (0, 45, -45, -90)) < 180


def test_selection_lowers_the_threshold_until_something_is_left():
    image = np.zeros((20, 20))
    image[:, 10:] = 0.1
    kept, threshold = salient.select(image, 1.0)
    assert np.count_nonzero(kept) == 19
    assert threshold < 0.01 / 1.1 + 1e-12
    assert not salient.select(np.zeros((20, 20)), 1.0)[0].any()  # and ends where nothing is


@given(seeds, st.sampled_from([0.1, 0.3]))
def test_bisection_finds_the_fraction(seed, fraction):
    values = stream(seed, "values").random((50, 50))
    above = (values > informative.bisected_threshold(values, fraction)).mean()
    assert above == pytest.approx(fraction, rel=0.1)


@given(seeds, st.floats(0.1, 1.0))
def test_the_strongest_gradients_do_not_depend_on_contrast(seed, contrast):
    values = stream(seed, "values").random((40, 40))
    one = values > informative.bisected_threshold(values, 0.1)
    other = contrast * values > informative.bisected_threshold(contrast * values, 0.1)
    assert np.array_equal(one, other)


def test_steps_inform_and_fine_texture_does_not():
    image = np.tile(np.linspace(0.1, 0.4, 96), (96, 1))
    image[:, 60:] += 0.4
    image[10:40, 5:35] += 0.2 * (np.indices((30, 30)).sum(axis=0) % 2)
    kept = informative.informative_gradients(image)
    assert (kept[0][50:90, 59] != 0).all()
    assert not kept[:, 14:36, 9:31].any()


# images


@given(seeds, st.sampled_from([3, 4]), st.booleans())
def test_both_ways_to_shrink_minima_agree_without_ties(seed, block, hard):
    image = stream(seed, "image").normal(0.05, 0.05, (6 * block, 8 * block))
    first, every = image.copy(), image.copy()
    block_minima.shrink_first(first, block, 0.04, hard)
    block_minima.shrink_all(every, block, 0.04, hard)
    assert every == pytest.approx(first, abs=1e-15)
    assert np.count_nonzero(first != image) <= 48


def test_of_equal_minima_the_first_down_the_columns_is_shrunk():
    image = np.full((4, 4), 0.5)
    image[2, 0] = image[0, 1] = 0.05
    block_minima.shrink_first(image, 4, 0.1, hard=True)
    assert image[2, 0] == 0
    assert image[0, 1] == 0.05


def test_blocks_at_the_border_may_be_smaller():
    image = np.full((5, 6), 0.5)
    block_minima.shrink_first(image, 4, 0.1, hard=False)
    assert np.count_nonzero(image != 0.5) == 4
    assert image[4, 4] == pytest.approx(0.4)


@given(seeds)
def test_differences_and_their_adjoint_are_adjoint_and_the_laplacian_is_their_product(seed):
    numbers = stream(seed, "grid")
    image, across, down = (numbers.normal(size=(12, 17)) for _ in range(3))
    grid = periodic.Differences((12, 17), np.dtype(float))
    dx, dy = (edge.copy() for edge in grid.of(image))
    left = (dx * across).sum() + (dy * down).sum()
    assert left == pytest.approx((image * grid.adjoint(across, down)).sum())
    spectrum = np.fft.rfft2(image) * periodic.laplacian_spectrum((12, 17), np.dtype(float))
    assert grid.adjoint(dx, dy) == pytest.approx(np.fft.irfft2(spectrum, s=(12, 17)))


def test_total_variation_denoising_removes_noise_and_keeps_steps():
    clean = np.full((64, 64), 0.3)
    clean[:, 32:] = 0.7
    noisy = clean + stream(8, "noise").normal(0, 0.02, clean.shape)
    result = total_variation.denoise(noisy, steps=60)
    assert np.abs(result - clean).mean() < 0.4 * np.abs(noisy - clean).mean()
    assert result[:, 40:].mean() - result[:, :24].mean() > 0.38


def objective(image, noisy, weight):
    variation = sum(np.abs(np.diff(image, axis=axis)).sum() for axis in (0, 1))
    return 0.5 * ((image - noisy) ** 2).sum() + weight * variation


def test_total_variation_denoising_is_the_minimum_that_scikit_image_finds():
    """Scikit-image minimises the isotropic form; along one direction the two are the same."""
    from skimage.restoration import denoise_tv_bregman

    row = np.repeat(stream(9, "steps").random(8), 12) + stream(9, "noise").normal(0, 0.03, 96)
    noisy = np.repeat(row[None], 64, axis=0)
    ours = total_variation.denoise(noisy, weight=0.05, steps=400)
    theirs = denoise_tv_bregman(noisy, weight=1 / 0.05, max_num_iter=2000, eps=1e-7, isotropic=False)
    assert objective(ours, noisy, 0.05) <= objective(theirs, noisy, 0.05) * 1.01


def test_the_latent_image_of_an_unblurred_one_is_itself():
    image = np.full((48, 48), 0.6)
    image[10:30, 12:40] = 0.2
    delta = np.zeros((7, 7))
    delta[3, 3] = 1
    result = minimal_pixels.latent_image(image, delta, 0.0, 1e-4, 4, False, minimal_pixels.Schedule())
    assert result == pytest.approx(image, abs=0.01)


def test_the_latent_image_is_sharper_than_the_blurred_one():
    image = np.full((96, 96), 0.7)
    image[30:60, 30:60] = 0
    kernel = np.full((5, 5), 0.04)
    blurred = ndimage.convolve(image, kernel, mode="wrap")
    result = minimal_pixels.latent_image(blurred, kernel, 0.01, 4e-3, 4, True, minimal_pixels.Schedule())
    assert np.abs(result - image).mean() < 0.3 * np.abs(blurred - image).mean()


def test_the_periodic_problem_is_solved_as_a_dense_system():
    image = ndimage.gaussian_filter(stream(10, "image").random((24, 24)), 1)
    kernel = kernel_of(10, 5)
    problem = PeriodicProblem(image, kernel, steps=60)
    rows, columns = problem.shape
    numbers = stream(10, "weights")
    weights = numbers.uniform(1, 20, problem.shape), numbers.uniform(1, 20, problem.shape)
    blurring = np.empty((rows * columns, rows * columns))
    laplacian = np.zeros_like(blurring)
    for index in range(rows * columns):
        unit = np.zeros(problem.shape)
        unit.flat[index] = 1
        blurring[:, index] = ndimage.convolve(unit, kernel, mode="wrap").ravel()
        flows = weights[0] * (np.roll(unit, -1, 1) - unit), weights[1] * (np.roll(unit, -1, 0) - unit)
        laplacian[:, index] = sum((np.roll(f, 1, ax) - f).ravel() for f, ax in zip(flows, (1, 0), strict=True))
    dense = blurring.T @ blurring + 2 * GRAPH_WEIGHT * laplacian
    expected = np.linalg.solve(dense, blurring.T @ boundary.smooth_wrap(image, problem.shape).ravel())
    assert 0 < expected.min() < expected.max() < 1  # nothing is clipped
    assert problem.solve(weights).ravel() == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize("periodic_domain", [True, False])
def test_a_skeleton_has_steps_where_the_blurred_image_has_ramps(periodic_domain):
    image = np.full((64, 64), 0.3)
    image[:, 30:] = 0.7
    kernel = np.full((1, 7), 1 / 7)
    square = np.zeros((7, 7))
    square[3] = kernel
    blurred = ndimage.convolve(image, kernel, mode="nearest")
    result = graph.skeleton(blurred, square, graph.Solver(periodic=periodic_domain, steps=12))
    assert np.diff(result[32])[29] > 0.3
    assert np.abs(result - image).mean() < 0.3 * np.abs(blurred - image).mean()
