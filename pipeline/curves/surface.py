"""The IOPC as a surface: average precision for a noise and an MTF, with confidence, where it was measured.

The knots are the full bins, each at the mean place of its tuples. Three or four of them around a corner span one or two
triangles, on which the surface is linear. A noise or MTF at which nothing at all was measured (a whole row or column of
empty bins) is interpolated over if it is a single one; a single empty bin elsewhere is a hole. A query outside of all
triangles is answered only within a full bin, by the nearest point of the surface; anywhere else it is refused: the
surface is never extrapolated. The outermost bins reach half a bin beyond their centres, so that an MTF just above 1,
that of a sharpened frame, counts with those of 1; a noise below 0 DN or an MTF below 0 does not exist and is refused.
The interval is that of the same mixture of the knots' bootstrap draws, wider for few scenes
(`pipeline.cluster_intervals`).
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.cluster_intervals import critical_value
from pipeline.curves.cells import (
    BRIDGE_BINS,
    MTF_BINS,
    SIGMA_BINS_DN,
    Cells,
    gather,
    nearest_bin,
    precision_interval,
    refuse_inconsistent,
)
from pipeline.curves.monotonic import rise_z, rises
from pipeline.errors import InputError
from pipeline.store import read_arrays, write_arrays

Floats = NDArray[np.float64]

CERTAIN_TAIL = 0.025
"""One-sided probability, over all comparisons of a surface together, below which a rise is certain."""
_EDGE_SLACK = 1e-9
_LEAST_AREA = 1e-6


@dataclass(frozen=True)
class Answer:
    """Values of the surface; refused queries are NaN with a reason.

    Attributes:
        ap_percent: (...) average precision.
        low, high: (...) bootstrap 95 % interval; NaN where unknown.
        reason: (...) str, empty where there is an answer.
    """

    ap_percent: Floats
    low: Floats
    high: Floats
    reason: NDArray[np.str_]


class Surface:
    """Average precision over noise and MTF.

    Args:
        cells: binned tuples with at least three full bins around a corner.
        bridge: empty rows or columns of bins, one after the other, that are interpolated over.
        scenes: independent scenes with an object that the draws resample, which decide what is certain and how wide
            intervals are; None for many, whose intervals are plain quantiles.

    Raises:
        InputError: too few full bins for a surface.
    """

    def __init__(self, cells: Cells, bridge: int = BRIDGE_BINS, scenes: int | None = None) -> None:
        self.cells, self.scenes = cells, scenes
        rows, columns = np.nonzero(cells.count)
        self._scale = np.array([np.diff(cells.sigma_bins_dn).mean(), np.diff(cells.mtf_bins).mean()])
        self._knots = np.stack([cells.sigma_dn[rows, columns], cells.mtf[rows, columns]], axis=1) / self._scale
        self._ap = cells.ap_percent[rows, columns]
        self._draws = cells.draws[:, rows, columns]
        self._triangles = triangulate(cells.count > 0, self._knots, bridge)
        if not len(self._triangles):
            raise InputError(
                f"{len(rows)} full bins make no surface; expected at least three that meet, not all of one noise or"
                f" MTF, with at most {bridge} empty between them: more sizes of blur and noise, or coarser bins"
                " (detection.curves), join them (for a single effect see pipeline.curves.isolated)"
            )

        corners = self._knots[self._triangles]
        self._origin = corners[:, 0]
        self._shares = np.linalg.inv(np.moveaxis(corners[:, 1:] - corners[:, :1], 1, 2))

    def non_monotonic(self, tolerance: float = 0.0) -> NDArray[np.bool_]:
        """(S, M) bins with a higher average precision than the next less noisy or the next sharper full bin."""
        precision = self.cells.ap_percent
        return rises(precision, 0, tolerance) | rises(precision[:, ::-1], 1, tolerance)[:, ::-1]

    def certainly_non_monotonic(self, tolerance: float = 0.0) -> NDArray[np.bool_]:
        """(S, M) bins whose rise is significant although so many neighbours are compared (see `certainty`)."""
        return self.certainty(tolerance) >= 1

    def certainty(self, tolerance: float = 0.0) -> Floats:
        """(S, M) largest rise of each bin over the rise that would be certain; NaN where nothing is known.

        A rise is certain where z = rise / standard error, by the bootstrap, exceeds the quantile of 1 - 0.025 / K, with
        K the comparisons of all neighbours (Bonferroni 1936): of the normal distribution for many scenes; for n of
        them, whose scatter is itself uncertain, sqrt(n / (n - 1)) times that of Student's t for n - 1. As the standard
        error falls with the square root of the number of objects, 1 / certainty^2 times as many objects, in more
        frames of as many scenes, would make the rise certain.
        """
        cells = self.cells
        noise = rise_z(cells.ap_percent, cells.draws, 0, tolerance)
        blur = rise_z(cells.ap_percent[:, ::-1], cells.draws[:, :, ::-1], 1, tolerance)[:, ::-1]
        comparisons = int((~np.isnan(noise)).sum() + (~np.isnan(blur)).sum())
        critical = critical_value(CERTAIN_TAIL / max(comparisons, 1), self.scenes)
        with np.errstate(invalid="ignore"):  # a single scene, whose draws do not scatter: nothing is known
            result: Floats = np.fmax(noise, blur) / critical
        return result

    def query(self, sigma_dn: ArrayLike, mtf: ArrayLike) -> Answer:
        """The average precision at any number of places; what lies outside of the measured is NaN with a reason.

        Raises:
            InputError: as many numbers of noise as of MTF, or one of either, are not given.
        """
        given = np.asarray(sigma_dn, dtype=float), np.asarray(mtf, dtype=float)
        try:
            sigma, contrast = np.broadcast_arrays(*given)
        except ValueError:
            shapes = f"{given[0].shape} and {given[1].shape}"
            raise InputError(f"sigma_dn, mtf: expected arrays of one shape, not {shapes}") from None
        entries = [self._answer(s, m) for s, m in zip(sigma.ravel(), contrast.ravel(), strict=True)]
        numbers = np.array([entry[:3] for entry in entries], dtype=float).reshape(-1, 3).T
        reasons = np.array([entry[3] for entry in entries], dtype=np.str_)
        shaped = [part.reshape(sigma.shape) for part in (*numbers, reasons)]
        return Answer(*shaped)

    def at(self, sigma_dn: float, mtf: float) -> tuple[float, float, float]:
        """Average precision in percent, and the ends of its interval, at one place.

        Args:
            sigma_dn: noise, DN on the 0..255 scale, at least 0.
            mtf: 0..1, or above 1 within the outermost bin.

        Raises:
            InputError: nothing was measured there, or one of both is negative or not finite.
        """
        precision, low, high, reason = self._answer(float(sigma_dn), float(mtf))
        if reason:
            raise InputError(reason)
        return precision, low, high

    def save(self, path: str | Path) -> None:
        """Write the bins as ``.npz``; `load` gives the same surface back."""
        cells = {name: np.asarray(value) for name, value in vars(self.cells).items()}
        write_arrays(path, **cells, scenes=np.asarray(self.scenes or 0))

    @classmethod
    def load(cls, path: str | Path, bridge: int = BRIDGE_BINS) -> Surface:
        """Read a surface; ``bridge`` as above.

        Raises:
            InputError: the file is missing, broken, or holds no surface.
        """
        arrays = read_arrays(path)
        names = set(Cells.__dataclass_fields__)
        scenes = arrays.pop("scenes", np.asarray(0))  # 0 where they are many
        if set(arrays) != names:
            raise InputError(f"{path}: expected arrays {sorted(names)}, found {sorted(arrays)}; not a surface")
        refuse_inconsistent(arrays, path)
        count = scenes_of(scenes, path)
        left_out = int(arrays.pop("left_out"))
        try:
            return cls(Cells(**arrays, left_out=left_out), bridge, count)
        except (InputError, ValueError, np.linalg.LinAlgError) as error:
            raise InputError(f"{path}: {error}") from None

    def _answer(self, sigma_dn: float, mtf: float) -> tuple[float, float, float, str]:
        nan = float("nan")
        if not (np.isfinite(sigma_dn) and np.isfinite(mtf)):
            return nan, nan, nan, f"sigma {sigma_dn:g} DN, MTF {mtf:g}: expected finite numbers"
        if sigma_dn < 0 or mtf < 0:
            return nan, nan, nan, f"sigma {sigma_dn:g} DN, MTF {mtf:g}: expected numbers of at least 0"
        with np.errstate(over="ignore", invalid="ignore"):  # numbers too large to calculate with lie outside
            position = np.array([sigma_dn, mtf]) / self._scale
            weights = self._inside(position)
        if weights is None:
            row = int(nearest_bin(sigma_dn, self.cells.sigma_bins_dn))
            column = int(nearest_bin(mtf, self.cells.mtf_bins))
            if row < 0 or column < 0 or not self.cells.count[row, column]:
                known = self.cells.count > 0
                sigmas, mtfs = self.cells.sigma_dn[known], self.cells.mtf[known]
                return (
                    nan,
                    nan,
                    nan,
                    (
                        f"sigma {sigma_dn:g} DN, MTF {mtf:g}: nothing was measured there (noise {sigmas.min():.3g} .."
                        f" {sigmas.max():.3g} DN, MTF {mtfs.min():.2f} .. {mtfs.max():.2f}); it is not extrapolated"
                    ),
                )
            weights = self._nearest(position)
        precision = float(self._ap @ weights)
        low, high = precision_interval(self._draws[:, weights > 0] @ weights[weights > 0], precision, self.scenes)
        return precision, low, high, ""

    def _inside(self, place: Floats) -> Floats | None:
        """Weights of the knots (K,) in the triangle around a place, or None."""
        two = (self._shares @ (place - self._origin)[:, :, None])[:, :, 0]
        shares = np.concatenate([1.0 - two.sum(axis=1, keepdims=True), two], axis=1)
        best = int(np.argmax(shares.min(axis=1)))
        if not shares[best].min() >= -_EDGE_SLACK:  # or NaN
            return None
        weights = np.zeros(len(self._knots))
        weights[self._triangles[best]] = np.clip(shares[best], 0.0, None)
        return weights / weights.sum()

    def _nearest(self, place: Floats) -> Floats:
        """Weights of the knots (K,) at the point of the surface nearest to a place outside of it."""
        pairs = np.concatenate([self._triangles[:, [0, 1]], self._triangles[:, [1, 2]], self._triangles[:, [2, 0]]])
        start, along = self._knots[pairs[:, 0]], self._knots[pairs[:, 1]] - self._knots[pairs[:, 0]]
        length = np.maximum((along**2).sum(axis=1), 1e-30)
        share = np.clip(((place - start) * along).sum(axis=1) / length, 0.0, 1.0)
        distance = np.linalg.norm(start + share[:, None] * along - place, axis=1)
        best = int(np.argmin(distance))
        weights = np.zeros(len(self._knots))
        weights[pairs[best]] = 1.0 - share[best], share[best]
        return weights


def scenes_of(array: NDArray[Any], path: object) -> int | None:
    """Scenes that draws resample, as a file holds them: None for 0, which stands for many.

    Raises:
        InputError: not a count; names the file.
    """
    if array.ndim or array.dtype.kind not in "iu" or array < 0:
        raise InputError(f"{path}: array 'scenes': expected a count")
    return int(array) or None


def triangulate(full: NDArray[np.bool_], knots: Floats, bridge: int = BRIDGE_BINS) -> NDArray[np.int64]:
    """Triangles between full bins that meet, once empty rows and columns are taken out.

    The knots of four bins around a corner form a quadrilateral without crossings, for each stays in its bin; it is cut
    along the diagonal that leaves the larger of the smaller triangles. Three such bins give one triangle, unless their
    knots lie in the wrong order.

    Args:
        full: (S, M) bins with a knot.
        knots: (K, 2) places in units of bins, in the order of ``np.nonzero(full)``.
        bridge: empty rows or columns, one after the other, that may be taken out.

    Returns:
        (T, 3) numbers of knots.
    """
    number = np.full(full.shape, -1)
    number[full] = np.arange(len(knots))
    results: list[tuple[int, int, int]] = []
    rows, columns = np.nonzero(full)
    for row, row_after in _neighbours(rows, bridge):
        for column, column_after in _neighbours(columns, bridge):
            around = number[[row, row_after, row_after, row], [column, column, column_after, column_after]]
            corners = [int(corner) for corner in around if corner >= 0]
            if len(corners) == 3:
                choices = [[(corners[0], corners[1], corners[2])]]
            elif len(corners) == 4:
                a, b, c, d = corners
                choices = [[(a, b, c), (a, c, d)], [(a, b, d), (b, c, d)]]
            else:
                continue
            best = max(choices, key=lambda pair: min(_area(knots, triangle) for triangle in pair))
            results += [triangle for triangle in best if _area(knots, triangle) > _LEAST_AREA]
    return np.array(results, dtype=np.int64).reshape(-1, 3)


def _neighbours(used: NDArray[np.int64], bridge: int) -> list[tuple[int, int]]:
    """Each used row or column with the next one, unless too many between them are unused."""
    pairs = itertools.pairwise(np.unique(used).tolist())
    return [(item, other) for item, other in pairs if other - item <= 1 + bridge]


def _area(knots: Floats, triangle: tuple[int, int, int]) -> float:
    """Area of a triangle in square bins, negative if its corners run clockwise."""
    (x0, y0), (x1, y1), (x2, y2) = knots[list(triangle)]
    return float((x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)) / 2


def build(
    sigma_dn: ArrayLike,
    mtf: ArrayLike,
    ap_percent: ArrayLike,
    generator: np.random.Generator,
    ap_draws: ArrayLike | None = None,
    draws: int = 500,
    sigma_bins_dn: ArrayLike = SIGMA_BINS_DN,
    mtf_bins: ArrayLike = MTF_BINS,
    bridge: int = BRIDGE_BINS,
) -> Surface:
    """The surface through measured tuples; the arguments are those of `pipeline.curves.cells.gather` and `Surface`.

    Raises:
        InputError: see `gather` and `Surface`.
    """
    return Surface(gather(sigma_dn, mtf, ap_percent, generator, ap_draws, draws, sigma_bins_dn, mtf_bins), bridge)
