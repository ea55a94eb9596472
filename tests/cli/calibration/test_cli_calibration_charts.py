"""The MTF of pictures of charts: Siemens stars that are known, and what is refused."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from data_makers import gaussian_mtf, picture
from star_makers import synthesise

from pipeline.camera.mtf import FREQUENCIES
from pipeline.cli.calibration.charts import star_mtf
from pipeline.errors import InputError
from pipeline.streams import stream

SIGMA_PX = 0.9


def test_a_star_too_noisy_for_its_contrast_is_refused():
    clean = cv2.GaussianBlur(synthesise(520, 520, 36, amplitude=0.06, supersample=2).astype(np.float64), (0, 0), 1.0)
    noisy = clean + stream(0, "faint star").normal(0, 5 / 255, clean.shape)
    with pytest.raises(InputError, match=r"--chart star: the .* MTF is too noisy: standard error 0\.09"):
        star_mtf([("star", noisy.astype(np.float32))], 36)
    assert star_mtf([("star", clean.astype(np.float32))], 36).shape == (2, 8)


@pytest.mark.parametrize("black_and_white", [False, True])
def test_clipped_stars_are_refused_and_white_of_exactly_255_is_not(black_and_white):
    unit = synthesise(360, 360, 30, mean=0.5, amplitude=5.0 if black_and_white else 0.5, supersample=3)
    unit = cv2.GaussianBlur(np.clip(unit, 0, 1), (0, 0), SIGMA_PX)

    def mtf(low, high):
        image = np.rint(np.clip(low + (high - low) * unit, 0, 1) * 255) / 255
        return star_mtf([("star", image.astype(np.float32))], 30)

    np.testing.assert_allclose(mtf(0.0, 1.0), mtf(0.2, 0.8), atol=0.02)
    with pytest.raises(InputError, match="star: star: clipped at white, which changes its MTF; expose less"):
        mtf(0.2, 1.3)
    with pytest.raises(InputError, match="clipped at black, "):
        mtf(-0.2, 0.8)


@pytest.mark.parametrize(
    ("rays", "size_px"), [(24, 300), (36, 512), (40, 520), (60, 760), (72, 900), (100, 1220), (144, 1740)]
)
def test_common_stars_work_without_more_options(rays, size_px):
    sharp = synthesise(size_px, size_px, rays, supersample=2).astype(np.float64)
    mtf = star_mtf([("star", cv2.GaussianBlur(sharp, (0, 0), SIGMA_PX).astype(np.float32))], rays)
    x = np.pi * FREQUENCIES / 2 / 2
    truth = gaussian_mtf(SIGMA_PX) * np.cos(x)  # the mean of two points per pixel
    np.testing.assert_allclose(mtf, truth / truth[:, :1], atol=0.03 if rays < 36 else 0.01)


def star_picture(rays, size_px, shift_px=(0.0, 0.0), black_and_white=False):
    centre_px = (size_px - 1) / 2 + shift_px[0], (size_px - 1) / 2 + shift_px[1]
    amplitude = 20.0 if black_and_white else 0.35
    image = synthesise(size_px, size_px, rays, centre_px=centre_px, amplitude=amplitude).astype(np.float64)
    return np.clip(image, 0.15, 0.85)


@pytest.mark.parametrize(("rays", "size_px"), [(36, 448), (60, 730)])
def test_black_and_white_rays_give_the_same_mtf(rays, size_px):
    x = (np.arange(4 * size_px) - 2 * size_px + 0.5)[None]  # four times as fine as the pixels
    fine = np.where(np.sin(rays * np.arctan2(-x.T, x)) > 0, 0.85, 0.15).astype(np.float32)
    image = cv2.GaussianBlur(fine, (0, 0), 4 * SIGMA_PX).reshape(size_px, 4, size_px, 4).mean(axis=(1, 3))
    truth = gaussian_mtf(SIGMA_PX) * np.sinc(FREQUENCIES / 2)
    np.testing.assert_allclose(star_mtf([("star", image)], rays), np.maximum(truth / truth[:, :1], 0.05), atol=0.03)


@pytest.mark.parametrize("black_and_white", [False, True])
@pytest.mark.parametrize(("rays", "size_px"), [(36, 520), (60, 760)])
def test_stars_are_known_behind_blur_noise_shift_and_uneven_light(rays, size_px, black_and_white):
    image = star_picture(rays, size_px, (6.3, -4.6), black_and_white)
    image = cv2.GaussianBlur(image, (0, 0), 2.0) * np.linspace(0.35, 1, size_px) * np.linspace(0.7, 1, size_px)[:, None]
    image += stream(0, "star").normal(0, 6 / 255, image.shape)
    image = np.clip(image, 0, 1).astype(np.float32)
    assert star_mtf([("star", image)], rays).shape == (2, 8)
    for wrong in (2 * round(0.45 * rays), rays - 2, rays + 2):
        with pytest.raises(InputError, match=rf"no Siemens star of {wrong} rays.*(about )?{rays} rays"):
            star_mtf([("star", image)], wrong)
    for wrong in (rays // 2, 2 * rays, 2 * round(0.55 * rays)):
        with pytest.raises(InputError, match="--rays"):
            star_mtf([("star", image)], wrong)


def test_what_is_no_star_is_refused():
    noise = np.clip(stream(0, "noise").normal(0.5, 0.2, (900, 900)), 0, 1).astype(np.float32)
    text = np.full((900, 900), 255, np.uint8)
    for line in range(30):
        words = f"{line} The quick brown fox jumps over the lazy dog"
        cv2.putText(text, words, (5, 28 * line + 24), cv2.FONT_HERSHEY_SIMPLEX, 1.0, 0, 2)
    photograph = (picture("no star", 900, 900) / 255).astype(np.float32)
    for image in (noise, (text / 255).astype(np.float32), photograph):
        for rays in (24, 36, 40):
            with pytest.raises(InputError, match="star: no Siemens star.*explain|picture ends"):
                star_mtf([("star", image)], rays)
    hidden = star_picture(36, 520)
    hidden[:260, 260:] = 0.3
    with pytest.raises(InputError, match="part of it is hidden"):
        star_mtf([("star", hidden.astype(np.float32))], 36)
    small = star_picture(36, 700)
    y, x = np.indices(small.shape)
    small[np.hypot(x - 349.5, y - 349.5) > 180] = 0.85
    with pytest.raises(InputError, match="424 px across, but its rays end before that"):
        star_mtf([("star", small.astype(np.float32))], 36)
    with pytest.raises(InputError, match="differ by . DN"):
        star_mtf([("star", (0.5 + 0.02 * (star_picture(36, 520) - 0.5)).astype(np.float32))], 36)
