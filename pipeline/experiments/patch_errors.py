"""Errors of noise estimates on single patches, saturated patches and maps, with intervals.

The ground truths of a patch are the noise added by the sensor and the noise present after clipping to 8 bit.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.cluster_intervals import cluster_mean
from pipeline.experiments.intervals import frame_interval, median
from pipeline.experiments.summarise import coverage
from pipeline.streams import stream

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

SATURATED = 0.8
"""Fraction of black or white pixels in the sharp frame beyond which a patch counts as saturated."""

UNIFORM_BELOW = 0.1
"""Relative spread of the noise over a frame below which there is no pattern to correlate with."""


def patch_errors(estimates: pd.DataFrame, seed: int) -> pd.DataFrame:
    """Mean absolute error per dataset, estimator and noise source, with a bootstrap 95 % interval over frames.

    Args:
        estimates: `pipeline.tables.NOISE_ESTIMATES`.
        seed: root of the random streams.

    Returns:
        dataset, estimator, noise_source, abstained_percent, width_dn (median width of the intervals; NaN without), and
        for each quantity (present_dn, added_dn: errors; coverage_percent, clean_percent: intervals that hold the noise
        added, of patches with and without added noise) its value, ``<quantity>_low``, ``_high`` and ``_count``.
    """
    import pandas as pd

    rows = []
    groups: Any = estimates.groupby(["dataset", "estimator", "noise_source"], sort=False)
    for (dataset, estimator, noise_source), selected in groups:
        ends = (selected[name].to_numpy(float) for name in ("low_dn", "high_dn", "unclipped_sigma_dn"))
        covered, clean = pd.Series(100.0 * coverage(*ends), selected.index), selected["target_sigma_dn"] == 0
        quantities = {
            "present_dn": ("present", (selected["sigma_dn"] - selected["clipped_sigma_dn"]).abs()),
            "added_dn": ("added", (selected["sigma_dn"] - selected["unclipped_sigma_dn"]).abs()),
        }
        if covered.notna().any():
            quantities["coverage_percent"] = ("coverage", covered.mask(clean))
            quantities["clean_percent"] = ("clean", covered.where(clean))
        row = {
            "dataset": dataset,
            "estimator": estimator,
            "noise_source": noise_source,
            "abstained_percent": 100.0 * float(selected["abstained"].mean()),
            "width_dn": float((selected["high_dn"] - selected["low_dn"]).median())
            if covered.notna().any()
            else math.nan,
        }
        for name, (part, values) in quantities.items():
            generator = stream(seed, "report", "noise patches", dataset, estimator, noise_source, part)
            bounds = (0.0, 100.0 if name.endswith("percent") else math.inf)
            cells = cluster_mean(values, selected["frame"], generator, bounds=bounds)
            row |= dict(zip((name, f"{name}_low", f"{name}_high", f"{name}_count"), cells, strict=True))
        rows.append(row)
    return pd.DataFrame(rows)


def saturated_patches(estimates: pd.DataFrame, seed: int) -> pd.DataFrame:
    """Median estimate at the highest level, of patches that are nearly all black or white.

    Args:
        estimates: `pipeline.tables.NOISE_ESTIMATES`.
        seed: root of the random streams.

    Returns:
        dataset, noise_source, target_sigma_dn, patches (that the estimator was run on), added_dn, present_dn (medians
        over these patches), estimator, median_dn, low_dn, high_dn (95 % interval over frames) and count (patches with
        an estimate); empty without such patches.
    """
    import pandas as pd

    chosen = estimates[estimates["saturated_fraction"] > SATURATED]
    level = float(chosen["target_sigma_dn"].max()) if len(chosen) else math.nan
    rows = []
    groups: Any = chosen[chosen["target_sigma_dn"] == level].groupby(["dataset", "noise_source"], sort=False)
    for (dataset, noise_source), here in groups:
        for estimator, selected in here.groupby("estimator", sort=False):
            answered = selected[~selected["abstained"]]
            answers = answered["sigma_dn"].to_numpy(float)
            generator = stream(seed, "report", "saturated", dataset, noise_source, estimator)
            low, high = frame_interval(
                answers, answered["frame"].to_numpy(str), median, generator, draws=500, least=0.0
            )
            rows.append(
                {
                    "dataset": dataset,
                    "noise_source": noise_source,
                    "target_sigma_dn": level,
                    "patches": len(selected),
                    "added_dn": float(selected["unclipped_sigma_dn"].median()),
                    "present_dn": float(selected["clipped_sigma_dn"].median()),
                    "estimator": estimator,
                    "median_dn": float(np.median(answers)) if answers.size else math.nan,
                    "low_dn": low,
                    "high_dn": high,
                    "count": len(answers),
                }
            )
    return pd.DataFrame(rows)


def agreement(added_dn: NDArray[np.floating], estimated_dn: NDArray[np.floating]) -> dict[str, float]:
    """Agreement of two maps of one frame, over the cells that both have.

    Args:
        added_dn: (h, w) noise added, DN; NaN where unknown.
        estimated_dn: (h, w) noise estimated, DN; NaN where the estimator abstains.

    Returns:
        cells (in both), unknown (in either), unclipped_median_dn, estimated_median_dn, mean_error_dn and correlation
        (NaN for uniform noise).
    """
    known = np.isfinite(added_dn) & np.isfinite(estimated_dn)
    added, estimated = added_dn[known].astype(float), estimated_dn[known].astype(float)
    numbers: dict[str, float] = {"cells": int(known.sum()), "unknown": int((~known).sum())}
    if not added.size:
        names = ("unclipped_median_dn", "estimated_median_dn", "mean_error_dn", "correlation")
        return numbers | dict.fromkeys(names, float("nan"))
    spread = added.std() * estimated.std() if added.std() > UNIFORM_BELOW * np.median(added) else 0.0
    covariance = ((added - added.mean()) * (estimated - estimated.mean())).mean()
    return numbers | {
        "unclipped_median_dn": float(np.median(added)),
        "estimated_median_dn": float(np.median(estimated)),
        "mean_error_dn": float(np.abs(added - estimated).mean()),
        "correlation": float(covariance / spread) if spread else float("nan"),
    }
