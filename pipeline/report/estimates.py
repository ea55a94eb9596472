"""From statistics to cells: a number with the interval that a stage's table or a bootstrap gives it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.report.tables import Estimate
from pipeline.statistics import bootstrap_interval

DRAWS = 500


def of_row(
    row: Mapping[str, Any], value: str, unit: str = "percent", count: int | None = None, reference: float | None = None
) -> Estimate:
    """A row's value with its interval, columns ``low_<unit>`` and ``high_<unit>``.

    Args:
        row: of a stage's table.
        value: column.
        unit: of the interval's columns.
        count: of samples, see `Estimate`.
        reference: see `Estimate`.
    """
    return Estimate(row[value], row[f"low_{unit}"], row[f"high_{unit}"], count, reference)


def of_amae(row: Mapping[str, Any], reference: float | None = None) -> Estimate:
    """A row's AMAE in percent with its interval and how many patches answered."""
    return of_row(row, "amae_percent", count=int(row["count"]), reference=reference)


def bootstrapped(
    value: float,
    samples: ArrayLike,
    count: int,
    generator: np.random.Generator,
    statistic: Callable[..., NDArray[np.floating]] = np.median,
) -> Estimate:
    """A value with its bootstrap 95 % interval, which fewer than two samples do not give.

    Args:
        value: the statistic of all samples.
        samples: (N,) what is resampled.
        count: shown beside the value.
        generator: where the resampling comes from (`pipeline.streams.stream`).
        statistic: reduces the last axis of resamples.
    """
    low, high = bootstrap_interval(samples, generator, statistic, DRAWS)
    if np.size(samples) < 2:
        low = high = math.nan
    return Estimate(value, low, high, count)
