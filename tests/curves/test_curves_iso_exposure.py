"""Regression on a sweep's numbers, its calibration, and the published fits beside ours."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from pipeline.config.schema import validate
from pipeline.curves import evaluate, iso_exposure
from pipeline.curves.calibration import motion_mtf
from pipeline.errors import InputError
from pipeline.experiments.tables import CONDITIONS
from pipeline.stages import refit
from pipeline.streams import stream

ROOT = Path(__file__).resolve().parents[2]
SECTION = SimpleNamespace(sigma_per_iso=0.01, px_per_ms=1.0, least_error_percent=2.0)
TERMS = [f"c{number}" for number in range(1, 9)]
TRUE = np.array([1e-4, -0.01, -1.5, 3.0, 70.0, 200.0, -100.0, 5.0])


def measured_grid() -> tuple[pd.DataFrame, np.ndarray]:
    """Average precision of two directions, 3 points apart about a known regression."""
    rows = []
    for level in (0.0, 5.0, 15.0, 25.0):
        for size in (0.0, 3.0, 7.0, 11.0, 15.0, 21.0):
            mean = evaluate(TRUE, [max(level, 1) / 0.01], [max(size, 1)])[0]
            for angle in (0.0, 90.0) if size else (0.0,):
                shift = 0.0 if not size else 1.5 if angle else -1.5
                rows.append(
                    {"target_sigma_dn": level, "kernel_size_px": size, "angle_deg": angle, "ap_percent": mean + shift}
                )
    table = pd.DataFrame(rows)
    return table, table["ap_percent"].to_numpy()[:, None] + np.linspace(-2, 2, 50)[None]


def test_a_known_regression_is_found_again_from_the_mean_over_directions() -> None:
    table, draws = measured_grid()
    data, _ = iso_exposure.cells(table, draws, SECTION)
    assert len(data) == 24 and data["iso"].min() == 100 and data["exposure_ms"].min() == 1
    coefficients, fitted, about = iso_exposure.tables("car", data, TERMS)
    np.testing.assert_allclose(coefficients["value"], TRUE, rtol=1e-6)
    assert about["r2"] == pytest.approx(1.0) and about["cells"] == 24 and about["weighted"]
    cells = fitted[fitted["ap_percent"].notna()]
    assert len(cells) == 24 and np.abs(cells["residual"]).max() < 1e-6
    grid = fitted[fitted["ap_percent"].isna()]
    assert len(grid) == iso_exposure.GRID_POINTS**2
    expected = evaluate(TRUE, grid["iso"], grid["exposure_ms"])
    np.testing.assert_allclose(grid["fitted_percent"], expected, atol=1e-6)


@pytest.mark.parametrize("percent", [0.0, 33.333, 97.3])
def test_no_term_is_worth_anything_where_all_cells_are_alike(percent: float) -> None:
    """As of a class that is never detected: R2 and F of what rounding leaves would be of any size."""
    table, draws = measured_grid()
    data, _ = iso_exposure.cells(table.assign(ap_percent=percent), draws, SECTION)
    errors = 2.0 + stream(1, "alike").random(len(data))
    coefficients, _, about = iso_exposure.tables("car", data.assign(error_percent=errors), TERMS)
    for name in ("f", "p_value", "r2_without", "largest_change"):
        assert coefficients[name].isna().all()
    assert np.isnan([about["r2"], about["adjusted_r2"]]).all() and about["largest_residual"] < 1e-9
    assert iso_exposure.metrics({"car": about})["car"]["r2"] == 0.0


def test_the_error_of_a_cell_is_its_bootstraps_and_never_none() -> None:
    table, draws = measured_grid()
    data, _ = iso_exposure.cells(table, draws * 0 + 50, SECTION)
    assert (data["error_percent"] == 2.0).all()
    wide, _ = iso_exposure.cells(table, 50 + 10 * (draws - draws.mean(axis=1, keepdims=True)), SECTION)
    assert wide["error_percent"].to_numpy() == pytest.approx(10 * np.linspace(-2, 2, 50).std(ddof=1))


def test_errors_that_cells_share_move_the_constant_only() -> None:
    """All cells of a resample are shifted alike, by a standard deviation of 1.18 points: so is c5, and no slope."""
    table, draws = measured_grid()
    data, together = iso_exposure.cells(table, draws, SECTION)
    data = data.assign(error_percent=0.5)  # less than they scatter
    assert together.shape == (24, 50)
    coefficients, fitted, _ = iso_exposure.tables("car", data, TERMS, together)
    deviation = dict(zip(coefficients["term"], coefficients["std_dev"], strict=True))
    shift = np.linspace(-2, 2, 50).std(ddof=1)
    assert deviation.pop("c5") == pytest.approx(shift)
    assert max(deviation.values()) < 1e-6
    assert fitted["fitted_std_dev"].to_numpy() == pytest.approx(shift)
    together[0, 3] = np.nan  # a resample that lacks a value
    again, _, _ = iso_exposure.tables("car", data, TERMS, together)
    assert again["std_dev"].iloc[4] == pytest.approx(np.delete(np.linspace(-2, 2, 50), 3).std(ddof=1))


def test_cells_that_err_apart_have_the_deviations_of_independent_errors() -> None:
    table, _ = measured_grid()
    apart = table["ap_percent"].to_numpy()[:, None] + stream(1, "apart").normal(0, 3, (len(table), 4000))
    data, together = iso_exposure.cells(table, apart, SECTION)
    given, taken = (iso_exposure.tables("car", data, TERMS, draws)[0]["std_dev"] for draws in (together, None))
    assert given.to_numpy() == pytest.approx(taken.to_numpy(), rel=0.1)


def test_the_term_that_matters_is_the_one_that_is_missed() -> None:
    table, draws = measured_grid()
    coefficients, _, _ = iso_exposure.tables("car", iso_exposure.cells(table, draws, SECTION)[0], TERMS)
    assert coefficients.loc[coefficients["f"].idxmax(), "term"] in ("c2", "c5")  # linear in ISO, and the level
    assert (coefficients["r2_without"] < 1).all()


def test_cells_without_a_value_are_left_out_and_too_few_are_refused() -> None:
    table, draws = measured_grid()
    table["ap_percent"] = np.nan
    data, _ = iso_exposure.cells(table, draws, SECTION)
    assert data.empty
    with pytest.raises(InputError):
        iso_exposure.tables("car", data, TERMS)


LENS_MTF = 0.97


def conditions(gain: float, stretch: float, angles: tuple[float, ...] = (0.0, 45.0, 90.0, 135.0)) -> pd.DataFrame:
    rows = []
    for level in (0.0, 5.0, 25.0):
        rows.append(
            {
                "blur_kind": "sharp",
                "kernel_size_px": 0.0,
                "angle_deg": 0.0,
                "target_sigma_dn": level,
                "sigma_dn": gain * level,
                "mtf": LENS_MTF if level == 0.0 else np.nan,
            }
        )
    for size in (3.0, 7.0, 15.0):
        for angle in angles:
            mtf = LENS_MTF * motion_mtf(stretch * size)
            row = {
                "blur_kind": "linear_motion",
                "kernel_size_px": size,
                "angle_deg": angle,
                "target_sigma_dn": 0.0,
                "mtf": mtf,
            }
            rows.append({"sigma_dn": 0.0, **row})
    table = pd.DataFrame(rows).assign(kernel="k", noise_source="dcsn")
    return CONDITIONS.conform(table.reindex(columns=list(CONDITIONS.columns)).fillna({"tiles": 0, "patches": 0,
        "tiles_abstained": 0, "patches_abstained": 0}))  # fmt: skip


def test_calibration_finds_the_gain_and_the_speed() -> None:
    result = iso_exposure.calibration(conditions(1.1, 1.2), SECTION)
    assert result["lambda1"] == pytest.approx(0.011) and result["lambda2"] == pytest.approx(1.2, rel=1e-3)
    assert result["lambda1_nominal"] == 0.01


def test_calibration_says_why_it_has_none() -> None:
    """The formula is a mean over four rotations; two of them would give another length."""
    assert "expected two lists" in iso_exposure.calibration(conditions(1.0, 1.0, (0.0, 90.0)), SECTION)["reason"]


def test_without_the_lens_alone_the_motion_is_not_known() -> None:
    table = conditions(1.0, 1.0)
    result = iso_exposure.calibration(table[table["kernel_size_px"] > 0], SECTION)
    assert "the lens's" in result["reason"] and "lambda2" not in result


def test_the_stage_gives_the_papers_grids_and_coefficients_back(tmp_path: Path) -> None:
    import yaml

    config = validate(yaml.safe_load((ROOT / "params.yaml").read_text()))
    refit.run.run(config, {}, ROOT, tmp_path)
    numbers = yaml.safe_load((tmp_path / "reports/metrics/refit.json").read_text())
    assert set(numbers) == {"yolov4 car", "faster_rcnn pedestrian"}
    for item in numbers.values():
        assert item["cells"] == 42 and item["largest_miss_of_grid"] < 0.07
        assert item["r2"] > 0.9999 and item["largest_miss_in_std_devs"] < 1
    ours = pd.read_csv(tmp_path / "data/refit/regression_coefficients.csv").set_index(["detector", "parameter"])
    printed = pd.read_csv(ROOT / "data/paper/regression_coefficients.csv").set_index(["detector", "parameter"])
    terms = [(detector, term) for detector in ("yolov4", "faster_rcnn") for term in TERMS]
    np.testing.assert_allclose(ours.loc[terms, "std_dev"], printed.loc[terms, "std_dev"], rtol=2e-3)
