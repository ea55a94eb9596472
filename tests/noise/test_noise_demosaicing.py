"""Traces of demosaicing: where they are, where they are not, and what the default estimator makes of them."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from data_makers import picture

from pipeline import noise
from pipeline.noise import adaptive
from pipeline.noise.adaptive import DEMOSAICED
from pipeline.noise.demosaicing import BLOCK_PX, lattice_contrast
from pipeline.streams import stream

METHODS = (cv2.COLOR_BayerRGGB2BGR, cv2.COLOR_BayerRGGB2BGR_EA, cv2.COLOR_BayerRGGB2BGR_VNG)


def noisy(sigma_dn: float, key: int = 0) -> np.ndarray:
    """A smooth scene with noise, as a mosaic of a grey scene or a picture of its own: (160, 160) uint8."""
    scene = cv2.GaussianBlur(picture("demosaicing", 160, 160), (0, 0), 4).astype(np.float32)
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


def test_sums_are_exact_for_the_strongest_pattern():
    chess = np.where(np.indices((BLOCK_PX, BLOCK_PX)).sum(axis=0) % 2, 255, 0).astype(np.uint8)
    assert lattice_contrast(chess) == pytest.approx(0, abs=0.2)
    half = chess.copy()
    half[:, :] = np.where(chess == 255, 255, 128)
    half[::4] = 128
    assert np.isfinite(lattice_contrast(half))


@pytest.mark.parametrize("method", METHODS)
def test_demosaiced_noise_is_answered_and_not_taken_for_grain_of_the_scene(method, monkeypatch):
    patches = np.stack([demosaiced(noisy(12.0, key), method)[16:144, 16:144] for key in range(8)])
    shots = np.stack([demosaiced(noisy(12.0, 100 + key), method)[16:144, 16:144] for key in range(16)])
    true_dn = float(np.sqrt(shots.astype(float).var(axis=0, ddof=1).mean()))
    stack = (patches[:, None] / 255).astype(np.float32)
    estimate = noise.create("adaptive").estimate(stack)
    assert not estimate.abstained.any()
    assert np.median(estimate.sigma_dn) == pytest.approx(true_dn, rel=0.15)
    assert ((estimate.low_dn <= true_dn) & (true_dn <= estimate.high_dn)).all()
    monkeypatch.setattr(adaptive, "lattice_contrast", lambda pixels: 0.0)
    unknown = noise.create("adaptive").estimate(stack)
    assert np.nansum(unknown.high_dn - unknown.low_dn) != np.nansum(estimate.high_dn - estimate.low_dn)
