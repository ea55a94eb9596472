"""The metrics of experiments: cells of their tables as nested numbers that a program compares.

A cell in which every patch was abstained from has no mean, and none is written; the counts show it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.experiments.condition import SHARP

if TYPE_CHECKING:
    import pandas as pd


def noise_metrics(summary: pd.DataFrame) -> dict[str, Any]:
    """Medians, errors, abstentions and coverage, nested by noise source and level.

    Args:
        summary: `pipeline.tables.NOISE_SUMMARY` of one dataset and estimator.
    """
    nested: dict[str, Any] = {}
    for row in summary.to_dict("records"):
        cell = nested.setdefault(str(row["noise_source"]), {})
        names = ("median_dn", "clipped_median_dn", "patch_error_dn", "coverage")
        numbers = {name: row[name] for name in names if np.isfinite(row[name])}
        cell[f"{row['target_sigma_dn']:g}"] = {
            **numbers,
            "abstained": int(row["abstained"]),
            "count": int(row["count"]),
        }
    return nested


def table_one_metrics(summary: pd.DataFrame) -> dict[str, Any]:
    """AMAE and abstentions, nested by kind and size of blur, and the mean AMAE.

    Args:
        summary: `pipeline.experiments.tables.BLUR_SUMMARY` of one dataset and estimator, without noise.
    """
    nested: dict[str, Any] = {}
    for row in summary.to_dict("records"):
        if row["blur_kind"] == SHARP:
            continue
        part = nested.setdefault("calibrated" if row["calibrated"] else "raw", {"mean_amae_percent": []})
        part["mean_amae_percent"].append(row["amae_percent"])
        cell = {"amae_percent": row["amae_percent"], "count": int(row["count"]), "abstained": int(row["abstained"])}
        part.setdefault(str(row["blur_kind"]), {})[f"{row['kernel_size_px']:g}"] = cell
    for part in nested.values():
        part["mean_amae_percent"] = float(np.mean(part["mean_amae_percent"]))
    return nested


def combined_metrics(blur: pd.DataFrame, noise: pd.DataFrame | None = None) -> dict[str, Any]:
    """Means over kernel sizes, nested by experiment, estimator and level; none where a size has no estimate.

    Args:
        blur: `pipeline.experiments.tables.BLUR_CELLS`.
        noise: `pipeline.experiments.tables.NOISE_CELLS`.
    """
    nested: dict[str, Any] = {}

    def put(path: list[str], content: dict[str, Any]) -> None:
        node = nested
        for part in path:
            node = node.setdefault(part, {})
        node.update({name: value for name, value in content.items() if np.isfinite(value)})

    keys = ["experiment", "estimator", "calibrated", "filter_px", "target_sigma_dn"]
    for key, group in blur.groupby(keys, sort=True):
        cell: dict[str, Any] = dict(zip(keys, key, strict=True))
        variant = "calibrated" if cell["calibrated"] else "raw"
        variant += f", smoothed by {cell['filter_px']:g} px" if cell["filter_px"] else ""
        put(
            ["blur", cell["experiment"], cell["estimator"], variant, f"{cell['target_sigma_dn']:g}"],
            {
                "amae_percent": float(group["amae_percent"].mean(skipna=False)),
                "count": int(group["count"].sum()),
                "abstained": int(group["abstained"].sum()),
            },
        )
    keys = ["experiment", "estimator", "target_sigma_dn"]
    for key, group in noise.groupby(keys, sort=True) if noise is not None else ():
        cell = dict(zip(keys, key, strict=True))
        put(
            ["noise", cell["experiment"], cell["estimator"], f"{cell['target_sigma_dn']:g}"],
            {
                "median_dn": float(group["median_dn"].mean(skipna=False)),
                "patch_error_dn": float(group["patch_error_dn"].mean(skipna=False)),
                "abstained": int(group["abstained"].sum()),
            },
        )
    return nested
