"""Impulse noise: the fraction of isolated pixels, 0 on scenes, noise, codecs, stars, text and raw mosaics."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
import pytest
from data_makers import picture

from pipeline.camera.processing.codec import Codec, store
from pipeline.condition.frame_flags import IMPULSE_FRACTION
from pipeline.condition.impulses import _sigma_dn, impulse_fraction
from pipeline.streams import stream

HEIGHT, WIDTH = 480, 720
SCENE = picture("impulses", WIDTH, HEIGHT)


def levels(values: np.ndarray) -> np.ndarray:
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)


def white(sigma_dn: float, mean: np.ndarray | float = SCENE) -> np.ndarray:
    return levels(mean + stream(0, "impulses", "white", sigma_dn).normal(0, sigma_dn, SCENE.shape))


def salted(frame: np.ndarray, fraction: float, salt: int = 255, pepper: int = 0) -> np.ndarray:
    """Salt and pepper on a fraction of the pixels."""
    drawn = stream(0, "impulses", "salt", fraction).random(frame.shape)
    return np.where(drawn < fraction / 2, pepper, np.where(drawn > 1 - fraction / 2, salt, frame)).astype(np.uint8)


@pytest.mark.parametrize("fraction", [0.001, 0.01, 0.05, 0.2])
@pytest.mark.parametrize("sigma_dn", [0.0, 5.0, 10.0])
def test_salt_and_pepper_are_measured_and_dense_ones_underestimated(fraction, sigma_dn):
    measured = impulse_fraction(salted(white(sigma_dn), fraction))
    assert (0.2 if fraction > 0.1 else 0.5) * fraction < measured < 1.3 * fraction
    assert measured > IMPULSE_FRACTION


def test_hot_and_dead_pixels_alone_are_measured():
    for salt, pepper in ((220, 220), (5, 5)):
        assert impulse_fraction(salted(white(2.0, 110.0), 0.002, salt, pepper)) == pytest.approx(0.002, rel=0.2)


def test_impulses_are_measured_behind_a_jpeg():
    coded = store(np.repeat(salted(SCENE, 0.01)[..., None], 3, axis=2), Codec("jpeg", 90))[..., 0]
    assert impulse_fraction(coded) == pytest.approx(impulse_fraction(salted(SCENE, 0.01)), rel=0.2)


def test_a_few_hot_pixels_raise_no_flag():
    few = salted(SCENE, 40 / 1e6)
    assert np.count_nonzero(few != SCENE) > 5
    assert impulse_fraction(few) < IMPULSE_FRACTION / 2


def sharpened(frame: np.ndarray) -> np.ndarray:
    return levels(frame + 2 * (frame - cv2.GaussianBlur(frame.astype(np.float32), (0, 0), 1.2)))


@pytest.mark.parametrize("sigma_dn", [0.0, 2.0, 5.0, 10.0, 25.0, 60.0])
@pytest.mark.parametrize("process", [np.asarray, sharpened])
def test_neither_a_scene_nor_white_noise_has_impulses(sigma_dn: float, process: Callable[[np.ndarray], np.ndarray]):
    for mean in (SCENE, 128.0):
        assert impulse_fraction(process(white(sigma_dn, mean))) < IMPULSE_FRACTION / 2


@pytest.mark.parametrize("codec", [Codec("jpeg", 60), Codec("jpeg", 95), Codec("h264", 23)])
def test_codecs_make_no_impulses(codec):
    for sigma_dn in (0.0, 10.0):
        frame = np.repeat(white(sigma_dn)[..., None], 3, axis=2)
        coded = store(frame, codec, [frame, frame] if codec.name == "h264" else [])
        assert impulse_fraction(coded[..., 0]) < IMPULSE_FRACTION / 2


def test_dark_frames_whose_noise_is_clipped_have_no_impulses():
    for mean in (2.0, 6.0):
        assert impulse_fraction(white(4.0, mean)) < IMPULSE_FRACTION


def test_clipped_noise_beside_texture_has_no_impulses():
    """Half of the frame is black: its noise looks weak, and what passes black isolated; the other half is no smooth."""
    draws = stream(0, "impulses", "half dark")
    texture = cv2.GaussianBlur(draws.standard_normal(SCENE.shape), (0, 0), 2.0)
    frame = 120 + 60 * texture / texture.std()
    frame[:, : WIDTH // 2] = 0
    assert impulse_fraction(levels(frame + draws.normal(0, 15, SCENE.shape))) < IMPULSE_FRACTION


@pytest.mark.parametrize("sigma_dn", [2.0, 5.0, 10.0])
def test_the_noise_that_impulses_are_compared_with_is_that_of_whole_grey_levels(sigma_dn):
    drawn = np.rint(stream(0, "impulses", "levels", sigma_dn).normal(0, sigma_dn, (200, 200)))
    assert _sigma_dn(np.abs(drawn).astype(np.uint8)) == pytest.approx(sigma_dn, rel=0.05)


def points(sigma_px: float, count: int) -> np.ndarray:
    """Optical images of points on a dark frame, centred anywhere."""
    draws = stream(0, "impulses", "points", sigma_px)
    scale = 8  # of a finer raster
    frame = np.zeros((scale * HEIGHT, scale * WIDTH), np.float32)
    rows, columns = draws.integers(scale * HEIGHT, size=count), draws.integers(scale * WIDTH, size=count)
    np.add.at(frame, (rows, columns), scale**2 * draws.uniform(200, 2000, count))
    optical = cv2.GaussianBlur(frame, (0, 0), scale * sigma_px)
    return levels(12 + cv2.resize(optical, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA))


def test_stars_are_no_impulses():
    stars = points(0.6, 3000)
    assert np.count_nonzero(stars > 60) > 2000
    assert impulse_fraction(stars) < IMPULSE_FRACTION / 2


def test_text_and_glints_in_a_part_of_the_frame_are_no_impulses():
    frame = SCENE.copy()
    frame[:60] = 20
    for line in range(12, 60, 12):
        cv2.putText(frame, ". : . i ; " * 16, (2, line), cv2.FONT_HERSHEY_SIMPLEX, 0.35, 230, 1)
    frame[-110:] = salted(np.full((110, WIDTH), 90, np.uint8), 0.01, 250, 250)  # sharper than any lens makes glints
    assert impulse_fraction(frame) < IMPULSE_FRACTION / 2


def test_a_raw_colour_mosaic_has_no_impulses():
    mosaic = np.full((HEIGHT, WIDTH), 40, np.uint8)  # of a red surface
    mosaic[::2, ::2] = 180
    assert impulse_fraction(mosaic) == 0
    mosaic[1::2, 1::2] = 90
    assert impulse_fraction(mosaic) == 0


def test_what_has_nothing_smooth_or_is_too_small_cannot_be_measured():
    assert np.isnan(impulse_fraction(np.zeros((63, 400), np.uint8)))
    assert np.isnan(impulse_fraction(np.zeros((1, 1), np.uint8)))
    rows, columns = np.indices((240, 360)) // 4
    assert np.isnan(impulse_fraction(levels((rows + columns) % 2 * 255)))
    assert impulse_fraction(np.zeros((64, 64), np.uint8)) == 0
