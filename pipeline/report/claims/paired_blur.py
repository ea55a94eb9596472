"""Paired differences between two cells of Table I, or between two estimators on sharp frames.

Cells share frames, whose scene, lens and light make all of them easy or hard. A difference is taken over the patches
that both cells have, and whole frames are resampled with both:

    AMAE*(first) - AMAE*(second)

with the AMAE of resampled frames of `pipeline.experiments.summarise`. An estimator that was run on fewer frames or
patches than another is compared on those.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from pipeline.camera import mtf
from pipeline.cluster_intervals import NO_INTERVAL
from pipeline.experiments.intervals import bootstrap_stream, frame_interval, robust_median

Floats = NDArray[np.float64]
Key = tuple[str, str, str, float]
"""Dataset that was measured on, estimator, kind of blur and kernel size (px)."""

DRAWS = 500


@dataclass(frozen=True, eq=False)
class Cell:
    """Estimates of one estimator under one kind and size of blur.

    Attributes:
        patches: (N,) frame and number of each patch.
        estimates: (N, rotations, 2, 8) MTF, NaN where abstained.
        truth: (rotations, 2, 8).
    """

    patches: pd.MultiIndex
    estimates: Floats
    truth: Floats


Statistic = Callable[[Floats, Floats], Floats]
"""Of (N, draws, rotations, 2, 8) resampled estimates and the truth, a number for each draw."""


def amae_percent(estimates: Floats, truth: Floats) -> Floats:
    """AMAE of resampled patches: (N, draws, rotations, 2, 8) -> (draws,) percent."""
    return np.asarray(mtf.amae(robust_median(estimates), truth).mean(axis=-1))


def horizontal_mtf(frequency_index: int) -> Statistic:
    """Robust median over patches of the horizontal MTF at one of the eight frequencies, of the first rotation."""

    def statistic(estimates: Floats, truth: Floats) -> Floats:
        return robust_median(estimates[..., 0, 0, frequency_index])

    return statistic


def cells(estimates: pd.DataFrame) -> dict[Key, Cell]:
    """The cells of a table of estimates (`pipeline.experiments.tables.BLUR_ESTIMATES`, ``measured_on``)."""
    known: dict[Key, Cell] = {}
    groups: Any = estimates.groupby(["measured_on", "estimator", "blur_kind", "kernel_size_px"], sort=False)
    for key, group in groups:
        ordered = group.sort_values(["frame", "patch", "angle_deg", "axis", "frequency"])
        points = ordered["angle_deg"].nunique() * 2 * len(mtf.FREQUENCIES)
        shape = (-1, ordered["angle_deg"].nunique(), 2, len(mtf.FREQUENCIES))
        values, truth = (ordered[name].to_numpy(float).reshape(shape) for name in ("mtf", "true_mtf"))
        patches = pd.MultiIndex.from_frame(ordered[["frame", "patch"]].iloc[::points])
        known[key] = Cell(patches, values, truth[0])
    return known


def difference(
    first: Cell, second: Cell, seed: int, key: Iterable[Any], statistic: Statistic = amae_percent
) -> tuple[float, float]:
    """95 % interval of the difference of a statistic between two cells, over the patches that both have.

    Args:
        first: whose statistic it is.
        second: whose statistic is subtracted.
        seed: root of the bootstrap's random streams.
        key: names the stream.
        statistic: of estimates and truth.

    Returns:
        lower and upper end in the unit of the statistic; NaN with fewer than two frames in which both have an estimate.
    """
    shared = first.patches.intersection(second.patches, sort=None)
    if len(shared) == 0:
        return NO_INTERVAL
    one, other = (cell.estimates[cell.patches.get_indexer(shared)] for cell in (first, second))
    frames = shared.get_level_values("frame").to_numpy(str)
    both = np.ones(len(shared), dtype=bool)
    for values in (one, other):
        answered = np.isfinite(values).reshape(len(values), -1).any(axis=1)
        both &= np.isin(frames, frames[answered])
    rotations = one.shape[1]

    def less(patches: Floats) -> Floats:
        return statistic(patches[..., :rotations, :, :], first.truth) - statistic(
            patches[..., rotations:, :, :], second.truth
        )

    together = np.concatenate([one, other], axis=1)[both]
    return frame_interval(together, frames[both], less, bootstrap_stream(seed, "claims", *key), DRAWS)


def lower(
    known: Mapping[Key, Cell], key: Key, others: Iterable[Key], seed: int, statistic: Statistic = amae_percent
) -> dict[str, bool]:
    """Whether the statistic of a cell is lower than that of all others, or higher than that of one.

    Args:
        known: cells, these among them.
        key: of the cell.
        others: keys of those that it is compared with.
        seed: see `difference`.
        statistic: see `difference`.

    Returns:
        ``supports``: the interval of every difference lies below 0; ``opposes``: one lies above.
    """
    ends = [difference(known[key], known[other], seed, (*key, *other), statistic) for other in others]
    return {"supports": all(high < 0 for _, high in ends), "opposes": any(low > 0 for low, _ in ends)}
