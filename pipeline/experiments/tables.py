"""The tables of experiments: the long table of measurements, and those that stages write from it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pipeline.store import ESTIMATE_DECIMALS, Schema

if TYPE_CHECKING:
    import pandas as pd

MEASUREMENTS = Schema(
    "measurements",
    {
        "dataset": "string",
        "estimator": "string",
        "experiment": "string",  # a group of conditions; "" for the reference, or where there is but one
        "kernel": "string",  # "sharp", or a name of the kernel bank
        "blur_kind": "string",
        "kernel_size_px": "float64",
        "angle_deg": "float64",
        "noise_source": "string",  # "" for none
        "target_sigma_dn": "float64",  # asked for
        "filter_px": "float64",  # disc by which noisy patches were filtered before estimating; 0: none was to be
        "smoothed": "bool",  # this patch was: the estimate is then the MTF of blur and disc together
        "frame": "string",
        "patch": "int64",
        "x_px": "int64",
        "y_px": "int64",
        "saturated_fraction": "float64",  # of the patch's pixels, black or white in the sharp frame
        "relative_to": "string",  # what the MTF is relative to (`pipeline.camera.mtf`); "" for sigma
        "quantity": "string",  # "mtf" or "sigma_dn"
        "axis": "string",  # "H" or "V"; "" for sigma
        "frequency": "float64",  # NaN for sigma
        "truth": "float64",  # MTF of the kernel; noise present in the patch, after clipping
        "unclipped_truth": "float64",  # noise of the patch before the 8-bit range clips it
        "estimate": "float64",  # NaN where abstained
        "low": "float64",  # 95 % interval, NaN where the method has none
        "high": "float64",
        "abstained": "bool",
        "reason": "string",
    },
    {
        "kernel_size_px": "px",
        "angle_deg": "deg",
        "target_sigma_dn": "DN",
        "filter_px": "px",
        "frequency": "fraction of Nyquist",
    },
    rounds=False,
)

BLUR_ESTIMATES = Schema(
    "blur estimates",
    {
        "dataset": "string",
        "estimator": "string",
        "kernel": "string",  # "sharp", or a name of the kernel bank
        "blur_kind": "string",
        "kernel_size_px": "float64",
        "angle_deg": "float64",
        "noise_source": "string",  # noise beside the blur, "" for none
        "target_sigma_dn": "float64",
        "frame": "string",
        "patch": "int64",
        "relative_to": "string",  # what the MTF is relative to: "system", "camera" or "generic lens"
        "axis": "string",  # "H" or "V"
        "frequency": "float64",
        "true_mtf": "float64",
        "mtf": "float64",  # NaN where abstained
        "low": "float64",
        "high": "float64",
        "abstained": "bool",
        "reason": "string",
    },
    {"kernel_size_px": "px", "angle_deg": "deg", "target_sigma_dn": "DN", "frequency": "fraction of Nyquist"},
)

BLUR_SUMMARY = Schema(
    "blur summary",
    {
        "dataset": "string",
        "estimator": "string",
        "noise_source": "string",
        "target_sigma_dn": "float64",
        "blur_kind": "string",
        "kernel_size_px": "float64",
        "relative_to": "string",  # what the MTF is relative to: "system", "camera" or "generic lens"
        "calibrated": "bool",  # relative to the camera: divided by the MTF of its sharp frames, or calibrated to it
        "amae_percent": "float64",
        "low_percent": "float64",  # 95 % interval of the AMAE over frames (`pipeline.experiments.intervals`)
        "high_percent": "float64",
        "patch_error_percent": "float64",  # mean |estimate - truth| per patch, no median
        "coverage": "float64",  # share of truths within low..high, NaN for estimators without an interval
        "angles": "int64",
        "count": "int64",  # patches with an answer, over all angles
        "abstained": "int64",
    },
    {"amae_percent": "%", "low_percent": "%", "high_percent": "%", "patch_error_percent": "%"},
)

_EXPERIMENT = {"experiment": "string"}  # a name of combined.experiments; "" for sharp frames
_PLACE = {**_EXPERIMENT, "blur_kind": "string", "kernel_size_px": "float64"}

BLUR_READ = Schema(
    "blur read under noise",
    {
        **_EXPERIMENT,
        **BLUR_ESTIMATES.columns,
        "filter_px": "float64",  # disc by which noisy patches were smoothed before estimating; 0: none was to be
        "smoothed": "bool",  # this patch was: `mtf` is then that of blur and disc together
    },
    {**BLUR_ESTIMATES.units, "filter_px": "px"},
)

BLUR_CELLS = Schema(
    "blur under noise",
    {
        **_EXPERIMENT,
        **BLUR_SUMMARY.columns,
        "filter_px": "float64",
        "smoothed_fraction": "float64",  # of patches
        "frequencies_fraction": "float64",  # of frequencies answered, over patches with an answer
        "mae_h_percent": "float64",
        "mae_v_percent": "float64",
        "expected_amae_percent": "float64",  # of a smoothed answer, from the errors for both blurs without noise
    },
    {**BLUR_SUMMARY.units, "filter_px": "px", "mae_h_percent": "%", "mae_v_percent": "%", "expected_amae_percent": "%"},
)

CURVES = Schema(
    "example curves",
    {
        "dataset": "string",
        "estimator": "string",
        **_PLACE,
        "angle_deg": "float64",
        "target_sigma_dn": "float64",
        "filter_px": "float64",
        "calibrated": "bool",
        "axis": "string",  # "H", "V", or "HV": their mean, as the paper draws it
        "frequency_index": "int64",  # number of the frequency, from 0
        "frequency": "float64",
        "true_mtf": "float64",
        "median": "float64",
        "minimum": "float64",  # of the inliers
        "maximum": "float64",
        "change_low": "float64",  # 95 % interval over frames of the median less that at the least noise, paired
        "change_high": "float64",
        "count": "int64",
        "abstained": "int64",
    },
    {
        "kernel_size_px": "px",
        "angle_deg": "deg",
        "target_sigma_dn": "DN",
        "filter_px": "px",
        "frequency": "fraction of Nyquist",
    },
)
CHANGES = ("change_low", "change_high")
"""Columns of `CURVES` that tables recorded earlier lack."""

_NOISE = {
    "dataset": "string",
    "estimator": "string",
    **_PLACE,
    "noise_source": "string",
    "target_sigma_dn": "float64",
}

NOISE_READ = Schema(
    "noise read under blur",
    {
        **_NOISE,
        "frame": "string",
        "patch": "int64",
        "clipped_sigma_dn": "float64",  # standard deviation of the noise really present in this patch, after clipping
        "unclipped_sigma_dn": "float64",  # the same before the 8-bit range clips it; photon noise as the optics pass it
        "sigma_dn": "float64",  # NaN where abstained
        "low_dn": "float64",
        "high_dn": "float64",
        "abstained": "bool",
        "reason": "string",
    },
    {
        "kernel_size_px": "px",
        "target_sigma_dn": "DN",
        "clipped_sigma_dn": "DN",
        "unclipped_sigma_dn": "DN",
        "sigma_dn": "DN",
    },
)

NOISE_CELLS = Schema(
    "noise under blur",
    {
        **_NOISE,
        "median_dn": "float64",
        "minimum_dn": "float64",
        "maximum_dn": "float64",
        "low_dn": "float64",  # 95 % interval of the median over frames
        "high_dn": "float64",
        "clipped_median_dn": "float64",
        "unclipped_median_dn": "float64",
        "patch_error_dn": "float64",  # mean |estimate - noise as added| per patch
        "coverage": "float64",  # share of intervals that hold the noise as added; NaN where the method has none
        "count": "int64",
        "rejected": "int64",
        "abstained": "int64",
    },
    {"kernel_size_px": "px", "target_sigma_dn": "DN", "median_dn": "DN"},
)

CONDITION = {
    "kernel": "string",
    "blur_kind": "string",
    "kernel_size_px": "float64",
    "angle_deg": "float64",
    "noise_source": "string",
    "target_sigma_dn": "float64",
}
"""Columns that identify a condition of a detection sweep."""

MEASURED = Schema(
    "conditions measured on objects",
    {
        "frame": "string",
        **CONDITION,
        "quantity": "string",  # "sigma_dn" or "mtf"
        "estimator": "string",
        "patch": "int64",
        "x_px": "int64",
        "y_px": "int64",
        "true": "float64",  # noise really in the tile; MTF of the kernel
        "estimate": "float64",  # NaN where abstained
        "abstained": "bool",
        "reason": "string",
    },
    {"kernel_size_px": "px", "angle_deg": "deg", "target_sigma_dn": "DN"},
)

CONDITIONS = Schema(
    "condition medians",
    {
        **CONDITION,
        "sigma_dn": "float64",  # median of the tiles' estimates; NaN where every one abstained
        "sigma_low_dn": "float64",
        "sigma_high_dn": "float64",
        "clipped_sigma_dn": "float64",
        "tiles": "int64",
        "tiles_abstained": "int64",
        "mtf": "float64",
        "mtf_low": "float64",
        "mtf_high": "float64",
        "true_mtf": "float64",
        "patches": "int64",
        "patches_abstained": "int64",
    },
    {"kernel_size_px": "px", "angle_deg": "deg", "target_sigma_dn": "DN", "sigma_dn": "DN"},
)

WRITTEN_OF = {
    "mtf": {"estimate": "mtf", "truth": "true_mtf"},
    "sigma_dn": {
        "estimate": "sigma_dn",
        "truth": "clipped_sigma_dn",
        "unclipped_truth": "unclipped_sigma_dn",
        "low": "low_dn",
        "high": "high_dn",
    },
}
"""Quantity -> columns of the measurements -> as the stages' tables call them."""


def rounded(measurements: pd.DataFrame) -> pd.DataFrame:
    """The measurements at the precision that estimates are stored in (`pipeline.store.ESTIMATE_DECIMALS`).

    Args:
        measurements: `MEASUREMENTS`.
    """
    is_mtf = measurements["quantity"] == "mtf"
    changes = {}
    for name in ("estimate", "low", "high"):
        stored = {quantity: WRITTEN_OF[quantity].get(name, name) for quantity in WRITTEN_OF}
        of_mtf, of_sigma = (measurements[name].round(ESTIMATE_DECIMALS[stored[q]]) for q in ("mtf", "sigma_dn"))
        changes[name] = of_mtf.where(is_mtf, of_sigma)
    return measurements.assign(**changes)


def written(measurements: pd.DataFrame, quantity: str, schema: Schema) -> pd.DataFrame:
    """The measurements of one quantity as a table that a stage writes.

    Args:
        measurements: `MEASUREMENTS`.
        quantity: ``"mtf"`` or ``"sigma_dn"``.
        schema: of the table.
    """
    rows = measurements[measurements["quantity"] == quantity]
    rows = rows.rename(columns=WRITTEN_OF[quantity])
    return schema.conform(rows[list(schema.columns)])


def measurements_of(table: pd.DataFrame, quantity: str) -> pd.DataFrame:
    """A table that a stage wrote, under the names of `MEASUREMENTS`; without a filter where it has no such column.

    Args:
        table: from `written`.
        quantity: see there.
    """
    names = {new: old for old, new in WRITTEN_OF[quantity].items()}
    without: dict[str, Any] = {"experiment": "", "filter_px": 0.0, "smoothed": False}
    absent = {name: value for name, value in without.items() if name not in table}
    return table.rename(columns=names).assign(quantity=quantity, **absent)
