"""The paper's published regression beside ours: its grids from its coefficients, and its coefficients from its grids.

The printed grids are values of the paper's fit, rounded to 0.1; the average precisions it was fitted to are not
published. So a fit of the grids gives its coefficients back, but a chi2 that is rounding alone; the printed standard
deviations follow when that chi2 is replaced by the printed one.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.curves.regression import TERMS, evaluate
from pipeline.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

GRID_COLUMNS: dict[str, type] = {
    "detector": str,
    "object": str,
    "iso": float,
    "exposure_ms": float,
    "ap_percent": float,
}
COEFFICIENT_COLUMNS: dict[str, type] = {
    "detector": str, "object": str, "parameter": str, "value": float, "std_dev": float,
}  # fmt: skip


def beside(refitted: pd.DataFrame, printed: pd.DataFrame, grid: pd.DataFrame) -> dict[str, Any]:
    """One published fit beside ours of its grid.

    Args:
        refitted: `pipeline.curves.iso_exposure.COEFFICIENTS` of one label.
        printed: rows parameter, value, std_dev of one detector and object (c1..c8, chi2, r2).
        grid: its printed grid: iso, exposure_ms, ap_percent.

    Returns:
        numbers by name: how far the printed coefficients miss the printed grid, and by how many printed standard
        deviations ours miss the printed coefficients; ``reproduced`` are the grid's values from them.

    Raises:
        InputError: a printed parameter is missing, twice there or not a number.
    """
    for parameter in (*TERMS, "chi2", "r2"):
        rows = printed[printed["parameter"] == parameter]
        if len(rows) != 1 or not np.isfinite(rows["value"].astype(float)).all():
            raise InputError(
                f"published regression coefficients: {len(rows)} rows for {parameter}, expected one with a value; "
                "restore data/paper/regression_coefficients.csv from git"
            )
    numbers: Any = printed.set_index("parameter")
    selected = refitted.set_index("term")
    values = numbers.loc[list(TERMS), "value"].to_numpy(float)
    reproduced = evaluate(values, grid["iso"], grid["exposure_ms"])
    shared = [term for term in TERMS if term in selected.index]
    miss = (selected.loc[shared, "value"] - numbers.loc[shared, "value"]).abs() / numbers.loc[shared, "std_dev"]
    return {
        "reproduced": reproduced.tolist(),
        "largest_miss_of_grid": float(np.abs(reproduced - grid["ap_percent"]).max()),
        "largest_miss_in_std_devs": float(miss.max()),
        "printed_chi2": float(numbers.loc["chi2", "value"]),
        "printed_r2": float(numbers.loc["r2", "value"]),
    }


def ledger_tables(
    coefficients: pd.DataFrame, fitted: pd.DataFrame, about: dict[str, dict[str, Any]]
) -> dict[str, pd.DataFrame]:
    """Ours in the layout of the published files.

    Args:
        coefficients: of every published fit; the label is ``"<detector> <object>"``.
        fitted: of every published fit.
        about: label -> numbers of the fit and of `beside`.

    Returns:
        ``regression_coefficients``: refitted to the printed grid, deviations for the printed chi2;
        ``fitted_ap_grid``: from the printed coefficients.
    """
    import pandas as pd

    parameters: list[dict[str, Any]] = []
    grid: list[pd.DataFrame] = []
    for label, numbers in about.items():
        detector, _, kind = label.partition(" ")
        scale = math.sqrt(numbers["printed_chi2"] / numbers["chi2"])
        for row in coefficients[coefficients["label"] == label].to_dict("records"):
            known = {"parameter": row["term"], "value": row["value"], "std_dev": row["std_dev"] * scale}
            parameters.append({"detector": detector, "object": kind, **known})
        for name in ("chi2", "r2"):
            known = {"parameter": name, "value": numbers[name], "std_dev": float("nan")}
            parameters.append({"detector": detector, "object": kind, **known})
        cells = fitted[(fitted["label"] == label) & fitted["ap_percent"].notna()]
        columns = {"detector": detector, "object": kind, "iso": cells["iso"], "exposure_ms": cells["exposure_ms"]}
        grid.append(pd.DataFrame({**columns, "ap_percent": numbers["reproduced"]}))
    return {"regression_coefficients": pd.DataFrame(parameters), "fitted_ap_grid": pd.concat(grid, ignore_index=True)}
