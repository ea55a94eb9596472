"""Convolution: equal to SciPy's, at any size; range, mean and identity kept; gradients flow."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage

from pipeline import streams
from pipeline.camera.blur import blur
from pipeline.camera.psf import create, defocus
from pipeline.errors import InputError

MODES = {"reflect": "mirror", "zero": "constant"}


def picture(*shape: int, seed: int = 0) -> np.ndarray:
    return streams.stream(seed, "picture").random(shape, dtype=np.float32)


def lopsided(rows: int, columns: int, seed: int) -> np.ndarray:
    weights = streams.stream(seed, "psf").random((rows, columns)) ** 3
    return (weights / weights.sum()).astype(np.float32)


SIDES = st.integers(0, 16).map(lambda half: 2 * half + 1)


@given(st.integers(1, 60), st.integers(1, 60), SIDES, SIDES, st.sampled_from(["reflect", "zero"]), st.integers(0, 999))
def test_equals_scipy(height: int, width: int, rows: int, columns: int, boundary: str, seed: int) -> None:
    image, psf = picture(height, width, seed=seed), lopsided(rows, columns, seed)
    expected = ndimage.convolve(image.astype(np.float64), psf.astype(np.float64), mode=MODES[boundary])
    assert np.abs(blur(image, psf, boundary) - expected).max() < 1e-6
    if height > rows and width > columns:
        assert np.abs(blur(torch.from_numpy(image), psf, boundary).numpy() - expected).max() < 1e-6


@pytest.mark.parametrize("side", [3, 11, 13, 21, 41])
@pytest.mark.parametrize("boundary", ["reflect", "zero"])
def test_equals_scipy_on_frames_of_several_strips(side: int, boundary: str) -> None:
    image, psf = picture(2003, 120), lopsided(side, side, 1)
    expected = ndimage.convolve(image, psf, mode=MODES[boundary])
    assert np.abs(blur(image, psf, boundary) - expected).max() < 1e-6


def test_a_point_of_light_becomes_the_psf_the_right_way_round() -> None:
    psf = create("nonlinear_motion", 21, 45, streams.stream(4, "psf"))
    image = np.zeros((101, 101), np.float32)
    image[50, 50] = 1
    half = len(psf) // 2
    selected = blur(image, psf)[50 - half : 51 + half, 50 - half : 51 + half]
    assert np.abs(selected - psf).max() < 1e-6


@pytest.mark.parametrize("boundary", ["reflect", "zero"])
def test_a_psf_of_one_pixel_returns_the_same_bits(boundary: str) -> None:
    image = picture(40, 50)
    for psf in (np.ones((1, 1), np.float32), create("defocus", 1), np.pad(np.ones((1, 1)), 16)):
        out = blur(image, psf, boundary)
        assert np.array_equal(out, image) and out is not image
        assert np.array_equal(blur(torch.from_numpy(image), psf, boundary).numpy(), image)


@given(st.floats(0, 1), st.sampled_from([3, 7, 11, 15, 21]))
def test_a_constant_stays_exactly_constant(level: float, size_px: int) -> None:
    image = np.full((64, 80), level, np.float32)
    assert np.array_equal(blur(image, create("defocus", size_px)), image)


@pytest.mark.parametrize("size_px", [5, 21])
def test_values_never_leave_the_range_of_the_image(size_px: int) -> None:
    image = (picture(200, 200) > 0.5).astype(np.float32)
    for boundary in MODES:
        out = blur(image, create("defocus", size_px), boundary)
        assert out.min() >= 0 and out.max() <= 1


def test_a_dark_boundary_darkens_the_border_only() -> None:
    image = np.ones((60, 60), np.float32)
    out = blur(image, create("defocus", 11), "zero")
    assert out[0].max() < 0.6 and out[6:-6, 6:-6].min() > 0.999


@pytest.mark.parametrize("size_px", [7, 21])
def test_variance_of_white_noise_falls_by_the_energy_of_the_psf(size_px: int) -> None:
    image = picture(900, 900)
    psf = create("defocus", size_px)
    expected = image.var() * float((psf.astype(np.float64) ** 2).sum())
    assert blur(image, psf).var() == pytest.approx(expected, rel=0.1)


def test_blurring_is_linear_and_commutes() -> None:
    first, second = picture(120, 90, seed=1) / 2, picture(120, 90, seed=2) / 2
    disc, line = create("defocus", 15), create("linear_motion", 13, 30)
    assert np.allclose(blur(first + second, disc), blur(first, disc) + blur(second, disc), atol=1e-6)
    # Borders do not commute; the inside does.
    inside = (slice(20, -20), slice(20, -20))
    assert np.allclose(blur(blur(first, disc), line)[inside], blur(blur(first, line), disc)[inside], atol=1e-6)


def test_batches_are_blurred_one_by_one() -> None:
    batch = picture(3, 1, 70, 90)
    psf = create("defocus", 13)
    out = blur(batch, psf)
    assert out.shape == batch.shape and out.dtype == np.float32
    for index in range(3):
        assert np.array_equal(out[index, 0], blur(batch[index, 0], psf))
    assert np.allclose(blur(torch.from_numpy(batch), psf).numpy(), out, atol=1e-6)


def test_each_image_may_have_its_own_psf() -> None:
    batch = picture(3, 1, 70, 90)
    stack = np.zeros((3, 15, 15), np.float32)
    for index, size_px in enumerate((1, 7, 15)):
        disc = defocus.disc(size_px)
        half = len(disc) // 2
        stack[index, 7 - half : 8 + half, 7 - half : 8 + half] = disc
    for out in (blur(batch, stack), blur(torch.from_numpy(batch), stack).numpy()):
        for index in range(3):
            assert np.allclose(out[index, 0], blur(batch[index, 0], stack[index]), atol=1e-6)
    assert np.array_equal(blur(batch, stack)[0], batch[0])  # one pixel: the same bits, for arrays


def test_tensors_carry_gradients() -> None:
    image = torch.from_numpy(picture(32, 32)).requires_grad_()
    psf = create("linear_motion", 9)
    blur(image, psf, "zero")[16, 16].backward()
    # The gradient of one output is the PSF about it, turned by half a turn (this one is symmetric).
    assert image.grad is not None
    assert np.allclose(image.grad.numpy()[12:21, 12:21], psf, atol=1e-6)


def test_a_kernel_with_negative_values_is_not_clipped() -> None:
    sharpen = np.array([[0, -1, 0], [-1, 5, -1], [0, -1, 0]], np.float32)
    image = picture(50, 50)
    assert np.allclose(blur(image, sharpen), ndimage.convolve(image, sharpen, mode="mirror"), atol=1e-5)
    assert blur(image, sharpen).max() > image.max()


@pytest.mark.parametrize(
    ("image", "psf", "boundary", "message"),
    [
        (np.zeros((9, 9), np.uint8), np.ones((1, 1)), "reflect", "divide 8-bit values by 255"),
        (torch.zeros((9, 9), dtype=torch.uint8), np.ones((1, 1)), "reflect", "divide 8-bit values by 255"),
        (np.zeros((9, 9, 3), np.float32), np.ones((1, 1)), "reflect", "expected .H, W."),
        (np.zeros((9, 9), np.float32), np.ones((2, 2)) / 4, "reflect", "odd sides"),
        (np.zeros((9, 9), np.float32), np.ones((3, 3)), "reflect", "divide it by its sum"),
        (np.zeros((9, 9), np.float32), np.full((3, 3), np.nan), "reflect", "sums to nan"),
        (np.zeros((2, 1, 9, 9), np.float32), np.ones((3, 1, 1)), "reflect", "for this batch"),
        (np.zeros((9, 9), np.float32), np.ones((1, 1)), "mirror", "unknown boundary 'mirror'"),
        (torch.zeros((9, 9)), np.full((21, 21), 1 / 441), "reflect", "too large for a tensor"),
        (np.where(np.eye(9) > 0, np.nan, 0.5), np.ones((1, 1)), "reflect", "not finite"),
        (np.where(np.eye(9) > 0, -np.inf, 0.5), np.full((3, 3), 1 / 9), "zero", "not finite"),
        (torch.eye(9) * torch.nan, np.full((3, 3), 1 / 9), "reflect", "not finite"),
        (np.ma.masked_equal(np.eye(9), 1), np.full((3, 3), 1 / 9), "reflect", "image: masked pixels"),
    ],
)
def test_bad_input_is_named(image, psf, boundary: str, message: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(InputError, match=message):
        blur(image, psf, boundary)
