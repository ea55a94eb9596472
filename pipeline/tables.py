"""The tables that stages exchange: one declared schema each, in the order of the DAG."""

from __future__ import annotations

from pipeline.store import Schema

FRAMES = Schema(
    "frames",
    {
        "dataset": "string",
        "frame": "string",
        "split": "string",
        "width_px": "int64",
        "height_px": "int64",
        "objects": "int64",
        "objects_ignored": "int64",
        "previous_frames": "int64",
        "mean_dn": "float64",
        "std_dn": "float64",
        "dark_fraction": "float64",
        "saturated_fraction": "float64",
        "spectrum_slope": "float64",
        "gradient_mean_dn": "float64",
        "gradient_median_dn": "float64",
        "gradient_p90_dn": "float64",
        "gradient_p99_dn": "float64",
        "flat_fraction": "float64",
        "strong_fraction": "float64",
    },
    {"mean_dn": "DN", "std_dn": "DN", "gradient_mean_dn": "DN", "spectrum_slope": "log power / log frequency"},
)

PATCHES = Schema(
    "patches",
    {
        "dataset": "string",
        "frame": "string",
        "purpose": "string",  # "blur" (192 px on objects) or "noise" (128 px tiles)
        "patch": "int64",
        "x_px": "int64",
        "y_px": "int64",
        "size_px": "int64",
        "label": "string",
    },
    {"x_px": "px", "y_px": "px", "size_px": "px"},
)

QUARANTINE = Schema("quarantine", {"dataset": "string", "file": "string", "reason": "string"})

KERNELS = Schema(
    "kernels",
    {
        "kernel": "string",
        "blur_kind": "string",  # "defocus", "linear_motion", "nonlinear_motion"
        "kernel_size_px": "int64",
        "angle_deg": "float64",
        "source": "string",  # "generated" or "paper"
        "axis": "string",  # "H" or "V"
        "frequency": "float64",
        "mtf": "float64",
    },
    {"kernel_size_px": "px", "angle_deg": "deg", "frequency": "fraction of Nyquist"},
)

CORRUPTION = Schema(
    "corruption truth",
    {
        "dataset": "string",
        "frame": "string",
        "noise_source": "string",  # "photon", "dcsn", "readout", "combined", "sensor"
        "target_sigma_dn": "float64",  # the sigma asked for
        "noise_scale": "float64",  # factor on the sensor's own noise that reaches it
        # standard deviation of the noise added, whole frame, before the 8-bit range clips it
        "unclipped_sigma_dn": "float64",
        "clipped_sigma_dn": "float64",  # the same after clipping and rounding
        "shift_dn": "float64",  # mean of the noise after clipping and rounding
        "clipped_fraction": "float64",
        "temperature_k": "float64",
        "exposure_s": "float64",
    },
    {"target_sigma_dn": "DN", "unclipped_sigma_dn": "DN", "clipped_sigma_dn": "DN", "shift_dn": "DN"},
)

NOISE_ESTIMATES = Schema(
    "noise estimates",
    {
        "dataset": "string",
        "estimator": "string",
        "noise_source": "string",
        "target_sigma_dn": "float64",
        "frame": "string",
        "patch": "int64",
        "clipped_sigma_dn": "float64",  # standard deviation of the noise really present in this patch, after clipping
        "unclipped_sigma_dn": "float64",  # of the noise as the sensor added it, before the 8-bit range clips it
        "saturated_fraction": "float64",  # of the patch's pixels, black or white in the sharp frame
        "sigma_dn": "float64",  # NaN where abstained
        "low_dn": "float64",
        "high_dn": "float64",
        "abstained": "bool",
        "reason": "string",
    },
    {"target_sigma_dn": "DN", "clipped_sigma_dn": "DN", "unclipped_sigma_dn": "DN", "sigma_dn": "DN"},
)

NOISE_SUMMARY = Schema(
    "noise summary",
    {
        "dataset": "string",
        "estimator": "string",
        "noise_source": "string",
        "target_sigma_dn": "float64",
        "median_dn": "float64",
        "minimum_dn": "float64",
        "maximum_dn": "float64",
        "low_dn": "float64",  # bootstrap 95 % interval of the median
        "high_dn": "float64",
        "clipped_median_dn": "float64",  # robust median of the noise really present, after clipping
        "unclipped_median_dn": "float64",  # of the noise as added, before clipping
        "patch_error_dn": "float64",  # mean |estimate - truth| per patch
        "unclipped_error_dn": "float64",  # mean |estimate - noise as added| per patch
        "coverage": "float64",  # share of intervals that hold the noise as added; NaN where the method has none
        "count": "int64",
        "rejected": "int64",
        "abstained": "int64",
    },
    {"median_dn": "DN"},
)
