"""Metrics of blur and noise at once: the tables' cells as nested means that a program compares."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import pandas as pd


def metrics(blur: pd.DataFrame, noise: pd.DataFrame | None = None) -> dict[str, Any]:
    """What continuous integration compares: means over kernel sizes, nested by experiment, estimator and level.

    Where every patch was abstained from there is no mean, and none is written; the counts say so.

    Args:
        blur: `BLUR_CELLS`.
        noise: `NOISE_CELLS`.
    """
    nested: dict[str, Any] = {}

    def put(path: list[str], content: dict[str, Any]) -> None:
        place = nested
        for part in path:
            place = place.setdefault(part, {})
        place.update({name: value for name, value in content.items() if np.isfinite(value)})

    keys = ["experiment", "estimator", "calibrated", "filter_px", "level_dn"]
    for key, group in blur.groupby(keys, sort=True):
        cell: dict[str, Any] = dict(zip(keys, key, strict=True))
        way = "calibrated" if cell["calibrated"] else "raw"
        way += f", smoothed by {cell['filter_px']:g} px" if cell["filter_px"] else ""
        put(
            ["blur", cell["experiment"], cell["estimator"], way, f"{cell['level_dn']:g}"],
            {
                "amae_percent": float(group["amae_percent"].mean()),
                "count": int(group["count"].sum()),
                "abstained": int(group["abstained"].sum()),
            },
        )
    keys = ["experiment", "estimator", "level_dn"]
    for key, group in noise.groupby(keys, sort=True) if noise is not None else ():
        cell = dict(zip(keys, key, strict=True))
        put(
            ["noise", cell["experiment"], cell["estimator"], f"{cell['level_dn']:g}"],
            {
                "median_dn": float(group["median_dn"].mean()),
                "patch_error_dn": float(group["patch_error_dn"].mean()),
                "abstained": int(group["abstained"].sum()),
            },
        )
    return nested
