"""Point-spread functions: centred, unit sum, the right width and direction, reproducible."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline import streams
from pipeline.camera import mtf
from pipeline.camera.psf import (
    bank,
    centroid_px,
    create,
    defocus,
    gaussian,
    kernel,
    kinds,
    linear_motion,
    nonlinear_motion,
    raster,
    wave_optics,
)
from pipeline.errors import InputError

SIZES = st.floats(0.0, 25.0)
ANGLES = st.floats(-360.0, 360.0)


def assert_is_psf(psf: np.ndarray) -> None:
    """Float32, odd square, non-negative, unit sum, centred."""
    assert psf.dtype == np.float32
    assert psf.shape[0] == psf.shape[1] and psf.shape[0] % 2 == 1
    assert psf.min() >= 0
    assert psf.sum(dtype=np.float64) == pytest.approx(1, abs=1e-6)
    assert max(abs(offset) for offset in centroid_px(psf)) < 0.05


def covariance(psf: np.ndarray) -> np.ndarray:
    """(2, 2) second central moments, x right and y up, pixels squared."""
    rows, columns = np.indices(psf.shape)
    points = np.stack([columns.ravel(), -rows.ravel()])
    return np.cov(points, aweights=psf.ravel().astype(np.float64), ddof=0)


@given(kind=st.sampled_from(kinds()), size_px=SIZES, angle_deg=ANGLES, seed=st.integers(0, 10**6))
def test_every_psf_is_centred_and_of_unit_sum(kind: str, size_px: float, angle_deg: float, seed: int) -> None:
    psf = create(kind, size_px, angle_deg, streams.stream(seed, "psf"))
    assert_is_psf(psf)
    assert np.allclose(mtf.curve(psf, [0.0]), 1)


@pytest.mark.parametrize("kind", ["defocus", "linear_motion", "nonlinear_motion"])
@pytest.mark.parametrize("size_px", [0, 0.5, 1])
def test_at_most_one_pixel_is_no_blur(kind: str, size_px: float) -> None:
    assert create(kind, size_px, 30, streams.stream(0, "psf")).tolist() == [[1.0]]
    if kind == "defocus":  # of motion the paper has no such kernels
        assert bank([kind], [size_px], match="paper")[0].psf.tolist() == [[1.0]]


@given(diameter_px=st.floats(3.0, 30.0))
def test_disc_covers_its_area_and_has_the_moments_of_a_disc(diameter_px: float) -> None:
    psf = defocus.disc(diameter_px).astype(np.float64)
    # Fully covered pixels all hold 1 / area.
    assert 1 / psf.max() == pytest.approx(np.pi * diameter_px**2 / 4, rel=1e-5)
    # r^2 / 4 for the disc; its sampling by square pixels adds about 1 / 12, less where their edges coincide.
    assert np.diag(covariance(psf)) == pytest.approx(diameter_px**2 / 16 + 1 / 12, abs=0.02 + 0.2 / diameter_px)
    assert np.allclose(psf, psf.T, atol=1e-8) and np.allclose(psf, psf[::-1], atol=1e-8)


def test_disc_agrees_with_brute_force() -> None:
    for diameter_px in (2.0, 3.0, 7.4, 11.0):
        psf = defocus.disc(diameter_px)
        side = len(psf)
        points = (np.arange(side * 200) + 0.5) / 200 - side / 2
        inside = points[:, None] ** 2 + points[None, :] ** 2 <= diameter_px**2 / 4
        counted = inside.reshape(side, 200, side, 200).mean(axis=(1, 3))
        assert np.abs(psf - counted / counted.sum()).max() < 2e-4 / diameter_px


@pytest.mark.parametrize("diameter_px", [3.0, 7.0, 12.07, 21.0])
def test_disc_has_the_mtf_of_a_disc_seen_through_pixels(diameter_px: float) -> None:
    frequencies = np.linspace(0, 0.6, 20)
    expected = mtf.disc(diameter_px, frequencies) * np.sinc(frequencies / 2)
    assert np.abs(mtf.curve(defocus.disc(diameter_px), frequencies) - expected).max() < 0.02


def test_disc_grows_continuously() -> None:
    samples = np.stack([mtf.sample(defocus.disc(d)) for d in np.arange(1.0, 25.0, 0.01)])
    assert np.abs(np.diff(samples, axis=0)).max() < 0.02


def test_nominal_disc_of_odd_size_fits_its_array() -> None:
    for size_px in (3, 7, 11, 15, 21):
        assert create("defocus", size_px).shape == (size_px, size_px)


def test_authors_disc_is_wider_and_off_centre() -> None:
    wanted = {3: 3.89, 7: 8.23, 11: 12.07, 15: 15.94, 21: 22.08}
    for size_px, diameter_px in wanted.items():
        assert defocus.effective_diameter_px(size_px) == pytest.approx(diameter_px, abs=0.02)
        psf = create("defocus", size_px, camera="authors")
        assert psf.shape == (33, 33)
        assert centroid_px(psf) == pytest.approx((0.5, 0.5), abs=0.2)
        centred = create("defocus", size_px, diameter="effective")
        assert_is_psf(centred)
        assert 1 / centred.max() == pytest.approx(np.pi * diameter_px**2 / 4, rel=0.01)


def test_authors_disc_size_is_made_odd_upwards() -> None:
    assert np.array_equal(defocus.authors_disc(6), defocus.authors_disc(7))
    assert np.array_equal(defocus.authors_disc(7.9), defocus.authors_disc(7))


def test_straight_motion_along_an_axis_is_a_row_of_equal_weights() -> None:
    for size_px in (3, 7, 11, 15, 21):
        psf = create("linear_motion", size_px)
        row = psf[size_px // 2]
        assert np.allclose(row, 1 / size_px, atol=1e-7)
        assert psf.sum() == pytest.approx(row.sum())


@given(length_px=st.floats(3.0, 25.0), angle_deg=st.floats(0.0, 180.0))
def test_straight_motion_has_its_direction_and_length(length_px: float, angle_deg: float) -> None:
    values, vectors = np.linalg.eigh(covariance(linear_motion.segment(length_px, angle_deg)))
    # Long axis: L^2 / 12 of the line, short axis 1 / 12 of its width; the pixels add up to 1 / 6, and take 1 / 12
    # where edges coincide (equal weights on L pixels have a variance of (L^2 - 1) / 12). Nearly along an axis two end
    # pixels of a long line may add up to 0.22.
    assert values[1] == pytest.approx(length_px**2 / 12, abs=0.25)
    assert values[0] == pytest.approx(1 / 12, abs=0.12)
    result = np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1]))
    drawn_off = np.degrees(0.05 / (values[1] - values[0]))  # pixels turn the axes of short lines by their own moments
    assert abs((result - angle_deg + 90) % 180 - 90) < max(0.6, drawn_off)


def test_rotation_is_counter_clockwise() -> None:
    psf = create("linear_motion", 11, 45)
    assert psf[0, -1] > 0 and psf[0, 0] == 0, "45 degrees runs from bottom left to top right"


@pytest.mark.parametrize("kind", ["linear_motion", "nonlinear_motion"])
@given(size_px=st.floats(2.0, 22.0), angle_deg=st.floats(0.0, 89.0), turns=st.integers(1, 3), seed=st.integers(0, 999))
def test_quarter_turns_are_exact(kind: str, size_px: float, angle_deg: float, turns: int, seed: int) -> None:
    first = create(kind, size_px, angle_deg, streams.stream(seed, "psf"))
    turned = create(kind, size_px, angle_deg + 90 * turns, streams.stream(seed, "psf"))
    assert np.allclose(turned, np.rot90(first, turns), atol=1e-6)


@given(size_px=st.floats(3.0, 25.0), seed=st.integers(0, 10**6))
def test_bent_motion_fits_its_bounding_box(size_px: float, seed: int) -> None:
    psf = create("nonlinear_motion", size_px, 0, streams.stream(seed, "psf"))
    lit = psf > 1e-6
    spans = [np.ptp(np.flatnonzero(lit.any(axis=axis))) + 1 for axis in (0, 1)]
    # A box of real side s touches at most ceil(s) + 1 rows of pixels, at least floor(s).
    assert np.floor(size_px) <= max(spans) <= np.ceil(size_px) + 1


def test_bent_motion_without_intensity_is_straight() -> None:
    psf = create("nonlinear_motion", 15, 0, streams.stream(3, "psf"), intensity=0)
    assert np.linalg.eigvalsh(covariance(psf))[0] < 0.2
    bent = [create("nonlinear_motion", 15, 0, streams.stream(seed, "psf")) for seed in range(20)]
    assert np.median([np.linalg.eigvalsh(covariance(one))[0] for one in bent]) > 1


def test_bent_motion_takes_every_direction() -> None:
    angles = []
    for seed in range(300):
        vectors = np.linalg.eigh(covariance(create("nonlinear_motion", 15, 0, streams.stream(seed, "psf"))))[1]
        angles.append(2 * np.arctan2(vectors[1, 1], vectors[0, 1]))
    # Doubled angles of undirected lines: a uniform distribution has a mean vector of about 1 / sqrt(300).
    assert abs(np.mean(np.exp(1j * np.array(angles)))) < 3.5 / np.sqrt(300)


def test_strength_of_bent_motion_resembles_the_papers() -> None:
    from pipeline.camera.psf.nonlinear_motion import PAPER_MTF

    for size_px, wanted in PAPER_MTF.items():
        kernels = [k.psf for seed in range(12) for k in bank(["nonlinear_motion"], [size_px], seed=seed)]
        assert 100 * np.abs(np.mean([mtf.sample(psf) for psf in kernels], axis=(0, 1)) - wanted).mean() < 9
        nearest = [k.psf for k in bank(["nonlinear_motion"], [size_px], match="paper")]
        assert 100 * np.abs(np.mean([mtf.sample(psf) for psf in nearest], axis=(0, 1)) - wanted).mean() < 4


def test_gaussian_has_its_width() -> None:
    psf = create("gaussian", 7)
    sigma_px = 7 / 2.354820
    assert np.diag(covariance(psf)) == pytest.approx(sigma_px**2 + 1 / 12, rel=0.01)
    frequencies = np.linspace(0, 0.6, 13)
    expected = mtf.gaussian(sigma_px, frequencies) * np.sinc(frequencies / 2)
    assert np.abs(mtf.curve(psf, frequencies) - expected).max() < 2e-3
    assert np.allclose(mtf.curve(gaussian.gaussian(0.0), frequencies), 1)


def test_bent_motion_is_smooth_over_its_correlation_length() -> None:
    """The logarithm of light per length has an autocorrelation of exp(-lag^2 / (4 w^2)), a variance of b^2."""
    width, dwell, steps = 0.05, 0.4, 1024
    shape = {"intensity": 1.0, "bend": 0.4, "smoothness": width, "dwell": dwell}
    logs = np.stack([np.log(nonlinear_motion.walk(streams.stream(n, "walk"), **shape)[1]) for n in range(400)]) / dwell
    assert logs.var() == pytest.approx(1, abs=0.1)
    for lag in (width, 2 * width, 3 * width):
        shift = round(lag * steps)
        correlation = (logs[:, shift:] * logs[:, :-shift]).mean()
        assert correlation == pytest.approx(np.exp(-(lag**2) / (4 * width**2)), abs=0.1)


@pytest.mark.parametrize("name", ["astigmatism", "coma", "spherical"])
def test_aberrations_of_one_wave_have_one_wave_rms_over_the_pupil(name: str) -> None:
    step = np.linspace(-1, 1, 801)
    x, y = step[None, :], step[:, None]
    error_um = wave_optics.wavefront_um(wave_optics.Lens(4.0, **{name: 1.0}), 0.0, x, y)[x**2 + y**2 <= 1]
    assert error_um.std() == pytest.approx(0.55, rel=5e-3)
    assert error_um.mean() == pytest.approx(0.0, abs=5e-3)


def test_splat_keeps_light_and_centroid() -> None:
    rng = streams.stream(1, "points")
    x, y, weights = rng.normal(0, 4, 500), rng.normal(0, 4, 500), rng.random(500)
    image = raster.splat(x, y, weights)
    right, down = centroid_px(image)
    assert image.sum() == pytest.approx(weights.sum())
    assert (right, -down) == pytest.approx((np.average(x, weights=weights), np.average(y, weights=weights)))


def test_bank_is_the_papers_table() -> None:
    kernels = bank(seed=5)
    assert len(kernels) == 45 and len({k.name for k in kernels}) == 45
    assert [k.name for k in kernels[:6]] == [f"defocus_{n}" for n in (3, 7, 11, 15, 21)] + ["linear_motion_3_0"]
    for one in kernels:
        assert_is_psf(one.psf)


@pytest.mark.parametrize("match", ["nominal", "paper"])
def test_bank_does_not_depend_on_what_else_is_in_it(match: str) -> None:
    whole = {k.name: k.psf for k in bank(sizes_px=[7, 21], angles_deg=[0, 135], seed=5, match=match)}
    for one in bank(["nonlinear_motion", "defocus"], [21, 7], [135], seed=5, match=match):
        assert np.array_equal(one.psf, whole[one.name])
    other = {k.name: k.psf for k in bank(["nonlinear_motion"], [21], [0], seed=6, match=match)}
    assert not np.array_equal(other["nonlinear_motion_21_0"], whole["nonlinear_motion_21_0"])


def test_bank_draws_one_motion_for_all_rotations() -> None:
    results = {k.angle_deg: k.psf for k in bank(["nonlinear_motion"], [15], seed=2)}
    assert np.allclose(results[90], np.rot90(results[0]), atol=1e-7)
    assert np.allclose(results[135], np.rot90(results[45]), atol=1e-7)


@pytest.mark.shared
def test_paper_match_is_close_to_the_papers_kernels(shared) -> None:  # type: ignore[no-untyped-def]
    from pipeline.camera.psf import paper_kernels

    truth = {k.name: mtf.sample(k.psf) for k in paper_kernels.load(shared / "vectors/kernels")}
    limits = {"defocus": 6.5, "linear_motion": 2.5}
    for kind, limit in limits.items():
        for size_px in (3, 7, 11, 15, 21):
            ours = bank([kind], [size_px], match="paper")
            assert np.mean([mtf.amae(mtf.sample(k.psf), truth[k.name]) for k in ours]) < limit
    for one in bank(["defocus"], camera="authors"):
        assert mtf.amae(mtf.sample(one.psf), truth[one.name]) < 0.2


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: create("defocuss", 3), "did you mean 'defocus'"),
        (lambda: create("defocus", -1), "size_px of 'defocus' is -1"),
        (lambda: create("defocus", float("nan")), "finite"),
        (lambda: create("defocus", 3, camera="author"), "did you mean 'authors'"),
        (lambda: create("defocus", 3, diameter="real"), "unknown diameter rule"),
        (lambda: create("defocus", 31, camera="authors"), "canvas_px"),
        (lambda: create("defocus", 3, colour="red"), "colour"),
        (lambda: create("linear_motion", 3, float("inf")), "angle_deg"),
        (lambda: create("linear_motion", 3, width_px=0), "width_px"),
        (lambda: create("linear_motion", 9, match="paper"), "it has 3, 7, 11, 13, 15, 21"),
        (lambda: create("linear_motion", 9, match="best"), "unknown match"),
        (lambda: create("nonlinear_motion", 9), "generator"),
        (lambda: create("nonlinear_motion", 9, 0, streams.stream(0, "x"), intensity=2), "intensity"),
        (lambda: create("nonlinear_motion", 9, 0, streams.stream(0, "x"), match="paper"), "size of the paper"),
        (lambda: create("nonlinear_motion", 9, 0, streams.stream(0, "x"), match="best"), "unknown match"),
        (lambda: bank(match="papers"), "did you mean 'paper'"),
    ],
)
def test_bad_input_is_named(call, message: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(InputError, match=message):
        call()


def test_recentred_moves_by_whole_pixels() -> None:
    psf = np.zeros((7, 7), np.float32)
    psf[1, 5] = 1
    moved = kernel.recentred(psf)
    assert centroid_px(moved) == (0, 0) and moved.sum() == 1
    assert np.allclose(mtf.sample(moved), mtf.sample(psf))
    assert kernel.trimmed(moved).tolist() == [[1.0]]
