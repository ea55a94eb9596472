"""Patterns from pixel to pixel: mosaics and checkerboards are told from noise, edges and gradients."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from skimage import data

from pipeline import noise
from pipeline.condition import ConditionMonitor
from pipeline.noise.traces.alternation import alternating
from pipeline.streams import stream


def grey(sigma_dn: float = 0.0, size_px: int = 128) -> np.ndarray:
    """Squares of 128 px of a photograph with white noise: (N, 128, 128) in [0, 1]."""
    image = data.camera().astype(np.float64)
    image = np.clip(np.rint(image + sigma_dn * stream(1, "alternation", sigma_dn).standard_normal(image.shape)), 0, 255)
    rows = image.reshape(512 // size_px, size_px, 512 // size_px, size_px).swapaxes(1, 2)
    return (rows.reshape(-1, size_px, size_px) / 255).astype(np.float32)


def mosaic(image: np.ndarray) -> np.ndarray:
    """(H, W, 3) RGB as a raw frame, RGGB."""
    raw = image[..., 1].copy()
    raw[::2, ::2], raw[1::2, 1::2] = image[::2, ::2, 0], image[1::2, 1::2, 2]
    return raw


@pytest.mark.parametrize("sigma_dn", [0.0, 2.0, 10.0, 25.0])
def test_pictures_and_noise_do_not_alternate(sigma_dn):
    assert not alternating(grey(sigma_dn)).any()


def test_no_patches_are_none():
    assert alternating(np.empty((0, 128, 128), np.float32)).shape == (0,)


def test_gradients_edges_and_coded_pictures_do_not_alternate():
    ramp = np.linspace(0, 1, 128, dtype=np.float32)
    edge = (np.arange(128) > 63).astype(np.float32)
    stack = np.stack([np.tile(one, (128, 1)) for one in (ramp, edge)] + [np.tile(edge[:, None], (1, 128))])
    assert not alternating(stack).any()
    coded = cv2.imdecode(cv2.imencode(".jpg", data.camera(), [cv2.IMWRITE_JPEG_QUALITY, 60])[1], cv2.IMREAD_GRAYSCALE)
    assert not alternating(coded[None].astype(np.float32) / 255).any()


@pytest.mark.parametrize("pattern", ["columns", "rows", "checkerboard"])
@pytest.mark.parametrize(("amplitude_dn", "seen"), [(2.0, 0.4), (4.0, 0.8), (20.0, 1.0)])
def test_a_pattern_is_seen_in_any_direction_and_under_noise(pattern, amplitude_dn, seen):
    """The weaker, the more it is hidden by fine texture such as grass, to which it then adds little."""
    y, x = np.indices((128, 128))
    sign = {"columns": x, "rows": y, "checkerboard": x + y}[pattern] % 2 * 2 - 1
    shown = np.clip(grey(5.0) + amplitude_dn / 255 * sign, 0, 1).astype(np.float32)
    assert alternating(shown).mean() >= seen


def test_a_raw_frame_of_colours_has_no_noise_level_and_its_developed_one_has():
    image = cv2.GaussianBlur(data.astronaut(), (0, 0), 0.8).astype(np.float64)
    image = np.clip(np.rint(image + 5 * stream(2, "mosaic").standard_normal(image.shape)), 0, 255)
    raw = (mosaic(image) / 255).astype(np.float32)
    monitor = ConditionMonitor()
    strong = np.indices(raw.shape).sum(0)[None, None, :128, :128] % 2 * np.float32(0.8) + np.float32(0.1)
    assert monitor.noise_estimator.estimate(strong.astype(np.float32)).reason.tolist() == ["alternating"]
    read = monitor.frame(raw)
    assert read.abstained["noise"] and read.reasons["noise"]["alternating"] >= 8
    assert float(monitor.frame((image[..., 1] / 255).astype(np.float32)).sigma_dn.value) == pytest.approx(5, abs=1)


def test_noise_beyond_what_the_networks_know_is_not_answered():
    """Random bits: a deviation of 127.5 DN, which no camera's noise has."""
    bits = (stream(3, "bits").random((3, 1, 128, 128)) > 0.5) * np.float32(0.9) + np.float32(0.05)
    answer = noise.create("adaptive").estimate(bits.astype(np.float32))
    assert answer.abstained.all() and set(answer.reason) <= {"beyond", "uncertain", "alternating", "saturated"}
