"""Robust statistics, clustered means and weighted means of groups of rows in a long table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.statistics import Robust, bootstrap_interval, robust
from pipeline.streams import stream

if TYPE_CHECKING:
    import pandas as pd


def robust_by(table: pd.DataFrame, by: Sequence[str], value: str, seed: int, purpose: str, part: str) -> pd.DataFrame:
    """`robust` of each group of rows.

    Args:
        table: long table.
        by: columns that form the groups, kept in order of appearance.
        value: column of the estimates.
        seed: root of the random streams.
        purpose: of the random streams.
        part: of the streams' keys, before the group's own.

    Returns:
        the columns of `by` and the attributes of `Robust`, one row per group.
    """
    import pandas as pd

    rows = []
    groups: Any = table.groupby(list(by), sort=False)
    for key, group in groups:
        result = robust(group[value], stream(seed, purpose, part, *key))
        rows.append(dict(zip(by, key, strict=True)) | asdict(result))
    return pd.DataFrame(rows, columns=[*by, *Robust.__dataclass_fields__])


def cluster_mean(
    values: pd.Series, clusters: pd.Series, generator: np.random.Generator, draws: int = 500
) -> tuple[float, float, float, int]:
    """Mean over values with a 95 % interval from a bootstrap over clusters, whose members err together.

    Args:
        values: (N,) numbers; NaN are left out.
        clusters: (N,) names, e.g. the frame of each patch.
        generator: random stream of the bootstrap.
        draws: resamples.

    Returns:
        mean, lower and upper end, number of values; NaN without values, no interval with fewer than two clusters.
    """
    known = values.notna()
    if not known.any():
        return math.nan, math.nan, math.nan, 0
    groups = values[known].groupby(clusters[known])
    sums, sizes = groups.sum().to_numpy(float), groups.size().to_numpy(float)

    def mean(chosen: NDArray[np.floating], axis: int = -1) -> NDArray[np.floating]:
        index = chosen.astype(int)
        return np.asarray(sums[index].sum(axis=axis) / sizes[index].sum(axis=axis))

    low, high = bootstrap_interval(np.arange(len(sums)), generator, mean, draws) if len(sums) > 1 else (math.nan,) * 2
    return float(values[known].mean()), low, high, int(known.sum())


def weighted_mean(rows: pd.DataFrame, value: str, weight: str = "count") -> float:
    """Mean of a column over cells, weighted by their patches; NaN where no cell has a number."""
    known = rows[np.isfinite(rows[value].to_numpy(float)) & (rows[weight].to_numpy() > 0)]
    return float(np.average(known[value], weights=known[weight])) if len(known) else math.nan
