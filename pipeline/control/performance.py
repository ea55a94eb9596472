"""Average precision expected at a noise and a motion blur: the measured surface as a controller asks it.

The surface (`pipeline.curves.surface`) is over noise and MTF; the monitor's estimates of noise are calibrated by its
medians at the knots, at the brightness of the frame where it is known. The MTF axis is reached through the length of
linear motion, at a frequency low enough that the MTF falls steadily up to 31 px. It is tabulated once, so that a
decision costs microseconds. What was not measured is refused (NaN), but for noise below the least measured, which
counts as that. The table is made monotonic: more noise or motion never raises AP, whatever the scatter of the
measurement; answers lie in 0..100. Surfaces of darker frames may stand beside it; a query at their brightness is
interpolated between them.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.control.motion import motion_mtf
from pipeline.curves.cells import Cells, refuse_inconsistent
from pipeline.curves.surface import Surface, scenes_of
from pipeline.errors import InputError
from pipeline.store import read_arrays, write_arrays

Floats = NDArray[np.float64]

SIGMA_STEP_DN = 1.0
MOTION_STEP_PX = 0.5
LEVEL_SLACK_STOPS = 0.27
"""Frames up to 20 % brighter or darker than any measured count as the nearest measured ones."""

PLATEAU_SLOPE = 0.002
"""Percent points per tabulated step."""

_EDGE = 1e-9


class Expected(NamedTuple):
    """(...) average precision in percent and the ends of its 95 % interval; NaN where refused."""

    ap_percent: Floats
    low: Floats
    high: Floats


class Performance:
    """A surface over noise and motion length.

    Args:
        surface: measured over noise and the MTF at ``frequency_index`` (mean of H and V).
        reference: (2, 8) MTF of the camera's sharp frames.
        frequency_index: which of the eight frequencies the surface's MTF axis is at.
        longest_px: longest motion measured.
        level: mean encoded level of the frames it was measured on, 0..1.
        calibration: (2, K) rising noise as the monitor estimates it and as it is, DN; None where they are the same.
        darker: surfaces of darker frames, in any order.
        table: (3, N, M) tabulated answers as a file holds them; None tabulates the surface (a third of a second).

    Raises:
        InputError: a frequency index out of range, a surface among ``darker`` that is not darker, or a table of
            another shape.
    """

    def __init__(
        self,
        surface: Surface,
        reference: ArrayLike,
        frequency_index: int,
        longest_px: float,
        level: float = 0.5,
        darker: Sequence[Performance] = (),
        calibration: ArrayLike | None = None,
        table: Floats | None = None,
    ) -> None:
        if not 0 <= frequency_index < 8:
            raise InputError(f"frequency_index is one of 0..7, got {frequency_index!r}")
        self.level, self.darker = float(level), tuple(sorted(darker, key=lambda other: -other.level))
        levels = [self.level, *(other.level for other in self.darker)]
        if not 0 < self.level < 1 or any(low >= high for high, low in itertools.pairwise(levels)):
            raise InputError(f"surfaces of darker frames: expected mean levels that fall from {level!r}, got {levels}")
        self.calibration = np.asarray([[1.0], [1.0]] if calibration is None else calibration, dtype=np.float64)
        if self.calibration.ndim != 2 or len(self.calibration) != 2 or (np.diff(self.calibration) <= 0).any():
            raise InputError("surface: calibration holds two rising rows, noise as estimated and as it is")
        self.surface, self.frequency_index, self.longest_px = surface, frequency_index, float(longest_px)
        self.reference = np.asarray(reference, dtype=np.float64)
        known = surface.cells.count > 0
        self.least_sigma_dn = float(np.nanmax(np.where(known[0], surface.cells.sigma_dn[0], np.nan)))
        most = float(np.nanmax(surface.cells.sigma_dn))
        self._sigmas = np.append(np.arange(self.least_sigma_dn, most, SIGMA_STEP_DN), most)
        self._motions = np.append(np.arange(0.0, self.longest_px, MOTION_STEP_PX), self.longest_px)
        self._table = self._tabulated() if table is None else table
        if self._table.shape != (3, len(self._sigmas), len(self._motions)):
            raise InputError(f"surface: table of shape {self._table.shape} does not fit its knots; measure it again")

    def _tabulated(self) -> Floats:
        """(3, N, M) average precision and the ends of its interval over the tabulated noise and motion."""
        mtf = motion_mtf(self._motions, self.reference, self.frequency_index)
        answer = self.surface.query(self._sigmas[:, None], mtf[None])
        return np.stack([monotonic(part) for part in (answer.ap_percent, answer.low, answer.high)])

    @property
    def most_sigma_dn(self) -> float:
        """Strongest noise measured, DN."""
        return float(self._sigmas[-1])

    @property
    def darkest_level(self) -> float:
        """Mean level of the darkest frames measured."""
        return self.darker[-1].level if self.darker else self.level

    def expected(self, sigma_dn: ArrayLike, motion_px: ArrayLike, level: ArrayLike | None = None) -> Expected:
        """Average precision at noise and motion, bilinear between tabulated points, and its interval, all in 0..100.

        Args:
            sigma_dn: (...) noise, DN.
            motion_px: (...) length of motion blur, px.
            level: (...) mean encoded level of the frame, linear in its logarithm between the measured levels and
                refused beyond them (20 % of slack); None, or a surface without darker ones: the level is not regarded.
        """
        answers = self._answers(sigma_dn, motion_px, level, len(Expected._fields))
        return Expected(*(limited(values) for values in answers))

    def ap_percent(self, sigma_dn: ArrayLike, motion_px: ArrayLike, level: ArrayLike | None = None) -> Floats:
        """The average precision of `expected` without its interval, in a third of the time."""
        return limited(self.ranking(sigma_dn, motion_px, level))

    def ranking(self, sigma_dn: ArrayLike, motion_px: ArrayLike, level: ArrayLike | None = None) -> Floats:
        """The average precision before `limited`: where it is 0, less noise and motion still rank higher."""
        return self._answers(sigma_dn, motion_px, level, 1)[0]

    def _answers(self, sigma_dn: ArrayLike, motion_px: ArrayLike, level: ArrayLike | None, count: int) -> list[Floats]:
        """The first so many of the values of `expected`, not limited."""
        if level is None or not self.darker:
            return self._at_level(sigma_dn, motion_px, count)
        parts = [other._at_level(sigma_dn, motion_px, count) for other in (self, *self.darker)]
        mixed = []
        for values in zip(*parts, strict=True):
            before, after, share, beyond = self._next_to(level, values)
            between = np.where(share < 1 - _EDGE, before * (1 - share), 0.0) + _next(after, share)
            mixed.append(np.where(beyond > 0, np.nan, between))
        return mixed

    def _next_to(self, level: ArrayLike, values: Sequence[Floats]) -> tuple[Floats, Floats, Floats, Floats]:
        """Of values by this surface and each darker one, (...), those of the two that are measured next to the level.

        Returns:
            (...) of the brighter surface, of the darker one, the fraction of the way to the darker one, and stops
            beyond the measured levels and their slack.
        """
        shape = np.broadcast_shapes(np.shape(values[0]), np.shape(level))
        wanted, stops = np.broadcast_to(_stops_below_white(level), shape), self._stops()
        index, share = _position(np.clip(wanted, stops[0], stops[-1]), stops)
        stacked = np.stack([np.broadcast_to(part, shape) for part in values])
        before, after = (np.take_along_axis(stacked, index[None] + step, 0)[0] for step in (0, 1))
        beyond = np.maximum(stops[0] - LEVEL_SLACK_STOPS - wanted, wanted - (stops[-1] + LEVEL_SLACK_STOPS))
        return before, after, share, beyond

    def _stops(self) -> Floats:
        """Levels of this surface and the darker ones, in stops below white, rising."""
        return np.asarray(-np.log2([self.level, *(other.level for other in self.darker)]))

    def _at_level(self, sigma_dn: ArrayLike, motion_px: ArrayLike, count: int) -> list[Floats]:
        sigma, motion = np.broadcast_arrays(np.asarray(sigma_dn, float), np.asarray(motion_px, float))
        noise = np.maximum(sigma, self.least_sigma_dn)
        inside = (noise <= self._sigmas[-1] + _EDGE) & (motion >= 0.0) & (motion <= self.longest_px + _EDGE)
        row, down = _position(np.where(inside, noise, self._sigmas[0]), self._sigmas)
        column, right = _position(np.where(inside, motion, 0.0), self._motions)
        parts = []
        for table in self._table[:count]:
            upper = table[row, column] * (1 - right) + _next(table[row, column + 1], right)
            lower = table[row + 1, column] * (1 - right) + _next(table[row + 1, column + 1], right)
            parts.append(np.where(inside, np.where(down > _EDGE, upper * (1 - down) + lower * down, upper), np.nan))
        return parts

    def true_sigma_dn(self, estimated_dn: ArrayLike, level: float | None = None) -> Floats:
        """Noise that a monitor's estimate stands for.

        Args:
            estimated_dn: (...) the monitor's estimate, DN.
            level: mean encoded level of the frame, for the calibrations of the surfaces that are measured next to it,
                mixed linearly in its logarithm; beyond the measured levels that of the nearest. None, or a surface
                without darker ones: the level is not regarded.
        """
        if level is None or not self.darker:
            return self._calibrated_dn(estimated_dn)
        parts = [other._calibrated_dn(estimated_dn) for other in (self, *self.darker)]
        stops = self._stops()
        index, share = _position(np.clip(_stops_below_white(level), stops[0], stops[-1]), stops)
        return np.asarray(parts[int(index)] * (1 - share) + parts[int(index) + 1] * share)

    def _calibrated_dn(self, estimated_dn: ArrayLike) -> Floats:
        """The true noise by the calibration at this level: linear between the knots, in proportion beyond them."""
        given = np.asarray(estimated_dn, dtype=np.float64)
        estimated, true = self.calibration
        inside = np.interp(given, estimated, true)
        scaled = np.where(given < estimated[0], given * true[0] / estimated[0], given * true[-1] / estimated[-1])
        return np.where((given < estimated[0]) | (given > estimated[-1]), scaled, inside)

    def excess(self, sigma_dn: ArrayLike, motion_px: ArrayLike, level: ArrayLike | None = None) -> Floats:
        """How far a condition lies outside of the measured region; 0 inside.

        Args:
            sigma_dn: (...) noise, DN.
            motion_px: (...) length of motion blur, px.
            level: see `expected`.

        Returns:
            (...) noise and motion beyond the measured ones, in fractions of these, by the surfaces that are measured
            next to the level; and stops beyond the measured levels.
        """
        if level is None or not self.darker:
            return self._excess(sigma_dn, motion_px)
        parts = [other._excess(sigma_dn, motion_px) for other in (self, *self.darker)]
        before, after, share, beyond = self._next_to(level, parts)
        nearest = np.maximum(np.where(share < 1 - _EDGE, before, 0.0), np.where(share > _EDGE, after, 0.0))
        return np.asarray(nearest + np.maximum(beyond, 0.0))

    def _excess(self, sigma_dn: ArrayLike, motion_px: ArrayLike) -> Floats:
        noise = np.maximum(np.asarray(sigma_dn, float) / self.most_sigma_dn - 1.0, 0.0)
        return np.asarray(noise + np.maximum(np.asarray(motion_px, float) / self.longest_px - 1.0, 0.0))

    def save(self, path: str | Path) -> None:
        """Write surfaces, references and axes as ``.npz``."""
        arrays = self._arrays("")
        for number, other in enumerate(self.darker):
            arrays |= other._arrays(f"darker{number}_")
        write_arrays(path, **arrays)

    def _arrays(self, prefix: str) -> dict[str, NDArray[Any]]:
        cells = {f"cells_{name}": np.asarray(value) for name, value in vars(self.surface.cells).items()}
        numbers = {name: np.asarray(getattr(self, name)) for name in ("frequency_index", "longest_px", "level")}
        numbers["scenes"] = np.asarray(self.surface.scenes or 0)
        known = {"reference": self.reference, "calibration": self.calibration, "table": self._table, **numbers, **cells}
        return {f"{prefix}{name}": value for name, value in known.items()}

    @classmethod
    def _from(
        cls, arrays: Mapping[str, NDArray[Any]], prefix: str, darker: Sequence[Performance] = (), path: object = ""
    ) -> Performance:
        cells = {name: arrays[f"{prefix}cells_{name}"] for name in Cells.__dataclass_fields__}
        reference, calibration = (arrays[f"{prefix}{name}"] for name in ("reference", "calibration"))
        numbers = [arrays[f"{prefix}{name}"] for name in ("frequency_index", "longest_px", "level")]
        scenes = arrays.get(f"{prefix}scenes", np.asarray(0))  # 0 where they are many, or not known as in older files
        refuse_inconsistent(cells, path)
        _refuse_no_surface(reference, calibration, numbers, path)
        left_out = int(cells.pop("left_out"))
        surface = Surface(Cells(**cells, left_out=left_out), scenes=scenes_of(scenes, path))
        index, longest, level = int(numbers[0]), float(numbers[1]), float(numbers[2])
        table = arrays.get(f"{prefix}table")
        return cls(surface, reference, index, longest, level, darker, calibration, table)

    @classmethod
    def load(cls, path: str | Path) -> Performance:
        """Read what `save` wrote.

        Raises:
            InputError: the file is missing, broken or of another kind.
        """
        arrays = read_arrays(path)
        try:
            count = sum(name.startswith("darker") and name.endswith("_reference") for name in arrays)
            darker = [cls._from(arrays, f"darker{number}_", path=path) for number in range(count)]
            return cls._from(arrays, "", darker, path)
        except (InputError, TypeError, ValueError, np.linalg.LinAlgError) as error:
            raise InputError(str(error) if str(path) in str(error) else f"{path}: {error}") from None
        except KeyError as error:
            raise InputError(
                f"{path}: array {error} is missing; expected a surface for control as the stage control_surface "
                "writes it"
            ) from None


def _refuse_no_surface(
    reference: NDArray[Any], calibration: NDArray[Any], numbers: Sequence[NDArray[Any]], path: object
) -> None:
    """Refuse arrays, read from a file, that do not describe what a surface was measured with.

    Raises:
        InputError: names the file, the array and what was expected.
    """
    for name, values in (("reference", reference), ("calibration", calibration)):
        if values.dtype.kind not in "iuf":
            raise InputError(f"{path}: array '{name}' holds {values.dtype}, expected numbers")
    rising = calibration.ndim == 2 and calibration.shape[0] == 2 and calibration.shape[1] > 0
    rising = rising and bool((np.diff(calibration, axis=1) > 0).all() and (calibration > 0).all())
    index, longest_px, level = (float(value) if value.shape == () else np.nan for value in numbers)
    for name, good, expected in (
        ("reference", reference.shape == (2, 8) and bool((reference > 0).all()), "(2, 8) numbers above 0"),
        ("calibration", rising, "(2, K) rising numbers above 0"),
        ("frequency_index", index in range(8), "a whole number in 0..7"),
        ("longest_px", longest_px > 0 and np.isfinite(longest_px), "a number above 0"),
        ("level", 0 < level < 1, "a number in (0, 1)"),
    ):
        if not good:
            raise InputError(f"{path}: array '{name}': expected {expected}")


def limited(ap_percent: Floats) -> Floats:
    """Average precision in 0..100: the slope on plateaus (`monotonic`) may carry it below 0."""
    return np.clip(ap_percent, 0.0, 100.0)


def monotonic(table: Floats) -> Floats:
    """Values that neither rise with noise (rows) nor with motion (columns), nearest in between.

    The mean of the largest such table below the values and the smallest one above; refused entries stay NaN. A small
    slope decides on plateaus: less noise and less motion are better. A plateau at 0 slopes below it.
    """
    known = np.isfinite(table)
    below = np.where(known, table, np.inf)
    above = np.where(known, table, -np.inf)
    for axis in (0, 1):
        below = np.minimum.accumulate(below, axis=axis)
        above = np.flip(np.maximum.accumulate(np.flip(above, axis), axis=axis), axis)
    rows, columns = np.indices(table.shape)
    with np.errstate(invalid="ignore"):  # no finite entry on one side
        return np.where(known, (below + above) / 2 - PLATEAU_SLOPE * (rows + columns), np.nan)


def _stops_below_white(level: ArrayLike) -> Floats:
    return np.asarray(-np.log2(np.maximum(np.asarray(level, dtype=float), 1e-6)))


def _position(values: Floats, knots: Floats) -> tuple[NDArray[np.int64], Floats]:
    """Index of the knot below each value, and the fraction of the way to the next."""
    index = np.clip(np.searchsorted(knots, values, side="right") - 1, 0, len(knots) - 2)
    return index, np.clip((values - knots[index]) / (knots[index + 1] - knots[index]), 0.0, 1.0)


def _next(values: Floats, share: Floats) -> Floats:
    """Values times share; a neighbour that counts nothing does not carry its NaN over."""
    return np.where(share > _EDGE, values * share, 0.0)
