"""The regression c1..c8: the paper's coefficients and grids, known surfaces, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import curve_fit

from pipeline.curves.regression import TERMS, design, evaluate, fit, leave_one_out
from pipeline.errors import InputError
from pipeline.streams import stream

PAPER = Path(__file__).resolve().parents[2] / "data" / "paper"
PUBLISHED = [("yolov4", 17.45, 0.9602), ("faster_rcnn", 16.9363, 0.9898)]


def published(detector: str) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Coefficients with their deviations, and the printed grid (42 cells)."""
    numbers = pd.read_csv(PAPER / "regression_coefficients.csv").set_index("parameter")
    grid = pd.read_csv(PAPER / "fitted_ap_grid.csv")
    numbers = numbers[numbers.detector == detector].loc[list(TERMS)]
    return numbers, grid[grid.detector == detector]


def settings() -> tuple[np.ndarray, np.ndarray]:
    iso, exposure = np.meshgrid([100.0, 500, 1000, 1500, 2000, 2500], [1.0, 3, 7, 11, 13, 15, 21])
    return iso.ravel(), exposure.ravel()


@pytest.mark.parametrize("detector", ["yolov4", "faster_rcnn"])
def test_published_coefficients_give_the_published_grid(detector: str) -> None:
    numbers, grid = published(detector)
    assert len(grid) == 42
    difference = evaluate(numbers.value, grid.iso, grid.exposure_ms) - grid.ap_percent
    assert np.abs(difference).max() < 0.07


@pytest.mark.parametrize("detector", ["yolov4", "faster_rcnn"])
def test_the_published_grid_gives_the_published_coefficients(detector: str) -> None:
    """The grid is printed to 0.1 points, so its fit is not exact: measured, at most 0.12 published deviations off."""
    numbers, grid = published(detector)
    estimate = fit(grid.iso, grid.exposure_ms, grid.ap_percent)
    assert estimate.r2 > 0.9999
    assert (np.abs(estimate.value - numbers.value) / numbers.std_dev).max() < 0.2
    assert np.abs(estimate.residual).max() < 0.06


@pytest.mark.parametrize(("detector", "chi2", "r2"), PUBLISHED)
def test_the_published_deviations_follow_from_the_published_chi2(detector: str, chi2: float, r2: float) -> None:
    """Data with the published fit and the published chi2 on the 42 cells: same deviations, same R2."""
    numbers, grid = published(detector)
    rows = design(grid.iso, grid.exposure_ms)
    noise = stream(1, "regression", detector).normal(size=len(grid))
    scale = np.linalg.norm(rows, axis=0)
    noise -= rows / scale @ np.linalg.lstsq(rows / scale, noise, rcond=None)[0]  # leaves the coefficients as they are
    data = evaluate(numbers.value, grid.iso, grid.exposure_ms) + noise * np.sqrt(chi2 / (noise @ noise))
    estimate = fit(grid.iso, grid.exposure_ms, data)
    assert estimate.degrees == 34
    assert estimate.chi2 == pytest.approx(chi2, rel=1e-9)
    np.testing.assert_allclose(estimate.value, numbers.value, rtol=1e-6)
    np.testing.assert_allclose(estimate.std_dev, numbers.std_dev, rtol=2e-4)
    assert estimate.r2 == pytest.approx(r2, abs=3e-4)


def test_equals_another_solver_with_and_without_errors() -> None:
    iso, exposure = settings()
    generator = stream(2, "regression")
    errors = generator.uniform(0.2, 2.0, len(iso))
    data = evaluate([-5e-5, -3e-3, -1.2, 6.6, 17, 980, -290, -2.6], iso, exposure) + errors * generator.normal(
        size=len(iso)
    )

    def model(_: object, *coefficients: float) -> np.ndarray:
        return evaluate(coefficients, iso, exposure)

    for given_errors in (None, errors):
        value, covariance = curve_fit(
            model, None, data, np.ones(8), sigma=given_errors, absolute_sigma=given_errors is not None, xtol=1e-14
        )
        estimate = fit(iso, exposure, data, given_errors)
        np.testing.assert_allclose(estimate.value, value, rtol=1e-4)
        np.testing.assert_allclose(estimate.std_dev, np.sqrt(np.diag(covariance)), rtol=1e-4)


def test_the_share_explained_is_of_the_weighted_scatter_and_its_adjustment_of_the_degrees() -> None:
    """R2 = 1 - chi2 / sum of w (y - weighted mean)^2; a constant alone explains nothing of it."""
    iso, exposure = settings()
    errors = np.where(iso > 1000, 5.0, 0.5)
    data = evaluate([0, -3e-3, -1.2, 6.6, 17, 980, -290, -2.6], iso, exposure)
    data += errors * stream(4, "regression").normal(size=len(iso))
    assert fit(iso, exposure, data, errors, ["c5"]).r2 == pytest.approx(0.0, abs=1e-12)
    whole = fit(iso, exposure, data, errors)
    left, of_mean = whole.chi2 / whole.degrees, fit(iso, exposure, data, errors, ["c5"]).chi2 / (len(iso) - 1)
    assert whole.adjusted_r2 == pytest.approx(1 - left / of_mean)


def test_resamples_that_do_not_scatter_leave_the_errors_that_were_given() -> None:
    """Where all resamples find every object: the least error stands in for what they do not show."""
    iso, exposure = settings()
    data, errors = np.full(len(iso), 100.0), np.full(len(iso), 0.5)
    given_errors = fit(iso, exposure, data, errors)
    resampled = fit(iso, exposure, data, errors, draws_percent=np.full((len(iso), 50), 100.0))
    np.testing.assert_allclose(resampled.std_dev, given_errors.std_dev, rtol=1e-6)


def test_resamples_that_scatter_as_much_as_their_errors_give_the_scatter_of_their_own_fits() -> None:
    """The fit is linear: the fits to the single resamples, with the same weights, are the peer."""
    iso, exposure = settings()
    generator = stream(6, "regression")
    clean = evaluate([-5e-5, -3e-3, -1.2, 6.6, 17, 980, -290, -2.6], iso, exposure)
    draws = clean[:, None] + generator.normal(size=60) + generator.normal(0, 0.5, (len(iso), 60))
    errors = draws.std(axis=1, ddof=1)
    resampled = fit(iso, exposure, clean, errors, draws_percent=draws)
    fits = np.array([fit(iso, exposure, drawn, errors).value for drawn in draws.T])
    np.testing.assert_allclose(resampled.std_dev, fits.std(axis=0, ddof=1), rtol=1e-6)


def test_a_prediction_may_leave_0_to_100_and_its_deviation_does_not_hold_the_misfit() -> None:
    """Average precision that saturates at 100 %, measured nearly without error: the form has no bound."""
    iso, exposure = settings()
    data = np.minimum(evaluate([0, -0.03, -1.5, 0, 140, 0, 0, 0], iso, exposure), 100.0)
    estimate = fit(iso, exposure, data, np.full(len(iso), 0.1))
    value, deviation = estimate.predict(iso, exposure)
    assert data.max() == 100.0 and value.max() > 102.0
    assert np.abs(estimate.residual).max() > 20 * deviation.max()


@given(st.lists(st.floats(-1, 1), min_size=8, max_size=8))
def test_recovers_any_surface_of_its_kind(shares: list[float]) -> None:
    """Coefficients whose terms reach up to 30 points each are found to a billionth of that."""
    iso, exposure = settings()
    largest = np.abs(design(iso, exposure)).max(axis=0)
    truth = 30 * np.array(shares) / largest
    estimate = fit(iso, exposure, evaluate(truth, iso, exposure))
    np.testing.assert_allclose(estimate.value * largest, truth * largest, atol=1e-8)
    precision, deviation = estimate.predict(iso, exposure)
    np.testing.assert_allclose(precision, evaluate(truth, iso, exposure), atol=1e-8)
    assert np.isfinite(deviation).all()


def test_deviations_are_those_of_repeated_measurements() -> None:
    iso, exposure = settings()
    truth = np.array([-5e-5, -3e-3, -1.2, 6.6, 17, 980, -290, -2.6])
    generator = stream(3, "regression")
    clean, errors = evaluate(truth, iso, exposure), np.full(len(iso), 0.7)
    fits = [fit(iso, exposure, clean + generator.normal(0, 0.7, len(iso)), errors) for _ in range(400)]
    pulls = np.array([(item.value - truth) / item.std_dev for item in fits])
    assert np.abs(pulls.mean(axis=0)).max() < 0.2
    assert np.abs(pulls.std(axis=0) - 1).max() < 0.12
    assert np.mean([item.chi2 for item in fits]) == pytest.approx(34, rel=0.05)
    predictions = np.array([item.predict(300.0, 5.0)[0] for item in fits])
    assert predictions.std() == pytest.approx(float(fits[0].predict(300.0, 5.0)[1]), rel=0.15)


def test_a_term_that_matters_is_missed_most() -> None:
    iso, exposure = settings()
    truth = [0, -3e-3, -1.2, 6.6, 17, 0, 0, 0]
    data = evaluate(truth, iso, exposure) + stream(4, "regression").normal(0, 0.1, len(iso))
    rows = leave_one_out(iso, exposure, data)
    assert sorted(row.term for row in rows) == sorted(TERMS)
    by_term = {row.term: row for row in rows}
    assert {row.term for row in rows[:4]} == {"c2", "c3", "c4", "c5"}
    for term in ("c2", "c3", "c4", "c5"):
        assert by_term[term].p_value < 1e-6 and by_term[term].largest_change > 0.1
    assert all(by_term[term].p_value > 1e-4 for term in ("c1", "c6", "c7", "c8"))
    whole = fit(iso, exposure, data)
    assert all(row.chi2 >= whole.chi2 and row.r2 <= whole.r2 for row in rows)
    # F of one term is the square of its coefficient in units of its deviation.
    for term, value, deviation in zip(whole.terms, whole.value, whole.std_dev, strict=True):
        assert by_term[term].f == pytest.approx((value / deviation) ** 2, rel=1e-6)


def test_prediction_does_not_extrapolate() -> None:
    iso, exposure = settings()
    estimate = fit(iso, exposure, evaluate([0, 0, -1, 0, 30, 0, 0, 0], iso, exposure))
    assert estimate.predict([[100.0], [2500.0]], [1.0, 21.0])[0].shape == (2, 2)
    with pytest.raises(InputError, match="iso: 3000 is outside of 100 .. 2500"):
        estimate.predict(3000.0, 5.0)
    with pytest.raises(InputError, match="exposure_ms: 0.5 is outside of 1 .. 21"):
        estimate.predict(100.0, 0.5)
    with pytest.raises(InputError, match="exposure_ms: nan"):
        estimate.predict(100.0, float("nan"))


def test_as_many_values_as_terms_leave_no_deviation() -> None:
    iso, exposure = (values[[0, 8, 15, 20, 26, 33, 40, 37]] for values in settings())
    estimate = fit(iso, exposure, np.arange(8.0))
    assert estimate.degrees == 0 and np.isnan(estimate.std_dev).all() and np.isnan(estimate.adjusted_r2)


def test_bad_input_is_named() -> None:
    iso, exposure = settings()
    data = np.linspace(10, 20, len(iso))
    for arguments, words in (
        ((iso[:7], exposure[:7], data[:7]), "7 values cannot determine 8"),
        ((np.full(42, 100.0), exposure, data), "cannot tell the terms apart"),
        ((iso, exposure, np.where(data > 19, np.nan, data)), "ap_percent: expected 42 finite"),
        ((-iso, exposure, data), "iso: expected positive"),
        ((iso, exposure * 0, data), "exposure_ms: expected positive"),
        ((iso, exposure[:-1], data), "two lists of one length"),
        ((iso, exposure, data, np.zeros(42)), "error_percent: expected 42 positive"),
        ((iso, exposure, data, None, ["c1", "c9"]), "unknown term 'c9'"),
    ):
        with pytest.raises(InputError, match=words):
            fit(*arguments)
    with pytest.raises(InputError, match=r"expected c1 \.\. c8"):
        evaluate([1.0, 2.0], iso, exposure)


def test_without_a_degree_of_freedom_nothing_is_said_of_a_terms_worth():
    iso, exposure = [100, 2500, 500, 1500, 1000, 100, 2500, 2000], [1, 21, 3, 15, 7, 21, 1, 11]
    data = stream(5, "regression").uniform(20, 60, 8)
    rows = leave_one_out(iso, exposure, data)
    assert len(rows) == 8 and all(np.isnan(row.f) and np.isnan(row.p_value) for row in rows)


def test_data_that_are_alike_but_for_rounding_have_no_r2_and_no_term_is_worth_anything() -> None:
    """Of 66.6 % everywhere, weighted, R2 was -2.3, since its mean differs from it in the last digit."""
    iso, exposure = settings()
    errors = np.linspace(1.0, 3.0, len(iso))
    for data in (np.full(len(iso), 66.6), np.full(len(iso), 100 / 3) + 7e-15 * (iso > 1000)):
        whole = fit(iso, exposure, data, errors)
        assert np.isnan([whole.r2, whole.adjusted_r2]).all()
        left = leave_one_out(iso, exposure, data, errors)
        assert np.isnan([row.f for row in left]).all() and np.isnan([row.p_value for row in left]).all()
    with pytest.raises(InputError, match="terms: expected at least one of c1, c2"):
        fit(iso, exposure, data, terms=[])
