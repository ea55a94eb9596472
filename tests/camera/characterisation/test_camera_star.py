"""The Siemens star gives back the MTF of a known blur."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from star_makers import synthesise

from pipeline import streams
from pipeline.camera import mtf
from pipeline.camera.blur import blur
from pipeline.camera.characterisation import star
from pipeline.camera.characterisation.star_centre import _vertex, point_of_symmetry
from pipeline.camera.psf import create
from pipeline.errors import InputError

HEIGHT, WIDTH, CENTRE, PERIODS, AMPLITUDE = 768, 896, (447.5, 383.5), 60, 0.35


@pytest.fixture(scope="module")
def points() -> np.ndarray:
    """A star sampled at points: a camera with an MTF of 1."""
    return synthesise(HEIGHT, WIDTH, PERIODS, amplitude=AMPLITUDE)


def test_a_perfect_star_has_full_contrast(points: np.ndarray) -> None:
    assert np.abs(star.measure_mtf(points, CENTRE, PERIODS, amplitude=AMPLITUDE) - 1).max() < 1e-4


@pytest.mark.parametrize(("kind", "size_px"), [("defocus", 3), ("defocus", 7), ("gaussian", 4)])
def test_a_known_blur_is_measured(points: np.ndarray, kind: str, size_px: float) -> None:
    psf = create(kind, size_px)
    result = star.measure_mtf(blur(points, psf), CENTRE, PERIODS, amplitude=AMPLITUDE)
    assert np.abs(result - mtf.sample(psf)).max() < 0.005


@pytest.mark.parametrize(("size_px", "angle_deg"), [(7, 0), (9, 30), (15, 45)])
def test_a_known_motion_is_measured(size_px: float, angle_deg: float) -> None:
    # Many rays: a long streak needs circles that hardly bend along it.
    periods, frequencies = 235, mtf.FREQUENCIES[3:] / 2
    psf = create("linear_motion", size_px, angle_deg)
    image = blur(synthesise(HEIGHT, WIDTH, periods, amplitude=AMPLITUDE), psf)
    for row, direction in enumerate(mtf.DIRECTIONS):
        result = star.measure(image, CENTRE, periods, frequencies, amplitude=AMPLITUDE, direction=direction)
        assert np.abs(result - mtf.curve(psf, 2 * frequencies)[row]).max() < 0.005


def test_the_aperture_of_a_square_pixel_is_measured() -> None:
    image = synthesise(HEIGHT, WIDTH, PERIODS, amplitude=AMPLITUDE, supersample=6)
    # Mean of six points per pixel: sin(6 x) / (6 sin x) with x = pi f / 6, close to sinc(f).
    x = np.pi * mtf.FREQUENCIES / 2 / 6
    expected = np.sin(6 * x) / (6 * np.sin(x))
    result = star.measure_mtf(image, CENTRE, PERIODS, amplitude=AMPLITUDE)
    assert np.abs(result - expected).max() < 0.005


def test_a_fine_blur_before_sampling_is_measured() -> None:
    # A star four times as fine, blurred there by a disc of 20 fine pixels and averaged to pixels.
    fine = synthesise(4 * 480, 4 * 480, 40, amplitude=AMPLITUDE)
    psf = create("defocus", 20)
    image = blur(fine, psf).reshape(480, 4, 480, 4).mean(axis=(1, 3))
    frequencies = np.array([0.05, 0.1, 0.15, 0.2, 0.25])
    x = np.pi * frequencies / 4
    expected = mtf.curve(psf, 2 * frequencies / 4) * np.sin(4 * x) / (4 * np.sin(x))
    for row, direction in enumerate(mtf.DIRECTIONS):
        result = star.measure(image, (239.5, 239.5), 40, frequencies, amplitude=AMPLITUDE, direction=direction)
        assert np.abs(result - expected[row]).max() < 0.005


def test_all_round_is_the_mean_over_directions(points: np.ndarray) -> None:
    psf = create("linear_motion", 5)
    frequencies = mtf.FREQUENCIES[:6] / 2
    result = star.measure(blur(points, psf), CENTRE, PERIODS, frequencies, amplitude=AMPLITUDE)
    x = np.pi * frequencies[:, None] * np.cos(np.linspace(0, 2 * np.pi, 18, endpoint=False) + 1e-6)
    expected = np.abs(np.sin(5 * x) / (5 * np.sin(x))).mean(axis=1)
    assert np.abs(result - expected).max() < 0.01


def test_a_wrong_centre_and_a_shift_cost_little(points: np.ndarray) -> None:
    psf = create("defocus", 5)
    image = np.roll(blur(points, psf), (1, -1), axis=(0, 1))
    result = star.measure_mtf(image, CENTRE, PERIODS, amplitude=AMPLITUDE)
    assert np.abs(result - mtf.sample(psf)).max() < 0.01


def test_noise_averages_out(points: np.ndarray) -> None:
    psf = create("defocus", 5)
    noise = streams.stream(0, "noise").normal(0, 5 / 255, points.shape)
    result = star.measure_mtf(blur(points, psf) + noise, CENTRE, PERIODS, amplitude=AMPLITUDE)
    assert np.abs(result - mtf.sample(psf)).max() < 0.06


@pytest.mark.parametrize("black_and_white", [False, True])
def test_the_standard_error_is_the_spread_between_noisy_pictures(black_and_white: bool) -> None:
    amplitude = 5.0 if black_and_white else 0.3
    clean = blur(np.clip(synthesise(520, 520, 36, amplitude=amplitude), 0.2, 0.8), create("gaussian", 3))
    drawn = streams.stream(0, "star error", black_and_white)
    results = [
        star.measure_mtf_with_error(
            clean + drawn.normal(0, 12 / 255, clean.shape), (259.5, 259.5), 36, amplitude=AMPLITUDE
        )
        for _ in range(16)
    ]
    spread = np.std([contrast for contrast, _ in results], axis=0)
    stated = np.mean([error for _, error in results], axis=0)
    assert np.sqrt(np.mean(spread**2)) == pytest.approx(np.sqrt(np.mean(stated**2)), rel=0.25)


def test_the_standard_error_knows_noise_that_a_camera_has_smoothed() -> None:
    """Taken as independent of its neighbours it was stated as .45 of the spread between pictures."""
    clean = blur(synthesise(520, 520, 36, amplitude=0.3), create("gaussian", 3))
    drawn = streams.stream(0, "star error, smoothed noise")
    results = []
    for _ in range(16):
        grain = cv2.GaussianBlur(drawn.normal(size=clean.shape), (0, 0), 1.0)
        picture = clean + grain * (6 / 255 / grain.std())
        results.append(star.measure_mtf_with_error(picture, (259.5, 259.5), 36, amplitude=AMPLITUDE))
    spread = np.std([contrast for contrast, _ in results], axis=0)
    stated = np.mean([error for _, error in results], axis=0)
    assert 0.55 < np.sqrt(np.mean(stated**2) / np.mean(spread**2)) < 1.1


def test_the_rays_of_a_star_are_counted() -> None:
    image = synthesise(520, 520, 36, supersample=2)
    for expected in (34, 36, 38):
        evidence = star.ray_evidence(image, (259.5, 259.5), expected, np.array([212.0, 159.0, 106.0]))
        assert evidence.explained.min() > 0.99 and evidence.agreement.min() > 0.99
        assert evidence.extra_rays.tolist() == [36 - expected] * 3
        assert evidence.likely_rays == 36 and evidence.likely_explained > 0.99
    evidence = star.ray_evidence(image, (261.5, 257.5), 36, np.array([212.0, 159.0, 106.0]))  # misplaced by 2.8 px
    assert evidence.explained.min() > 0.9 and not evidence.extra_rays.any() and evidence.agreement.min() > 0.9
    evidence = star.ray_evidence(image, (259.5, 259.5), 72, np.array([212.0, 159.0, 106.0]))
    assert evidence.explained.max() < 0.01 and evidence.likely_rays == 36
    flat = star.ray_evidence(np.full((520, 520), 0.5), (259.5, 259.5), 36, np.array([212.0, 159.0]))
    assert flat.explained.tolist() == [0, 0] and flat.agreement.tolist() == [0]


@pytest.mark.parametrize("periods", [24, 36, 40, 53])
def test_stars_of_few_rays_have_sectors_large_enough(periods: int) -> None:
    size_px = 2 * round(star.lowest_circle_px(periods)) + 12
    image = synthesise(size_px, size_px, periods, amplitude=AMPLITUDE)
    centre = ((size_px - 1) / 2,) * 2
    assert np.abs(star.measure_mtf(image, centre, periods, amplitude=AMPLITUDE) - 1).max() < 2e-3
    psf = create("defocus", 3)
    result = star.measure_mtf(blur(image, psf), centre, periods, amplitude=AMPLITUDE)
    assert np.abs(result - mtf.sample(psf)).max() < 0.03


def test_a_direction_needs_room_where_its_sectors_lie() -> None:
    """Contrast along columns is read beside the centre, that along rows above and below it."""
    low = synthesise(140, 400, PERIODS, amplitude=AMPLITUDE)
    for image, centre, direction, other in (
        (low, (199.5, 69.5), "vertical", "horizontal"),
        (low.T, (69.5, 199.5), "horizontal", "vertical"),
    ):
        contrast = star.measure(image, centre, PERIODS, [0.1], amplitude=AMPLITUDE, direction=direction)
        assert contrast == pytest.approx(1, abs=1e-3)
        with pytest.raises(InputError, match="ends after 70 px"):
            star.measure(image, centre, PERIODS, [0.1], amplitude=AMPLITUDE, direction=other)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"frequencies_cycles_per_px": [0.01]}, "the picture ends after"),
        ({"frequencies_cycles_per_px": [0.6]}, "Nyquist"),
        ({"periods": 2}, "periods"),
        ({"amplitude": 0}, "amplitude"),
        ({"direction": "horizontl"}, "did you mean 'horizontal'"),
        ({"periods": 8, "frequencies_cycles_per_px": [0.4]}, "too few to fit"),
        ({"image": np.zeros((9, 9, 3))}, "expected .H, W."),
    ],
)
def test_bad_input_is_named(options: dict, message: str) -> None:
    arguments = {
        "image": np.zeros((200, 200)),
        "centre_px": (99.5, 99.5),
        "periods": 30,
        "frequencies_cycles_per_px": [0.2],
        "amplitude": 0.35,
        **options,
    }
    with pytest.raises(InputError, match=message):
        star.measure(**arguments)


def test_the_centre_is_located_in_complete_pictures_only() -> None:
    centre = (53.3, 47.8)
    picture = synthesise(100, 110, 24, centre_px=centre)
    assert point_of_symmetry(picture) == pytest.approx(centre, abs=0.1)
    picture[3, 4] = np.nan
    with pytest.raises(InputError, match="1 of 11000 values are not finite"):
        point_of_symmetry(picture)
    with pytest.raises(InputError, match="without structure"):
        point_of_symmetry(np.full((50, 50), 0.5))


@pytest.mark.parametrize("vertex", [-0.4, -0.1, 0.0, 0.3])
def test_the_vertex_of_a_parabola_is_exact(vertex: float) -> None:
    assert _vertex(5.0 - 2.0 * (np.arange(-1.0, 2.0) - vertex) ** 2) == pytest.approx(vertex, abs=1e-12)
