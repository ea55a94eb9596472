"""The IOPC surface: bins, bootstrap, interpolation between bounds, and refusal to extrapolate."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.curves.cells import MTF_BINS, SIGMA_BINS_DN, gather, nearest_bin
from pipeline.curves.surface import Surface, build, triangulate
from pipeline.errors import InputError
from pipeline.streams import stream

SIGMA, MTF = (grid.ravel() for grid in np.meshgrid(SIGMA_BINS_DN, MTF_BINS[3:], indexing="ij"))


def plane(sigma_dn: np.ndarray, mtf: np.ndarray) -> np.ndarray:
    return 30 - 0.8 * np.asarray(sigma_dn) + 40 * (np.asarray(mtf) - 0.5)


def scattered(seed: int, per_bin: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Places all over the bins, as estimators report them."""
    generator = stream(seed, "tuples")
    sigma = np.abs(np.repeat(SIGMA, per_bin) + generator.uniform(-2.4, 2.4, len(SIGMA) * per_bin))
    mtf = np.repeat(MTF, per_bin) + generator.uniform(-0.048, 0.048, len(MTF) * per_bin)
    return sigma, mtf


def test_values_belong_to_the_nearest_bin() -> None:
    centres = np.array(SIGMA_BINS_DN)
    np.testing.assert_array_equal(
        nearest_bin([-2.5, -2.6, 0, 2.4, 2.6, 24, 27.5, 27.6, np.nan], centres), [0, -1, 0, 0, 1, 5, 5, -1, -1]
    )


def test_a_bin_is_the_mean_of_its_tuples() -> None:
    cells = gather([4, 6, 5, 40, np.nan], [0.9, 0.9, 0.5, 0.9, 0.9], [50, 30, 20, 10, 10], stream(1, "boot"))
    assert cells.count[1, 8] == 2 and cells.ap_percent[1, 8] == 40 and cells.sigma_dn[1, 8] == 5
    assert cells.count.sum() == 3 and cells.left_out == 2
    low, high = cells.interval()
    assert (low[1, 8], high[1, 8]) == (30, 50)
    assert np.isnan(low[1, 4]) and cells.ap_percent[1, 4] == 20  # one tuple says nothing of its own uncertainty


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_plane_is_recovered_between_scattered_tuples(seed: int) -> None:
    """The knots lie where the tuples lie, so that bins bring no error of their own."""
    sigma, mtf = scattered(seed, per_bin=3)
    surface = build(sigma, mtf, plane(sigma, mtf), stream(seed, "boot"))
    s, m = np.meshgrid(np.linspace(3, 22, 39), np.linspace(0.46, 0.94, 33))
    answer = surface.query(s, m)
    assert (answer.reason == "").all()
    np.testing.assert_allclose(answer.ap_percent, plane(s, m), atol=1e-8)


def test_a_curved_surface_is_recovered_to_the_bins_curvature() -> None:
    def curved(s: np.ndarray, m: np.ndarray) -> np.ndarray:
        return 60 * np.exp(-((s / 20) ** 2)) * m**1.5

    surface = build(SIGMA, MTF, curved(SIGMA, MTF), stream(1, "boot"))
    s, m = np.meshgrid(np.linspace(0, 25, 60), np.linspace(0.4, 1.0, 60))
    error = surface.query(s, m).ap_percent - curved(s, m)
    # Linear interpolation errs by at most h^2 / 8 of the second derivatives: 0.47 + 0.1, and 0.4 across.
    assert np.abs(error).max() < 1.2 and np.sqrt((error**2).mean()) < 0.35


@given(
    st.integers(0, 10_000),
    st.floats(0, 27.5),
    st.floats(0.35, 1.05),
)
def test_answers_lie_between_the_knots_around(seed: int, sigma_dn: float, mtf: float) -> None:
    generator = stream(seed, "bounds")
    sigma, contrast = scattered(seed)
    precision = generator.uniform(0, 100, len(sigma))
    surface = build(sigma, contrast, precision, generator, ap_draws=precision[:, None] + np.zeros((1, 20)))
    value, low, high = surface.at(sigma_dn, mtf)  # every bin is full: nothing may be refused
    near = (np.abs(sigma - sigma_dn) <= 10.0 + 1e-6) & (np.abs(contrast - mtf) <= 0.2 + 1e-6)
    assert precision[near].min() - 1e-6 <= value <= precision[near].max() + 1e-6
    assert low == pytest.approx(value, abs=1e-6) and high == pytest.approx(value, abs=1e-6)


@given(st.integers(0, 10_000))
def test_knots_are_answered_exactly(seed: int) -> None:
    generator = stream(seed, "knots")
    sigma, contrast = scattered(seed)
    precision = generator.uniform(0, 100, len(sigma))
    surface = build(sigma, contrast, precision, generator)
    np.testing.assert_allclose(surface.query(sigma, contrast).ap_percent, precision, atol=1e-5)


@given(st.integers(0, 10_000))
def test_triangles_cover_full_bins_without_overlap(seed: int) -> None:
    """Random places: the area of all triangles is that of the outline through the border knots."""
    sigma, contrast = scattered(seed)
    knots = np.stack([sigma / 5, contrast / 0.1], axis=1)
    full = np.ones((6, 7), dtype=bool)
    triangles = triangulate(full, knots)
    x, y = knots[triangles][..., 0], knots[triangles][..., 1]
    areas = ((x[:, 1] - x[:, 0]) * (y[:, 2] - y[:, 0]) - (x[:, 2] - x[:, 0]) * (y[:, 1] - y[:, 0])) / 2
    number = np.arange(42).reshape(6, 7)
    border = np.concatenate([number[:, 0], number[-1, 1:], number[-2::-1, -1], number[0, -2:0:-1]])
    bx, by = knots[border].T
    outline = 0.5 * np.sum(bx * np.roll(by, -1) - np.roll(bx, -1) * by)
    assert len(triangles) == 60 and (areas > 0).all()
    assert areas.sum() == pytest.approx(outline, rel=1e-9)


def test_nothing_is_extrapolated() -> None:
    surface = build(SIGMA, MTF, plane(SIGMA, MTF), stream(1, "boot"))
    absurd = [(5.0, 1e308), (1.7e308, 1.7e308)]  # infinite in units of bins
    for sigma, mtf in ((28.0, 0.9), (10.0, 0.3), (10.0, 1.06), (np.nan, 0.9), (5.0, np.inf), *absurd):
        with pytest.raises(InputError, match="not extrapolated|finite"), np.errstate(all="raise", under="ignore"):
            surface.at(sigma, mtf)
    answer = surface.query([10.0, 40.0], 0.8)
    assert answer.ap_percent[0] == pytest.approx(34.0) and np.isnan(answer.ap_percent[1])
    assert answer.reason[0] == "" and "nothing was measured there" in answer.reason[1]
    assert surface.at(27.0, 1.04)[0] == pytest.approx(surface.at(25.0, 1.0)[0])  # within the last bin: its border


@pytest.mark.parametrize(("sigma_dn", "mtf"), [(-2.0, 1.05), (-1e-9, 0.9), (5.0, -0.04)])
def test_what_does_not_exist_is_refused_though_its_bin_is_full(sigma_dn: float, mtf: float) -> None:
    """The bins of 0 DN and of an MTF of 0 begin half a bin below their centres; 0 itself is answered."""
    sigma, contrast = (axis.ravel() for axis in np.meshgrid(SIGMA_BINS_DN, [0.0, 0.5, 1.0], indexing="ij"))
    surface = build(sigma, contrast, 80 - sigma, stream(1, "boot"), mtf_bins=[0.0, 0.5, 1.0])
    with pytest.raises(InputError, match="expected numbers of at least 0"):
        surface.at(sigma_dn, mtf)
    answer = surface.query([sigma_dn, 0.0], [mtf, 0.0])
    assert np.isnan([answer.ap_percent[0], answer.low[0]]).all() and "at least 0" in answer.reason[0]
    assert answer.ap_percent[1] == 80.0 and answer.reason[1] == ""


def test_an_empty_bin_is_a_hole() -> None:
    """Noise 10, MTF 0.7 was never measured: refused there, answered around it, and never bridged."""
    kept = ~((SIGMA == 10) & (MTF == 0.7))
    surface = build(SIGMA[kept], MTF[kept], plane(SIGMA[kept], MTF[kept]), stream(1, "boot"))
    with pytest.raises(InputError, match="nothing was measured"):
        surface.at(10.0, 0.7)
    with pytest.raises(InputError, match="nothing was measured"):
        surface.at(10.0, 0.72)
    assert surface.at(10.0, 0.6)[0] == pytest.approx(26.0)
    assert surface.at(6.0, 0.62)[0] == pytest.approx(plane(6.0, 0.62))


def test_one_empty_column_is_bridged_and_two_are_not() -> None:
    """The paper's five sizes of blur leave MTF bins empty."""
    for missing, bridge, answered in (
        ({0.7}, 1, True),
        ({0.7}, 0, False),
        ({0.7, 0.8}, 1, False),
        ({0.7, 0.8}, 2, True),
    ):
        kept = ~np.isin(MTF, list(missing))
        surface = build(SIGMA[kept], MTF[kept], plane(SIGMA[kept], MTF[kept]), stream(1, "boot"), bridge=bridge)
        answer = surface.query(12.0, 0.7)
        assert (answer.reason == "") == answered
        if answered:
            assert answer.ap_percent == pytest.approx(plane(12.0, 0.7))


def test_the_interval_covers_the_truth() -> None:
    """Tuples with a known scatter: the truth lies in about 95 % of the intervals."""
    covered = []
    for seed in range(60):
        generator = stream(seed, "coverage")
        precision = plane(SIGMA, MTF) + generator.normal(0, 2.0, len(SIGMA))
        draws = precision[:, None] + generator.normal(0, 2.0, (len(SIGMA), 300))
        surface = build(SIGMA, MTF, precision, generator, ap_draws=draws)
        for index in ((5.0, 0.6), (12.0, 0.75), (21.0, 0.93)):
            _, low, high = surface.at(*index)
            covered.append(low <= plane(*index) <= high)
    assert 0.89 < np.mean(covered) <= 0.99


def test_cells_that_rise_are_marked() -> None:
    precision = plane(SIGMA, MTF).reshape(6, 7)
    precision[2, 3] += 10  # noise 10, MTF 0.7: better than at noise 5, and than at MTF 0.8
    surface = build(
        SIGMA, MTF, precision.ravel(), stream(1, "boot"), ap_draws=np.repeat(precision.reshape(-1, 1), 9, 1)
    )
    marked = surface.non_monotonic()
    assert list(zip(*np.nonzero(marked), strict=True)) == [(2, 6)]
    np.testing.assert_array_equal(surface.certainly_non_monotonic(), marked)
    for marks in (surface.non_monotonic, surface.certainly_non_monotonic):
        assert marks(tolerance=5.9).any() and not marks(tolerance=6.1).any()
    assert not build(SIGMA, MTF, plane(SIGMA, MTF), stream(1, "boot")).non_monotonic().any()
    unknown = build(SIGMA, MTF, precision.ravel(), stream(1, "boot"))
    assert not unknown.certainly_non_monotonic().any()  # without draws nothing is certain


def test_a_rise_is_certain_only_beyond_what_chance_makes_of_all_comparisons() -> None:
    precision = plane(SIGMA, MTF).reshape(6, 7)
    precision[2, 3] += 10  # a rise of 6 points over noise 5
    scatter = stream(1, "scatter").normal(0, 1, (precision.size, 2000))

    def certainty(sigma_percent: float) -> np.ndarray:
        draws = np.clip(precision.reshape(-1, 1) + sigma_percent / np.sqrt(2) * scatter, 0, 100)
        return build(SIGMA, MTF, precision.ravel(), stream(1, "boot"), ap_draws=draws).certainty()

    # 5 x 7 + 6 x 6 comparisons: z of 3.38 is needed, where 1.96 would do for one.
    assert np.nanmax(certainty(6 / 3.0)) == pytest.approx(3.0 / 3.386, rel=0.06)
    assert np.nanmax(certainty(6 / 3.0)) < 1 < np.nanmax(certainty(6 / 4.0))


@pytest.mark.parametrize(("scenes", "needed"), [(1, np.inf), (4, 16.80), (8, 6.138), (10**7, 3.388)])
def test_few_scenes_ask_for_a_larger_rise(scenes: int, needed: float) -> None:
    """Standard errors needed in 71 comparisons: sqrt(n / (n - 1)) times Student's t, the normal quantile for many."""
    precision = plane(SIGMA, MTF).reshape(6, 7)
    precision[2, 3] += 10
    draws = np.clip(precision.reshape(-1, 1) + stream(1, "scatter").normal(0, 1, (precision.size, 2000)), 0, 100)
    cells = build(SIGMA, MTF, precision.ravel(), stream(1, "boot"), ap_draws=draws).cells
    many, few = Surface(cells).certainty(), Surface(cells, scenes=scenes).certainty()
    assert np.nanmax(few) == pytest.approx(np.nanmax(many) * 3.388 / needed, rel=2e-3)


def test_survives_a_file(tmp_path: Path) -> None:
    sigma, mtf = scattered(4, per_bin=2)
    surface = build(sigma, mtf, plane(sigma, mtf), stream(4, "boot"), draws=50)
    surface.save(tmp_path / "surface.npz")
    again = Surface.load(tmp_path / "surface.npz")
    assert again.at(11.0, 0.77) == surface.at(11.0, 0.77)
    np.savez(tmp_path / "other.npz", a=np.zeros(3))
    with pytest.raises(InputError, match="not a surface"):
        Surface.load(tmp_path / "other.npz")
    with pytest.raises(InputError, match="no such file"):
        Surface.load(tmp_path / "absent.npz")


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("ap_percent", lambda a: a.astype(str), "expected numbers"),
        ("ap_percent", lambda a: a[:-1], "has shape"),
        ("ap_percent", lambda a: np.where(np.isfinite(a), np.inf, a), "not finite"),
        ("ap_percent", lambda a: a + 1000, "out of range"),
        ("sigma_bins_dn", lambda a: a[::-1], "rising"),
        ("sigma_bins_dn", lambda a: a[:, None], "two lists"),
        ("mtf_bins", lambda a: a[:0], "expected"),
        ("draws", lambda a: a[0], "has shape"),
        ("draws", lambda a: np.float64(1.0), "has shape"),
        ("left_out", lambda a: np.zeros(3), "has shape"),
        ("count", lambda a: np.zeros_like(a), "make no surface"),
    ],
)
def test_a_file_with_wrong_arrays_is_refused_in_one_line(tmp_path: Path, name: str, change: Any, words: str) -> None:
    sigma, mtf = scattered(4, per_bin=2)
    path = tmp_path / "surface.npz"
    build(sigma, mtf, plane(sigma, mtf), stream(4, "boot"), draws=50).save(path)
    arrays = dict(np.load(path))
    arrays[name] = change(arrays[name])
    np.savez(path, **arrays)
    with pytest.raises(InputError, match=words) as caught:
        Surface.load(path)
    assert str(path) in str(caught.value) and len(str(caught.value).splitlines()) == 1


def test_a_damaged_archive_is_refused(tmp_path: Path) -> None:
    sigma, mtf = scattered(4, per_bin=2)
    path = tmp_path / "surface.npz"
    build(sigma, mtf, plane(sigma, mtf), stream(4, "boot"), draws=50).save(path)
    whole = path.read_bytes()
    for index in range(0, len(whole), max(1, len(whole) // 60)):
        path.write_bytes(whole[:index] + bytes([whole[index] ^ 0xFF]) + whole[index + 1 :])
        try:
            Surface.load(path)  # a bit that nothing reads may be spoilt
        except InputError as error:
            assert str(path) in str(error)


def test_bad_input_is_named() -> None:
    generator = stream(1, "boot")
    for arguments, words in (
        (([0, 5], [1, 1], [50]), "three lists of one length"),
        (([0], [1], [150]), "0..100"),
        (([300], [0.5], [50]), "no tuple lies in any bin"),
        (([0, 5, 10], [1.0, 1.0, 1.0], [50, 40, 30]), "make no surface"),
        (([0, 25, 25], [1.0, 0.1, 0.5], [50, 40, 30]), "make no surface"),
    ):
        with pytest.raises(InputError, match=words):
            build(*arguments, generator)
    with pytest.raises(InputError, match="ap_draws"):
        build(SIGMA, MTF, plane(SIGMA, MTF), generator, ap_draws=np.zeros((3, 10)))
    with pytest.raises(InputError, match="rising"):
        build(SIGMA, MTF, plane(SIGMA, MTF), generator, mtf_bins=[1.0, 0.5])
    for resamples in ({"draws": 0}, {"ap_draws": np.zeros((len(SIGMA), 0))}):
        with pytest.raises(InputError, match="draws: expected at least one resample"):
            build(SIGMA, MTF, plane(SIGMA, MTF), generator, **resamples)
    with pytest.raises(InputError, match=r"sigma_dn, mtf: expected arrays of one shape, not \(2,\) and \(3,\)"):
        build(SIGMA, MTF, plane(SIGMA, MTF), generator).query([0, 5], [1.0, 0.9, 0.8])
