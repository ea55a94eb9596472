"""Robust statistics, weighted means and shares of groups of rows in a long table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.cluster_intervals import bias_corrected, resamples
from pipeline.statistics import Robust, inliers, robust
from pipeline.streams import stream

if TYPE_CHECKING:
    import pandas as pd

DRAWS = 500
"""Resamples of a bootstrap."""


def robust_by(table: pd.DataFrame, by: Sequence[str], value: str, seed: int, purpose: str, part: str) -> pd.DataFrame:
    """`robust` of each group of rows, with the interval of `pipeline.cluster_intervals`: each row is of another frame.

    Args:
        table: long table.
        by: columns that form the groups, kept in order of appearance; a missing value forms a group like any other.
        value: column of the estimates.
        seed: root of the random streams.
        purpose: of the random streams.
        part: of the streams' keys, before the group's own.

    Returns:
        the columns of `by` and the attributes of `Robust`, one row per group.
    """
    import pandas as pd

    rows = []
    groups: Any = table.groupby(list(by), sort=False, dropna=False)
    for key, group in groups:
        parts = (None if pd.isna(name) else name for name in key)  # streams have no key part NaN or NA
        generator = stream(seed, purpose, part, *parts)
        result, known = robust(group[value], generator, 1), group[value].dropna().to_numpy(float)
        low = high = math.nan
        if len(known) > 1:
            medians = [np.median(drawn[inliers(drawn)]) for drawn in known[resamples(len(known), DRAWS, generator)]]
            least = 0.0 if known.min() >= 0 else -math.inf  # what is never negative, such as a share of the pixels
            low, high = bias_corrected(np.array(medians), result.median, len(known), (least, math.inf))
        rows.append(dict(zip(by, key, strict=True)) | asdict(replace(result, low=low, high=high)))
    return pd.DataFrame(rows, columns=[*by, *Robust.__dataclass_fields__])


def weighted_mean(rows: pd.DataFrame, value: str, weight: str = "count") -> float:
    """Mean of a column over cells, weighted by their patches; NaN where no cell has a number."""
    known = rows[np.isfinite(rows[value].to_numpy(float)) & (rows[weight].to_numpy() > 0)]
    return float(np.average(known[value], weights=known[weight])) if len(known) else math.nan


def share_interval(successes: int, count: int) -> tuple[float, float]:
    """Exact 95 % interval of a share of independent cases (Clopper and Pearson, Biometrika 26(4), 1934).

    Args:
        successes: cases counted, 0 to `count`.
        count: all cases, at least 1.

    Returns:
        low and high end, fractions.
    """
    from scipy.stats import binomtest

    interval = binomtest(successes, count).proportion_ci(0.95, "exact")
    return float(interval.low), float(interval.high)
