"""The tables of noise on recordings of real cameras, with their schemas."""

from __future__ import annotations

from pipeline.store import Schema

REAL_NOISE_PATCHES = Schema(
    "noise of real cameras, patches",
    {
        "picture": "string",
        "x_px": "int64",
        "y_px": "int64",
        "estimator": "string",
        "sigma_dn": "float64",  # NaN where abstained
        "low_dn": "float64",
        "high_dn": "float64",
        "white_sigma_dn": "float64",
        "correlation": "float64",
        "reason": "string",  # of an abstention, else ""
        "at_most_dn": "float64",  # NaN where there is no bound
        "mean_picture_sigma_dn": "float64",
        "mean_picture_reason": "string",
        "mean_picture_at_most_dn": "float64",
        "true_sigma_dn": "float64",
        "cleaned_sigma_dn": "float64",
        "true_correlation": "float64",
        "true_white_sigma_dn": "float64",
    },
    {"sigma_dn": "DN", "low_dn": "DN", "high_dn": "DN", "true_sigma_dn": "DN", "cleaned_sigma_dn": "DN"},
)

REAL_NOISE_SUMMARY = Schema(
    "noise of real cameras, summary",
    {
        "estimator": "string",
        "pictures": "int64",
        "patches": "int64",
        "answered_fraction": "float64",
        "mean_sigma_dn": "float64",
        "mean_picture_answered_fraction": "float64",
        "mean_picture_sigma_dn": "float64",
        "correlation_mae": "float64",
        **{
            f"{truth}_{name}": "float64"
            for truth in ("true", "cleaned")
            for name in ("mean_dn", "mae_dn", "mae_low_dn", "mae_high_dn", "bias_dn", "coverage_fraction")
        },
        "mean_white_sigma_dn": "float64",  # these of the patches whose noise is taken apart
        "true_white_mean_dn": "float64",
        "white_mae_dn": "float64",
        "white_mae_low_dn": "float64",
        "white_mae_high_dn": "float64",
        "mean_correlation": "float64",
        "true_correlation_mean": "float64",
        "correlation_mae_low": "float64",
        "correlation_mae_high": "float64",
    },
    {"mean_sigma_dn": "DN", "true_mae_dn": "DN", "cleaned_mae_dn": "DN"},
)

TRANSFER = Schema(
    "photon transfer",
    {
        "plane": "string",
        "gain_dn_per_e": "float64",
        "gain_error": "float64",
        "dark_variance_dn2": "float64",
        "dark_sigma_e": "float64",  # NaN where quantisation leaves none
        "dark_sigma_error": "float64",
        "dark_sigma_reason": "string",  # why there is none, else ""
        "full_scale_e": "float64",
        "snr_at_full_scale": "float64",
        "blocks": "int64",
        "pattern_fraction": "float64",  # of the grey value above black
    },
    {"gain_dn_per_e": "DN/e", "dark_variance_dn2": "DN^2", "dark_sigma_e": "e", "full_scale_e": "e"},
)

TRANSFER_POINTS = Schema(
    "points of photon transfer",
    {"plane": "string", "mean_dn": "float64", "variance_dn2": "float64"},
    {"mean_dn": "DN", "variance_dn2": "DN^2"},
)

DARK = Schema(
    "dark current",
    {
        "plane": "string",
        "slope_dn_per_s": "float64",
        "slope_error": "float64",
        "dark_current_e_per_s": "float64",
        "offset_dn": "float64",
        "zero_fraction": "float64",
    },
    {"slope_dn_per_s": "DN/s", "dark_current_e_per_s": "e/s", "offset_dn": "DN"},
)

DARK_MEANS = Schema(
    "means of dark frames",
    {"plane": "string", "exposure_s": "float64", "mean_dn": "float64"},
    {"exposure_s": "s", "mean_dn": "DN"},
)
