"""Painting with analytic filtering: what a pixel sees of lines, edges and gratings finer than itself.

Each mask is the box-filtered indicator: the part of an interval of the footprint's width that is covered.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.scenes.objects.base import Surface

Array = NDArray[np.float32]


def stripe(distance_m: ArrayLike, half_width_m: ArrayLike, footprint_m: ArrayLike) -> Array:
    """Coverage in [0, 1] of a line of half width h at signed distance d, seen through a box of width f.

    ``max(0, min(d + f/2, h) - max(d - f/2, -h)) / f``
    """
    distance = np.asarray(distance_m, np.float32)
    half = np.asarray(half_width_m, np.float32)
    width = np.maximum(np.asarray(footprint_m, np.float32), np.float32(1e-6))
    overlap = np.minimum(distance + width / 2, half) - np.maximum(distance - width / 2, -half)
    return np.clip(overlap / width, 0, 1).astype(np.float32)


def beyond(distance_m: ArrayLike, footprint_m: ArrayLike) -> Array:
    """Coverage of the half plane distance > 0: ``clip(d / f + 1/2, 0, 1)``."""
    width = np.maximum(np.asarray(footprint_m, np.float32), np.float32(1e-6))
    return np.clip(np.asarray(distance_m, np.float32) / width + np.float32(0.5), 0, 1).astype(np.float32)


def grating(value_m: ArrayLike, period_m: float, part: float, footprint_m: ArrayLike) -> Array:
    """Coverage of bars that fill `part` of each period, each in the middle of its period.

    ``(I(v + f/2) - I(v - f/2)) / f`` with I the integral of the bars, so distant gratings fade to `part`.
    """
    value = np.asarray(value_m, np.float64) / period_m
    width = np.maximum(np.asarray(footprint_m, np.float64) / period_m, 1e-6)
    covered = _bars(value + width / 2, part) - _bars(value - width / 2, part)
    return np.clip(covered / width, 0, 1).astype(np.float32)


def _bars(place: NDArray[np.float64], part: float) -> NDArray[np.float64]:
    """Integral of bars of unit period from 0 to a place."""
    whole = np.floor(place)
    return np.asarray(whole * part + np.clip(place - whole - 0.5 * (1 - part), 0, part))


@dataclass
class Coat:
    """Albedo and reflectance being painted, layer over layer.

    Attributes:
        albedo: (K,) in (0, 1).
        f0: (K,) mirror reflectance at normal incidence.
    """

    albedo: Array
    f0: Array

    @classmethod
    def plain(cls, count: int, albedo: float, f0: float) -> Coat:
        """One colour everywhere."""
        return cls(np.full(count, albedo, np.float32), np.full(count, f0, np.float32))

    def lay(self, mask: ArrayLike, albedo: ArrayLike, f0: ArrayLike = 0.0) -> None:
        """Mixes a colour in: mask (K,) in [0, 1] or bool; colours are numbers or (K,)."""
        cover = np.asarray(mask, np.float32)
        self.albedo += (np.asarray(albedo, np.float32) - self.albedo) * cover
        self.f0 += (np.asarray(f0, np.float32) - self.f0) * cover

    def result(self) -> tuple[Array, Array]:
        """What a painter answers, kept within (0, 1) and [0, 1]."""
        return np.clip(self.albedo, 0.004, 0.95).astype(np.float32), np.clip(self.f0, 0, 1).astype(np.float32)


@dataclass(frozen=True)
class Flat:
    """Painter of one colour.

    Attributes:
        albedo: in (0, 1).
        f0: in [0, 1].
    """

    albedo: float
    f0: float = 0.0

    def __call__(self, surface: Surface) -> tuple[Array, Array]:
        """The same answer at every point."""
        return Coat.plain(len(surface.local), self.albedo, self.f0).result()
