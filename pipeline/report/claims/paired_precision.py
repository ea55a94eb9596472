"""Average precision at the points of a sweep with its bootstrap, and paired differences between two points.

A point is a size of blur and a level of noise; its average precision (AP) is the mean over the directions of the blur.
All points of a sweep are judged on the same scenes, and on the same resamples of them: easy scenes raise the AP of all.
With the resampled values AP* the interval of a difference is that of

    AP*(first) - AP*(second)

over the scenes that hold an object (`pipeline.cluster_intervals`). A stage keeps AP* of every condition; a record keeps
those of the bins of its surface, which are those of a point where a bin holds one point.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from pipeline.cluster_intervals import bias_corrected
from pipeline.curves.cells import Cells
from pipeline.curves.precision import tuples
from pipeline.report.detection_results import Results
from pipeline.report.tables import where

POINT = ("kernel_size_px", "target_sigma_dn")
WHO = ["dataset", "detector", "label"]
READ_AGAIN = 1e-4
"""Relative difference up to which a number is the same as one that was stored with six digits."""


@dataclass(frozen=True, eq=False)
class Sweep:
    """The points of one detector and class under one kind of blur.

    Attributes:
        dataset, detector, label: names.
        blur_kind: of the blurred points.
        points: kernel_size_px, target_sigma_dn, ap_percent of P points.
        draws: (P, B) resampled AP in percent, NaN where it was not kept.
        scenes: that hold an object of the class.
    """

    dataset: str
    detector: str
    label: str
    blur_kind: str
    points: pd.DataFrame
    draws: NDArray[np.float64]
    scenes: int

    def ends(self) -> tuple[float, float]:
        """Size of the longest blur and level of the strongest noise."""
        longest, strongest = (float(self.points[name].max()) for name in POINT)
        return longest, strongest

    @property
    def who(self) -> dict[str, str]:
        """Dataset, detector and class by the names of `WHO`."""
        return {"dataset": self.dataset, "detector": self.detector, "label": self.label}

    def _row(self, size_px: float, sigma_dn: float) -> int | None:
        at = (self.points[POINT[0]] == size_px) & (self.points[POINT[1]] == sigma_dn)
        numbers = np.flatnonzero(at.to_numpy())
        return int(numbers[0]) if len(numbers) else None

    def ap_percent(self, size_px: float, sigma_dn: float) -> float:
        """AP of a point; NaN where it was not swept."""
        row = self._row(size_px, sigma_dn)
        return float("nan") if row is None else float(self.points["ap_percent"].iloc[row])

    def difference(self, first: tuple[float, float], second: tuple[float, float]) -> tuple[float, float, float]:
        """AP of a point less that of another with its paired 95 % interval, percent points.

        Args:
            first: blur (px) and noise (DN) of the point.
            second: of the other one.

        Returns:
            difference, lower and upper end; NaN where a point was not swept, or its resampled values were not kept.
        """
        rows = [self._row(*point) for point in (first, second)]
        if None in rows:
            return float("nan"), float("nan"), float("nan")
        one, other = (int(row) for row in rows if row is not None)
        value = float(self.points["ap_percent"].iloc[one] - self.points["ap_percent"].iloc[other])
        drawn = self.draws[one] - self.draws[other]
        return (value, *bias_corrected(drawn, value, self.scenes, bounds=(-100.0, 100.0)))

    def lower(self, point: tuple[float, float], others: Sequence[tuple[float, float]]) -> dict[str, bool]:
        """Whether AP of a point is lower than that of all others, or higher than that of one, by paired differences.

        Args:
            point: blur (px) and noise (DN).
            others: the same of those that it is compared with.

        Returns:
            ``supports``: every interval lies below 0; ``opposes``: one lies above.
        """
        ends = [self.difference(point, other)[1:] for other in others]
        return {"supports": all(high < 0 for _, high in ends), "opposes": any(low > 0 for low, _ in ends)}


def sweeps(results: Iterable[Results]) -> list[Sweep]:
    """Every detector and class of these results under its kind of blur."""
    return [_sweep(one, label) for one in results for label in one.labels]


def _sweep(one: Results, label: str) -> Sweep:
    rows = where(one.precision, label=label)
    kinds = rows.loc[rows["kernel_size_px"] > 0, "blur_kind"]
    kept = one.draws.get(label)
    draws = np.full((len(rows), 1), np.nan) if kept is None else kept
    points, drawn = tuples(rows, draws, average=True)
    if kept is None and label in one.surfaces:
        drawn = _of_bins(points, one.surfaces[label].cells)
    blur_kind = str(kinds.iloc[0]) if len(kinds) else ""
    return Sweep(one.dataset, one.detector, label, blur_kind, points, drawn, int(rows["scenes"].max()))


def _of_bins(points: pd.DataFrame, cells: Cells) -> NDArray[np.float64]:
    """Draws of the points that are alone in a bin of a surface, NaN of the others: (points, B)."""
    alone = cells.count == 1
    known = np.stack([cells.sigma_dn[alone], cells.mtf[alone], cells.ap_percent[alone]], axis=1)
    drawn = np.full((len(points), len(cells.draws)), np.nan)
    for row, point in enumerate(points[["sigma_dn", "mtf", "ap_percent"]].to_numpy(float)):
        same = np.flatnonzero(np.isclose(known, point, rtol=READ_AGAIN, atol=1e-6).all(axis=1))
        if len(same) == 1:
            drawn[row] = cells.draws[:, alone][:, same[0]]
    return drawn


def distinct(rows: Iterable[Mapping[str, Any]], *also: str) -> pd.DataFrame:
    """Rows of a table of comparisons (`WHO`, more columns), of which those of the same measurement count once.

    Sweeps of several kinds of blur share the points without blur. The first of equal rows stays: results of a stage
    come before records.

    Args:
        rows: to compare.
        also: columns that tell rows of the same dataset, detector and class apart.
    """
    table = pd.DataFrame(list(rows))
    return table.drop_duplicates([*WHO, *also], ignore_index=True) if len(table) else table
