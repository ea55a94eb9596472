"""The published regression: rows that people edited or lost are refused in one line."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from pipeline.curves import iso_exposure, published
from pipeline.errors import InputError
from pipeline.store import read_published

PAPER = Path(__file__).resolve().parents[2] / "data/paper"


@pytest.mark.parametrize("parameter", ["c3", "chi2"])
def test_a_missing_parameter_is_named(parameter: str) -> None:
    grid = read_published(PAPER / "fitted_ap_grid.csv", published.GRID_COLUMNS)
    printed = read_published(PAPER / "regression_coefficients.csv", published.COEFFICIENT_COLUMNS)
    rows = grid[(grid["detector"] == "yolov4") & (grid["object"] == "car")]
    selected = printed[(printed["detector"] == "yolov4") & (printed["object"] == "car")]
    terms = ["c1", "c2", "c3", "c4", "c5", "c6", "c7", "c8"]
    coefficients, *_ = iso_exposure.tables("yolov4 car", rows, terms)
    assert published.beside(coefficients, selected, rows)["printed_r2"] > 0.9
    with pytest.raises(InputError, match=f"0 rows for {parameter}"):
        published.beside(coefficients, selected[selected["parameter"] != parameter], rows)
    with pytest.raises(InputError, match=f"2 rows for {parameter}"):
        published.beside(coefficients, pd.concat([selected, selected[selected["parameter"] == parameter]]), rows)
