"""Slanted edge: the MTF of a known blur, both axes, with noise; pictures without such an edge are refused."""

import cv2
import numpy as np
import pytest
from scipy.special import ndtr

from pipeline.camera import psf, tone_curve
from pipeline.camera.blur import blur
from pipeline.camera.characterisation.slanted_edge import measure
from pipeline.camera.mtf import FREQUENCIES, sample
from pipeline.errors import InputError
from pipeline.streams import stream

SUPERSAMPLE = 6


def edge(sigma_px, tilt_deg=5.0, size=(120, 100), upright=True, noise_dn=0.0):
    """A Gaussian-blurred edge, averaged over square pixels: (H, W) in [0, 1]."""
    height, width = size
    fine = (np.arange(max(size) * SUPERSAMPLE) + 0.5) / SUPERSAMPLE - 0.5
    x, y = fine[None, : width * SUPERSAMPLE], fine[: height * SUPERSAMPLE, None]
    turn = np.deg2rad(tilt_deg)
    distance = (x - width / 2) * np.cos(turn) + (y - height / 2) * np.sin(turn)
    wide = cv2.GaussianBlur((distance > 0).astype(np.float64), (0, 0), sigma_px * SUPERSAMPLE)
    image = wide.reshape(height, SUPERSAMPLE, width, SUPERSAMPLE).mean(axis=(1, 3)) * 0.6 + 0.2
    image = image + stream(0, "edge", noise_dn).normal(0, noise_dn / 255, image.shape)
    return image if upright else image.T


JAGGED = (np.arange(120) > stream(0, "jagged").integers(30, 90, 80)[:, None]).astype(np.float64)


def truth(sigma_px):
    cycles = FREQUENCIES / 2
    return np.exp(-2 * (np.pi * sigma_px * cycles) ** 2) * np.sinc(cycles)


def behind(kernel, tilt_deg, side_px=120, border_px=20):
    """An edge behind a kernel, cut from a larger picture."""
    side = side_px + 2 * border_px
    x, y = ((np.arange(side * SUPERSAMPLE) + 0.5) / SUPERSAMPLE - 0.5 - side / 2 for _ in range(2))
    sharp = x[None] + 0.13 > np.tan(np.deg2rad(tilt_deg)) * y[:, None]
    sharp = sharp.reshape(side, SUPERSAMPLE, side, SUPERSAMPLE).mean(axis=(1, 3), dtype=np.float32) * 0.6 + 0.2
    return blur(sharp.astype(np.float32), kernel)[border_px:-border_px, border_px:-border_px].astype(np.float64)


def defocused(diameter_px, tilt_deg, noise_dn=0.0):
    """An edge behind a disc, and the MTF across it."""
    kernel = psf.create("defocus", diameter_px)
    image = behind(kernel, tilt_deg)
    image += stream(0, "defocused edge", diameter_px, tilt_deg, noise_dn).normal(0, noise_dn / 255, image.shape)
    across = FREQUENCIES[:, None, None] / 2 * np.cos(np.deg2rad(tilt_deg))
    along = FREQUENCIES[:, None, None] / 2 * np.sin(np.deg2rad(tilt_deg))
    row, column = np.mgrid[: len(kernel), : len(kernel)]
    waves = np.exp(-2j * np.pi * (across * column - along * row))
    aperture = np.sinc(across) * np.sinc(along)
    return image, np.abs((kernel * waves).sum(axis=(1, 2))) * aperture[:, 0, 0]


@pytest.mark.parametrize("diameter_px", [7, 15, 21])
@pytest.mark.parametrize("tilt_deg", [2.0, 8.0, 14.04, 20.0, 25.0])
def test_wide_discs_keep_their_width(diameter_px, tilt_deg):
    """A Hann window took up to 8 points of MTF; bins about a tilt of 1:4 (14.04 degrees) another 5."""
    image, expected = defocused(diameter_px, tilt_deg)
    result = measure(image)
    assert result.tilt_deg == pytest.approx(tilt_deg, abs=0.02)
    np.testing.assert_allclose(result.mtf, expected, atol=0.01)


@pytest.mark.parametrize(
    ("direction_deg", "errors"), [(0.0, (0.004, 0.015, 0.034, 0.088)), (90.0, (0.042, 0.170, 0.349, 0.742))]
)
def test_the_mtf_of_an_axis_behind_motion_needs_a_small_tilt(direction_deg, errors):
    """What the module and docs/limits.md state of motion of 7 px, across the edge and along it."""
    kernel = psf.create("linear_motion", 7, direction_deg)
    expected = sample(kernel)[0] * np.sinc(FREQUENCIES / 2)
    for tilt_deg, error in zip((5.0, 10.0, 15.0, 25.0), errors, strict=True):
        assert np.abs(measure(behind(kernel, tilt_deg)).mtf - expected).max() == pytest.approx(error, abs=2e-3)


@pytest.mark.parametrize("tilt_deg", [2.0, 8.0, 20.0, 25.0])
def test_noise_does_not_turn_a_wide_edge(tilt_deg):
    """Centroids of absolute differences were drawn to the middle: 20 degrees read 17.6, 2 degrees 0.3."""
    image, _ = defocused(21, tilt_deg, noise_dn=5.0)
    assert measure(image).tilt_deg == pytest.approx(tilt_deg, abs=0.2)
    assert measure(1 - image).tilt_deg == pytest.approx(tilt_deg, abs=0.2)


def test_the_edge_of_little_contrast_is_located_in_noise():
    """23 DN of contrast, 5 DN of noise."""
    image = 0.4 + (edge(0.4, 8.0) - 0.2) * 0.15
    noisy = image + stream(0, "faint edge").normal(0, 5 / 255, image.shape)
    assert measure(noisy).tilt_deg == pytest.approx(8.0, abs=0.5)


@pytest.mark.parametrize("sigma_px", [0.5, 1.0, 2.0])
def test_a_clipped_edge_is_refused_before_its_mtf_is_wrong_by_a_tenth(sigma_px):
    """White of exactly 255 DN gives the MTF; overexposed by a fifth it is up to 0.18 too high."""
    unit = (edge(sigma_px, 8.0) - 0.2) / 0.6

    def stored(low, high):
        return np.rint(np.clip(low + (high - low) * unit, 0, 1) * 255) / 255

    for low, high in ((0.16, 1.0), (0.0, 0.8)):
        np.testing.assert_allclose(measure(stored(low, high)).mtf, truth(sigma_px), atol=0.015)
    for low, high, end in ((0.16, 1.1, "white"), (0.16, 1.4, "white"), (-0.1, 0.8, "black"), (-0.2, 1.2, "black and")):
        with pytest.raises(InputError, match=f"edge: clipped at {end}"):
            measure(stored(low, high))


def test_clipped_overshoot_of_sharpening_is_refused():
    """Less than 1 % of the pixels, but a tenth of the MTF."""
    image = edge(0.5, 8.0)
    sharpened = image + 0.8 * (image - cv2.GaussianBlur(image, (0, 0), 1.5, borderType=cv2.BORDER_REPLICATE))
    lit = np.clip(sharpened + 0.15, 0, 1)
    assert (lit == 1).mean() < 0.02
    with pytest.raises(InputError, match="clipped at white"):
        measure(lit)


def test_sharpening_lifts_the_mtf_above_1():
    image = edge(0.5, 8.0)
    sharpened = image + 0.8 * (image - cv2.GaussianBlur(image, (0, 0), 1.5, borderType=cv2.BORDER_REPLICATE))
    cycles = FREQUENCIES / 2
    gain = 1 + 0.8 * (1 - np.exp(-2 * (np.pi * 1.5 * cycles) ** 2))
    np.testing.assert_allclose(measure(sharpened).mtf, truth(0.5) * gain, atol=0.03)
    assert measure(sharpened).mtf.max() > 1.15


@pytest.mark.parametrize("sigma_px", [0.4, 0.9, 2.0])
@pytest.mark.parametrize("tilt_deg", [-8.0, 3.0, 16.8])
@pytest.mark.parametrize("upright", [True, False])
def test_the_mtf_of_a_known_blur(sigma_px, tilt_deg, upright):
    result = measure(edge(sigma_px, tilt_deg, upright=upright))
    assert result.direction == ("horizontal" if upright else "vertical")
    assert result.tilt_deg == pytest.approx(abs(tilt_deg), abs=0.3)
    assert result.contrast_dn == pytest.approx(0.6 * 255, rel=0.02)
    np.testing.assert_allclose(result.mtf, truth(sigma_px), atol=0.02)


@pytest.mark.parametrize("tilt_deg", [3.0, 8.0])
def test_the_contrast_lost_in_bins_and_differences_is_restored(tilt_deg):
    """Bins of 1/4 px and differences of neighbours take 1.8 % at the highest of the frequencies."""
    sigma_px, turn = 0.5, np.deg2rad(tilt_deg)
    x, y = np.arange(96)[None], np.arange(400)[:, None]
    # values at points, not averaged over pixels: the MTF is that of the Gaussian alone
    picture = 0.2 + 0.6 * ndtr(((x - 48) * np.cos(turn) + (y - 200) * np.sin(turn)) / sigma_px)
    expected = np.exp(-2 * (np.pi * sigma_px * FREQUENCIES / 2) ** 2)
    np.testing.assert_allclose(measure(picture).mtf / expected, 1, atol=0.006)


@pytest.mark.parametrize(("size", "noise_dn"), [((120, 100), 5.0), ((60, 60), 8.0), ((200, 120), 10.0)])
def test_the_standard_error_is_the_spread_between_noisy_pictures(size, noise_dn):
    clean, generator = edge(1.0, size=size), stream(0, "edge error", *size)
    edges = [measure(clean + generator.normal(0, noise_dn / 255, clean.shape)) for _ in range(40)]
    spread = np.std([one.mtf for one in edges], axis=0)
    stated = np.mean([one.error for one in edges], axis=0)
    assert np.sqrt(np.mean(spread**2)) == pytest.approx(np.sqrt(np.mean(stated**2)), rel=0.2)
    assert (spread < 1.5 * stated).all() and (stated < 1.6 * spread).all()
    assert measure(clean).error.max() < 0.005


@pytest.mark.parametrize("smoothed_px", [0.7, 1.5])
def test_the_standard_error_knows_noise_that_a_camera_has_smoothed(smoothed_px):
    """Taken as independent of its neighbours it was stated as .45 and .25 of the spread between pictures."""
    clean, generator = edge(1.0, size=(120, 120)), stream(0, "edge error, smoothed noise")
    grain = [cv2.GaussianBlur(generator.normal(size=clean.shape), (0, 0), smoothed_px) for _ in range(40)]
    edges = [measure(clean + part * (3 / 255 / part.std())) for part in grain]
    spread = np.std([one.mtf for one in edges], axis=0)
    stated = np.sqrt(np.mean([one.error**2 for one in edges], axis=0))
    assert np.sqrt(np.mean(spread**2)) == pytest.approx(np.sqrt(np.mean(stated**2)), rel=0.25)
    assert (spread < 1.5 * stated).all()


def test_light_that_changes_along_the_edge_is_no_error_and_across_it_is_one_of_the_mtf():
    clean = edge(1.0, size=(120, 120))
    ramp = np.linspace(-0.5, 0.5, 120)
    along = measure(clean * (1 + 0.3 * ramp[:, None]))
    assert along.error.max() < 0.01 and np.abs(along.mtf - measure(clean).mtf).max() < 0.005
    across = measure(clean * (1 + 0.1 * ramp[None])).mtf - measure(clean).mtf
    assert -0.03 < across[0] < -0.02 and (across < 0).all()  # it grows towards the bright side; docs/limits.md


@pytest.mark.parametrize(
    ("dark", "bright", "worst"), [(0.02, 0.8, -0.072), (0.05, 0.8, -0.045), (0.1, 0.4, -0.012), (0.2, 0.4, -0.003)]
)
def test_a_tone_curve_lowers_the_mtf_of_an_edge_of_much_contrast(dark, bright, worst):
    """What the module and docs/limits.md state."""
    light = dark + (bright - dark) * (edge(1.0, size=(160, 160)) - 0.2) / 0.6
    error = measure(tone_curve.encode(light, 2.2)).mtf - truth(1.0)
    assert error.min() == pytest.approx(worst, abs=3e-3)
    assert error.max() < 1e-3


def test_noise_costs_little():
    np.testing.assert_allclose(measure(edge(0.9, noise_dn=3.0, size=(240, 120))).mtf, truth(0.9), atol=0.05)


@pytest.mark.parametrize(
    ("image", "word"),
    [
        (np.full((60, 60), 0.5), "differ by 0 DN"),
        (edge(0.8, 0.0), "tilted by"),
        (edge(0.8)[:10], "shape"),
        (JAGGED, "line"),
        (np.where(np.arange(100) == 7, np.nan, edge(0.8)), "120 of 12000 values are not finite"),
    ],
)
def test_pictures_without_a_slanted_edge_are_refused(image, word):
    with pytest.raises(InputError, match=word):
        measure(image)


@pytest.mark.shared
def test_the_reference_edge_of_known_width(shared):
    """A Gaussian line spread, 2.101 px wide at half maximum along the rows, less by the tilt's cosine across."""
    from pipeline.datasets.decoding.pictures import read_grey

    file = shared / "realdata/mtf_charts/myedge_angle_16.776550_fwhm_2.101313.tif"
    if not file.is_file():
        pytest.skip("chart absent: ../shared/realdata/mtf_charts")
    image = read_grey(file)
    result = measure(image)
    assert result.tilt_deg == pytest.approx(16.77655, abs=0.1)
    sigma = 2.101313 / (2 * np.sqrt(2 * np.log(2))) * np.cos(np.deg2rad(16.77655))
    np.testing.assert_allclose(result.mtf, np.exp(-2 * (np.pi * sigma * FREQUENCIES / 2) ** 2), atol=0.02)
