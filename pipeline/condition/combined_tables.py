"""The tables of blur and noise at once: what each estimator read, and the statistics over patches."""

from __future__ import annotations

from pipeline.blur.evaluation import ESTIMATES, SUMMARY
from pipeline.store import Schema

_EXPERIMENT = {"experiment": "string"}  # a name of combined.experiments; "" for sharp frames
_PLACE = {**_EXPERIMENT, "kind": "string", "size_px": "float64"}

BLUR_READ = Schema(
    "blur read under noise",
    {
        **_EXPERIMENT,
        **ESTIMATES.columns,
        "filter_px": "float64",  # disc by which noisy patches were smoothed before estimating; 0: none was to be
        "smoothed": "bool",  # this patch was: `mtf` is then that of blur and disc together
    },
    {**ESTIMATES.units, "filter_px": "px"},
)

BLUR_CELLS = Schema(
    "blur under noise",
    {
        **_EXPERIMENT,
        **SUMMARY.columns,
        "filter_px": "float64",
        "smoothed_share": "float64",  # of patches
        "frequencies_share": "float64",  # of frequencies answered, over patches with an answer
        "mae_h_percent": "float64",
        "mae_v_percent": "float64",
        "expected_amae_percent": "float64",  # of a smoothed answer, from the errors for both blurs without noise
    },
    {**SUMMARY.units, "filter_px": "px", "mae_h_percent": "%", "mae_v_percent": "%", "expected_amae_percent": "%"},
)

CURVES = Schema(
    "example curves",
    {
        "dataset": "string",
        "estimator": "string",
        **_PLACE,
        "angle_deg": "float64",
        "level_dn": "float64",
        "filter_px": "float64",
        "calibrated": "bool",
        "axis": "string",  # "H", "V", or "HV": their mean, as the paper draws it
        "place": "int64",  # number of the frequency, from 0
        "frequency": "float64",
        "true_mtf": "float64",
        "median": "float64",
        "minimum": "float64",  # of the inliers
        "maximum": "float64",
        "count": "int64",
        "abstained": "int64",
    },
    {"size_px": "px", "angle_deg": "deg", "level_dn": "DN", "filter_px": "px", "frequency": "fraction of Nyquist"},
)

_NOISE = {
    "dataset": "string",
    "estimator": "string",
    **_PLACE,
    "effect": "string",
    "level_dn": "float64",
}

NOISE_READ = Schema(
    "noise read under blur",
    {
        **_NOISE,
        "frame": "string",
        "patch": "int64",
        "true_sigma_dn": "float64",  # standard deviation of the noise really present in this patch, after clipping
        "added_sigma_dn": "float64",  # the same before the 8-bit range clips it; photon noise as the optics pass it
        "sigma_dn": "float64",  # NaN where abstained
        "low_dn": "float64",
        "high_dn": "float64",
        "abstained": "bool",
        "reason": "string",
    },
    {"size_px": "px", "level_dn": "DN", "true_sigma_dn": "DN", "added_sigma_dn": "DN", "sigma_dn": "DN"},
)

NOISE_CELLS = Schema(
    "noise under blur",
    {
        **_NOISE,
        "median_dn": "float64",
        "minimum_dn": "float64",
        "maximum_dn": "float64",
        "low_dn": "float64",  # bootstrap 95 % interval of the median
        "high_dn": "float64",
        "true_median_dn": "float64",
        "added_median_dn": "float64",
        "patch_error_dn": "float64",  # mean |estimate - noise as added| per patch
        "coverage": "float64",  # share of intervals that hold the noise as added; NaN where the method has none
        "count": "int64",
        "rejected": "int64",
        "abstained": "int64",
    },
    {"size_px": "px", "level_dn": "DN", "median_dn": "DN"},
)
