"""Siemens star: the dataset's measured MTF is the one it states."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.scenes import lens
from pipeline.scenes.star import render_star, star_geometry

SIZE = {"width_px": 448, "height_px": 384}


def contrast(image: np.ndarray, geometry, model: np.ndarray | None, frequency: float) -> float:
    """Modulation on a circle by least squares, of the image or of a model of it on the same pixels."""
    rows, columns = np.mgrid[: image.shape[0], : image.shape[1]]
    x, y = columns + 0.5 - geometry.centre_px[0], rows + 0.5 - geometry.centre_px[1]
    radius, angle = np.hypot(x, y), np.arctan2(y, x)
    ring = np.abs(radius - geometry.periods / (2 * np.pi * frequency)) < 0.7
    phase = geometry.periods * angle[ring]
    waves = np.stack([np.sin(phase), np.cos(phase), np.ones_like(phase)], axis=1)
    values = image[ring] if model is None else model[ring] * waves[:, 0]
    fit = np.linalg.lstsq(waves, values, rcond=None)[0]
    return float(np.hypot(fit[0], fit[1]))


def predicted(image: np.ndarray, geometry, samples: int, sigma: float) -> np.ndarray:
    """Transfer at each pixel's own frequency: tangential, periods / (2 pi r)."""
    rows, columns = np.mgrid[: image.shape[0], : image.shape[1]]
    x, y = columns + 0.5 - geometry.centre_px[0], rows + 0.5 - geometry.centre_px[1]
    radius, angle = np.hypot(x, y), np.arctan2(y, x)
    f = geometry.periods / (2 * np.pi * np.maximum(radius, 1e-6))
    return lens.transfer(f * np.sin(angle), samples, sigma) * lens.transfer(f * np.cos(angle), samples, sigma)


@pytest.mark.parametrize(("samples", "sigma"), [(1, 0.0), (2, 0.0), (3, 0.55), (2, 0.55), (1, 0.55)])
def test_star_has_the_stated_mtf(samples, sigma):
    image = render_star(samples, lens_sigma_px=sigma, periods=48, **SIZE)
    geometry = star_geometry(**SIZE, periods=48)
    model = predicted(image, geometry, samples, sigma)
    for frequency in (0.06, 0.1, 0.2, 0.3, 0.4, 0.5):
        measured = contrast(image, geometry, None, frequency) / geometry.amplitude
        assert measured == pytest.approx(contrast(image, geometry, model, frequency), abs=0.003)


def test_the_star_is_where_its_geometry_says():
    image = render_star(2, **SIZE)
    geometry = star_geometry(**SIZE)
    assert image.shape == (384, 448) and image.dtype == np.float32
    assert image.mean() == pytest.approx(geometry.mean, abs=0.002)
    # sine is odd about the centre in both directions
    assert np.allclose(image + image[::-1], 2 * geometry.mean, atol=2e-3)
    outside = image[:, :5]
    assert np.allclose(outside, geometry.mean, atol=1e-5)


def test_the_measurement_of_floor_one_finds_the_stated_mtf():
    """By an independent method, per direction, at the paper's eight frequencies: within 0.005."""
    from pipeline.camera import mtf
    from pipeline.camera.characterisation import star

    image = render_star(3)
    geometry = star_geometry()
    centre = geometry.centre_px[0] - 0.5, geometry.centre_px[1] - 0.5  # from pixel edges to pixel middles
    measured = star.measure_mtf(image, centre, geometry.periods, amplitude=geometry.amplitude)
    assert measured == pytest.approx(lens.true_mtf(mtf.FREQUENCIES / 2, 3), abs=0.005)
