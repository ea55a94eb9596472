"""Traces of demosaicing: where they are, where they are not, and what the default estimator makes of them."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from data_makers import picture

from pipeline import noise
from pipeline.noise import adaptive
from pipeline.noise.adaptive import DEMOSAICED
from pipeline.noise.traces.demosaicing import BLOCK_PX, LEAST_POWER, lattice_contrast
from pipeline.streams import stream

METHODS = (cv2.COLOR_BayerRGGB2BGR, cv2.COLOR_BayerRGGB2BGR_EA, cv2.COLOR_BayerRGGB2BGR_VNG)


def noisy(sigma_dn: float, key: int = 0, blur_px: float = 4) -> np.ndarray:
    """A scene with noise, as a mosaic of a grey scene or a picture of its own: (160, 160) uint8."""
    sharp = picture("demosaicing", 160, 160)
    scene = (cv2.GaussianBlur(sharp, (0, 0), blur_px) if blur_px else sharp).astype(np.float32)
    return np.clip(np.rint(scene + stream(1, "mosaic", key).normal(0, sigma_dn, scene.shape)), 20, 235).astype(np.uint8)


def demosaiced(mosaic: np.ndarray, method: int = METHODS[0]) -> np.ndarray:
    return cv2.cvtColor(cv2.cvtColor(mosaic, method), cv2.COLOR_BGR2GRAY)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("sigma_dn", [3.0, 12.0])
def test_demosaiced_noise_alternates(method, sigma_dn):
    delivered = demosaiced(noisy(sigma_dn), method)
    assert lattice_contrast(delivered) > DEMOSAICED[1]
    assert lattice_contrast(delivered[1:, :]) == pytest.approx(lattice_contrast(delivered), rel=0.3)


def test_other_noise_does_not():
    white = noisy(8.0)
    enlarged = cv2.resize(white, None, fx=2, fy=2, interpolation=cv2.INTER_LINEAR)
    scaled = cv2.resize(demosaiced(white), None, fx=0.7, fy=0.7, interpolation=cv2.INTER_AREA)
    for pixels in (white, enlarged, scaled, cv2.GaussianBlur(white, (0, 0), 1), np.full((64, 64), 90, np.uint8)):
        assert lattice_contrast(pixels) < DEMOSAICED[0]


def test_the_contrast_is_that_of_the_flattest_half_of_blocks():
    """Against the definition, pixel by pixel; with black and white pixels, whose squares are the largest there are."""
    pixels = stream(1, "blocks").choice(np.array([0, 255], np.uint8), (3 * BLOCK_PX + 5, 2 * BLOCK_PX))
    pixels[:, : BLOCK_PX - 3] = 90
    wide = np.pad(pixels.astype(float), 1, mode="reflect")
    change = wide[:-2, 1:-1] + wide[2:, 1:-1] + wide[1:-1, :-2] + wide[1:-1, 2:] - 4 * wide[1:-1, 1:-1]
    powers = []
    for top in range(0, 3 * BLOCK_PX, BLOCK_PX):
        for left in range(0, 2 * BLOCK_PX, BLOCK_PX):
            block = change[top : top + BLOCK_PX, left : left + BLOCK_PX] ** 2
            white = np.indices(block.shape).sum(axis=0) % 2 == 0
            powers.append((block[white].mean(), block[~white].mean()))
    flattest = np.array(sorted(powers, key=sum)[:3]).mean(axis=0) + LEAST_POWER
    assert lattice_contrast(pixels) == pytest.approx(abs(np.log(flattest[0] / flattest[1])), rel=1e-9)


@pytest.mark.parametrize("method", METHODS[:2])
def test_demosaiced_noise_is_answered_and_not_taken_for_grain_of_the_scene(method, monkeypatch):
    shots = np.stack([demosaiced(noisy(12.0, key, 0), method)[16:144, 16:144] for key in range(12)])
    true_dn = float(np.sqrt(shots.astype(float).var(axis=0, ddof=1).mean()))
    stack = (shots[:6, None] / 255).astype(np.float32)
    estimate = noise.create("adaptive").estimate(stack)
    assert not estimate.abstained.any()
    assert np.median(estimate.sigma_dn) == pytest.approx(true_dn, rel=0.15)
    assert ((estimate.low_dn <= true_dn) & (true_dn <= estimate.high_dn)).all()
    monkeypatch.setattr(adaptive, "lattice_contrast", lambda pixels: 0.0)
    assert noise.create("adaptive").estimate(stack).abstained.all()
