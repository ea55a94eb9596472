"""The paper's regression on a sweep's own numbers: average precision over ISO and exposure time, and its calibration.

A condition stands for the settings that would cause it: noise of sigma for ISO = sigma / lambda1, straight motion of d
pixels for an exposure of d / lambda2. The frames without added noise stand at 1 DN and those without blur at 1 px, as
in the paper, whose axes begin at ISO 100 and 1 ms. Directions are averaged.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.curves.calibration import ANGLES_DEG, Calibration, calibrate, size_for_mtf_px
from pipeline.curves.regression import FORMULAS, Fit, alike, fit, leave_one_out
from pipeline.errors import InputError
from pipeline.store import Schema

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.curves.settings import RegressionSettings

SMALLEST_SIGMA_DN, SMALLEST_PX = 1.0, 1.0
GRID_POINTS = 25

COEFFICIENTS = Schema(
    "regression coefficients",
    {
        "label": "string",
        "term": "string",
        "formula": "string",
        "value": "float64",
        "std_dev": "float64",
        "chi2_without": "float64",  # of the fit that leaves this term out
        "r2_without": "float64",
        "largest_change": "float64",  # of a fitted value, percent points
        "f": "float64",
        "p_value": "float64",
    },
)
FITTED = Schema(
    "fitted cells",
    {
        "label": "string",
        "iso": "float64",
        "exposure_ms": "float64",
        "ap_percent": "float64",  # NaN where only the fit speaks
        "error_percent": "float64",
        "fitted_percent": "float64",
        "fitted_std_dev": "float64",
        "residual": "float64",
    },
    {"exposure_ms": "ms", "ap_percent": "%", "fitted_percent": "%", "residual": "percent points"},
)


def cells(
    rows: pd.DataFrame, draws: NDArray[np.float64], section: RegressionSettings
) -> tuple[pd.DataFrame, NDArray[np.float64]]:
    """Cells of the regression: iso, exposure_ms, ap_percent, error_percent; the mean over directions.

    Args:
        rows: `pipeline.curves.precision.PRECISION` of one label.
        draws: (rows, B) percent, for the error of the mean.
        section: ``detection.regression`` of the configuration.

    Returns:
        one row for each of the n cells that have a value, and their resampled values (n, B), which belong together.
    """
    import pandas as pd

    results, resampled = [], []
    numbered = rows.reset_index(drop=True)
    groups: Any = numbered.groupby(["target_sigma_dn", "kernel_size_px"])
    for (level, size), group in groups:
        resampled.append(draws[group.index].mean(axis=0))
        mean = resampled[-1][np.isfinite(resampled[-1])]
        error = float(np.std(mean, ddof=1)) if len(mean) > 1 else 0.0
        results.append(
            {
                "iso": max(float(level), SMALLEST_SIGMA_DN) / section.sigma_per_iso,
                "exposure_ms": max(float(size), SMALLEST_PX) / section.px_per_ms,
                "ap_percent": float(group["ap_percent"].mean(skipna=False)),
                "error_percent": max(error, section.least_error_percent),
            }
        )
    table = pd.DataFrame(results, columns=["iso", "exposure_ms", "ap_percent", "error_percent"])
    known = np.isfinite(table["ap_percent"].to_numpy(float))
    return table[known].reset_index(drop=True), np.reshape(resampled, (len(table), draws.shape[1]))[known]


def tables(
    label: str, data: pd.DataFrame, terms: Sequence[str], draws: NDArray[np.float64] | None = None
) -> tuple[pd.DataFrame, pd.DataFrame, dict[str, Any]]:
    """Fit one grid.

    Args:
        label: what it is of.
        data: iso, exposure_ms, ap_percent and, for weights, error_percent.
        terms: coefficients to fit.
        draws: (cells, B) resampled values, for standard deviations; see `pipeline.curves.regression.fit`.

    Returns:
        schema `COEFFICIENTS`; schema `FITTED` (the data's cells, then a fine grid of the fit alone); and chi2, R2 ...
        Where all cells are alike, R2 and what a term is worth are NaN.

    Raises:
        InputError: see `pipeline.curves.regression.fit`.
    """
    import pandas as pd

    iso, exposure, percent = (data[name].to_numpy(float) for name in ("iso", "exposure_ms", "ap_percent"))
    errors = data["error_percent"].to_numpy() if "error_percent" in data.columns else None
    whole = fit(iso, exposure, percent, errors, terms, draws)
    nothing = alike(percent)  # to explain
    left = (
        {row.term: row for row in leave_one_out(iso, exposure, percent, errors)}
        if len(terms) == len(FORMULAS) and not nothing
        else {}
    )
    rows = []
    for number, term in enumerate(whole.terms):
        row = {"label": label, "term": term, "formula": FORMULAS[term], "value": whole.value[number]}
        row["std_dev"] = whole.std_dev[number]
        out = left.get(term)
        for name in ("chi2", "r2", "largest_change", "f", "p_value"):
            key = f"{name}_without" if name in ("chi2", "r2") else name
            row[key] = getattr(out, name) if out is not None else float("nan")
        rows.append(row)
    about = {
        "chi2": whole.chi2,
        "r2": whole.r2,
        "adjusted_r2": whole.adjusted_r2,
        "degrees": whole.degrees,
        "cells": len(data),
        "largest_residual": float(np.abs(whole.residual).max()),
        "weighted": errors is not None,
    }
    fitted = pd.concat([_cells(label, whole, errors), _grid(label, whole)], ignore_index=True)
    return COEFFICIENTS.conform(pd.DataFrame(rows)), FITTED.conform(fitted), about


def _cells(label: str, whole: Fit, errors: NDArray[np.float64] | None) -> pd.DataFrame:
    import pandas as pd

    value, deviation = whole.predict(whole.iso, whole.exposure_ms)
    given = {"iso": whole.iso, "exposure_ms": whole.exposure_ms, "ap_percent": whole.ap_percent}
    given |= {"error_percent": np.full(len(whole.iso), np.nan) if errors is None else errors}
    return pd.DataFrame(
        {"label": label, **given, "fitted_percent": value, "fitted_std_dev": deviation, "residual": whole.residual}
    )


def _grid(label: str, whole: Fit) -> pd.DataFrame:
    import pandas as pd

    iso = np.linspace(whole.iso.min(), whole.iso.max(), GRID_POINTS)
    exposure = np.linspace(whole.exposure_ms.min(), whole.exposure_ms.max(), GRID_POINTS)
    x, y = (axis.ravel() for axis in np.meshgrid(iso, exposure, indexing="ij"))
    value, deviation = whole.predict(x, y)
    nothing = np.full(len(x), np.nan)
    columns = {"iso": x, "exposure_ms": y, "ap_percent": nothing, "error_percent": nothing, "fitted_percent": value}
    return pd.DataFrame({"label": label, **columns, "fitted_std_dev": deviation, "residual": nothing})


def calibration(conditions: pd.DataFrame, section: RegressionSettings) -> dict[str, Any]:
    """lambda1 and lambda2 as this camera's own estimates give them, beside the nominal ones.

    Noise is taken without blur, motion without noise: its MTF is the mean over four directions, divided by that of the
    frames without motion, which is the lens's, so that lengths without all directions, like MTFs that no length of
    motion leaves, say nothing and are left out.

    Args:
        conditions: `pipeline.experiments.tables.CONDITIONS`.
        section: ``detection.regression`` of the configuration.

    Returns:
        numbers by name; ``reason`` where they could not be measured.
    """
    noisy = conditions[
        (conditions["kernel_size_px"] == 0) & (conditions["target_sigma_dn"] > 0) & conditions["sigma_dn"].notna()
    ]
    noise_free = conditions[(conditions["target_sigma_dn"] == 0) & conditions["mtf"].notna()]
    sharp, blurred = (noise_free[(noise_free["kernel_size_px"] > 0) == moving] for moving in (False, True))
    lens_mtf = float(sharp["mtf"].mean())
    exposure, lengths = [], []
    by_size: Any = blurred.groupby("kernel_size_px")
    for size, group in by_size:
        if set(group["angle_deg"]) != set(ANGLES_DEG):
            continue
        try:
            lengths.append(size_for_mtf_px(min(float(group["mtf"].mean()) / lens_mtf, 1.0)))
        except InputError:
            continue
        exposure.append(float(size) / section.px_per_ms)
    nominal = Calibration(section.sigma_per_iso, section.px_per_ms)
    given = {"lambda1_nominal": nominal.lambda1, "lambda2_nominal": nominal.lambda2, "lengths_px": lengths}
    given |= {"exposures_ms": exposure, "target_sigmas_dn": noisy["target_sigma_dn"].tolist()}
    given["sigmas_dn"] = noisy["sigma_dn"].tolist()
    if sharp.empty:
        return {**given, "reason": "no condition without blur and noise, whose MTF is the lens's"}
    try:
        result = calibrate(nominal.iso(noisy["target_sigma_dn"]), noisy["sigma_dn"], exposure, lengths)
    except InputError as error:
        return {**given, "reason": str(error)}
    return {
        **given,
        "lambda1": result.lambda1,
        "lambda1_std_dev": result.std_dev1,
        "lambda2": result.lambda2,
        "lambda2_std_dev": result.std_dev2,
    }


def metrics(about: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, float]]:
    """Numbers to watch of the fits that were made, by label; 0 where a fit has none (all cells alike)."""
    names = ("cells", "r2", "largest_residual", "largest_miss_of_grid", "largest_miss_in_std_devs")
    return {
        label: {name: float(np.nan_to_num(item[name])) for name in names if name in item}
        for label, item in about.items()
        if "reason" not in item
    }
