"""Schemas of the tables that the stages of control write: surface, closed loop, worked examples."""

from __future__ import annotations

from pipeline.store import Schema

KNOTS = Schema(
    "surface for control",
    {
        "fold": "int64",
        "level": "float64",  # mean encoded level of the frames
        "target_sigma_dn": "float64",
        "motion_px": "float64",
        "sigma_dn": "float64",  # median of the monitor's estimates
        "true_sigma_dn": "float64",
        "mtf": "float64",
        "ap_percent": "float64",
        "low_percent": "float64",
        "high_percent": "float64",
        "objects": "int64",
        "estimates": "int64",
        "estimates_abstained": "int64",
    },
    {"target_sigma_dn": "DN", "sigma_dn": "DN", "motion_px": "px", "ap_percent": "%"},
)

STEPS = Schema(
    "closed loop, steps",
    {
        "scenario": "string",
        "policy": "string",
        "fold": "int64",
        "step": "int64",
        "light": "float64",
        "speed_px_s": "float64",
        "exposure_ms": "float64",
        "iso": "float64",
        "motion_px": "float64",
        "sigma_dn": "float64",
        "mean_level": "float64",
        "saturated_fraction": "float64",
        "estimated_sigma_dn": "float64",  # NaN where the monitor abstained or was not asked
        "estimated_motion_px": "float64",
        "action": "string",
        "reason": "string",
        "expected_ap_percent": "float64",
        "ap_percent": "float64",  # over the fold's viewpoints at this step
    },
    {"exposure_ms": "ms", "motion_px": "px", "sigma_dn": "DN", "ap_percent": "%"},
)

SUMMARY = Schema(
    "closed loop, policies",
    {
        "scenario": "string",
        "policy": "string",
        "ap_percent": "float64",
        "low_percent": "float64",
        "high_percent": "float64",
        "regret_percent": "float64",  # AP of the oracle less that of the policy, on the same frames
        "regret_low_percent": "float64",
        "regret_high_percent": "float64",
        "settling_frames": "float64",  # worst disturbance and fold; NaN: not settled in the scenario, or not measured
        "overshoot_stops": "float64",  # NaN: not measured, every part of the scenario is too short
        "ripple_stops": "float64",  # NaN: no part settled for three frames
        "frames_lost_percent": "float64",
        "abstained_percent": "float64",
        "refused_percent": "float64",
        "probes_percent": "float64",  # decisions that are probes of a search still under way
        "objects": "int64",
        "frames": "int64",
        "motion_in_poor_light": "bool",
    },
    {"ap_percent": "%", "regret_percent": "percent points"},
)

PAIRS = Schema(
    "closed loop, paired differences",
    {
        "scenario": "string",
        "policy": "string",
        "other": "string",
        "difference_percent": "float64",
        "low_percent": "float64",
        "high_percent": "float64",
    },
    {"difference_percent": "percent points"},
)

EXAMPLE_STEPS = Schema(
    "worked examples",
    {
        "example": "string",
        "step": "string",
        "exposure_ms": "float64",
        "iso": "float64",
        "sigma_dn": "float64",  # median of the monitor's estimates
        "mtf_at_0.1": "float64",  # mean of H and V at 0.1 of Nyquist, relative to the camera's sharp frames
        "blur_px": "float64",  # motion, true
        "detection_score": "float64",  # mean best score per car
        "estimated_blur_px": "float64",
        "ap_percent": "float64",
        "low_percent": "float64",
        "high_percent": "float64",
    },
    {"exposure_ms": "ms", "sigma_dn": "DN", "blur_px": "px", "ap_percent": "%"},
)
RESPONSE = Schema(
    "controller response",
    {"controller": "string", "quantity": "string", "time_ms": "float64", "value": "float64"},
)
CONTROLLER_AP = Schema(
    "controller average precision",
    {"controller": "string", "car_ap_percent": "float64", "low_percent": "float64", "high_percent": "float64"},
)
