"""What is drawn on the ground: markings, wear, patches and mixtures of soils."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.scenes.field import field
from pipeline.scenes.objects.base import Surface
from pipeline.scenes.textures import library

Array = NDArray[np.float32]


@dataclass(frozen=True)
class RoadPaint:
    """Asphalt of a road: uv is (s, d), along the road and to the left of its centreline, metres.

    Attributes:
        half_width_m: centreline to kerb.
        lane_m: centreline to the middle of a driving lane.
        edge: lines along the parking lanes.
        crossing_m: s of a zebra crossing, or None.
        patch_m: s of the first repaired patch; they repeat every 37 m.
        manhole_m: s of the first manhole; they repeat every 29 m.
        shift: of the noise that wears the paint.
    """

    half_width_m: float
    lane_m: float = 1.75
    edge: bool = False
    crossing_m: float | None = None
    patch_m: float = 15.0
    manhole_m: float = 11.0
    shift: float = 0.0

    def __call__(self, surface: Surface) -> tuple[Array, Array]:
        """See `pipeline.scenes.objects.base.Painter`."""
        s, d = surface.uv[:, 0], surface.uv[:, 1]
        off = np.abs(d)
        # wheels polish and darken two tracks of each lane; parked cars leave oil
        tracks = np.exp(-(((np.abs(off - self.lane_m) - 0.75) / 0.35) ** 2))
        stains = field(surface.uv, surface.footprint_m, 9.0, self.shift + 0.2)
        albedo = surface.albedo * (1.0 - 0.22 * tracks) * np.exp(-0.22 * np.clip(stains - 0.8, 0.0, 2.0))
        patch = (np.abs(d + 1.9) < 1.1) & (np.abs(_phase(s, self.patch_m, 37.0)) < 2.4)
        albedo[patch] *= 0.66
        seam = np.flatnonzero(np.abs(off - 0.02 * np.sin(s * 0.9) - 0.28) < 0.012)
        albedo[seam] *= np.where(self._noise(surface, seam, 31.0, 0.6) > -0.3, 0.55, 1.0)
        marked = np.flatnonzero(self._marked(s, d))
        wear = np.clip(0.80 + 0.30 * self._noise(surface, marked, 1.7, self.shift), 0.0, 1.0)
        albedo[marked] = albedo[marked] * (1.0 - wear) + 0.62 * wear
        along = _phase(s, self.manhole_m, 29.0)
        radius = np.hypot(along, d + 0.4)
        lid = np.flatnonzero(radius < 0.33)
        cast = np.where(np.mod(s[lid] * 12.0, 1.0) < 0.35, 0.15, 0.09)
        albedo[lid] = np.where(radius[lid] > 0.30, 0.04, cast)
        # leaves and dust gather along the kerb
        near = np.flatnonzero(off > self.half_width_m - 0.35)
        dust = 1.0 - (self.half_width_m - off[near]) / 0.35
        albedo[near] *= 1.0 + 0.35 * dust * (self._noise(surface, near, 2.3, 0.4) > 0.0)
        return albedo.astype(np.float32), np.zeros(len(albedo), np.float32)

    def _marked(self, s: Array, d: Array) -> NDArray[np.bool_]:
        """(K,) where paint was laid: centre dashes, edge lines, the zebra crossing (which interrupts the others)."""
        off = np.abs(d)
        marked = (off < 0.07) & (np.mod(s, 6.0) < 3.0)
        if self.edge:
            marked |= np.abs(off - (self.half_width_m - 2.25)) < 0.05
        if self.crossing_m is not None:
            stripes = (np.mod(d + 0.25, 1.0) < 0.5) & (off < self.half_width_m - 0.3)
            near = np.abs(s - self.crossing_m)
            marked = np.where(near < 3.0, (near < 1.6) & stripes, marked)
        return np.asarray(marked, np.bool_)

    @staticmethod
    def _noise(surface: Surface, rows: NDArray[np.intp], size_m: float, shift: float) -> Array:
        """The 1/f field at some of the points only."""
        return field(surface.uv[rows], surface.footprint_m[rows], size_m, shift)


def _phase(value: Array, first: float, period: float) -> Array:
    """(K,) signed distance to the nearest of first, first + period, ..."""
    return np.mod(value - first + period / 2, period) - period / 2


@dataclass(frozen=True)
class SoilPaint:
    """Ground where a second soil shows through in patches, with a worn path and puddles of shade if wanted.

    Attributes:
        other: texture of the second soil.
        size_m: extent of the patches.
        bias: added to the noise before the logistic; larger shows more of the other soil.
        path: (P, 2) corners of a worn path, metres, or None.
        path_width_m: its half width.
        shift: of the noise.
    """

    other: str
    size_m: float = 11.0
    bias: float = -0.4
    path: tuple[tuple[float, float], ...] | None = None
    path_width_m: float = 1.3
    shift: float = 0.0

    def __call__(self, surface: Surface) -> tuple[Array, Array]:
        """See `pipeline.scenes.objects.base.Painter`."""
        noise = field(surface.uv, surface.footprint_m, self.size_m, self.shift)
        level = noise + self.bias
        if self.path is not None:
            distance = _to_path(surface.uv, np.asarray(self.path, np.float32))
            level = np.maximum(level, 3.0 * (1.0 - distance / (self.path_width_m * (1.0 + 0.3 * noise))))
        share = 1.0 / (1.0 + np.exp(np.clip(-5.0 * level, -30.0, 30.0)))
        other, _ = library()[self.other].sample(surface.uv, surface.footprint_m)
        broad = np.exp(0.15 * field(surface.uv, surface.footprint_m, 47.0, self.shift + 0.5))
        albedo = (surface.albedo * (1.0 - share) + other * share) * broad
        return albedo.astype(np.float32), np.zeros(len(albedo), np.float32)


def _to_path(points: Array, corners: Array) -> Array:
    """(K,) distance to the nearest segment of a polyline."""
    best = np.full(len(points), np.inf, np.float32)
    for a, b in itertools.pairwise(corners):
        way = b - a
        along = np.clip(((points - a) @ way) / max(float(way @ way), 1e-9), 0.0, 1.0)
        best = np.minimum(best, np.linalg.norm(points - a - along[:, None] * way, axis=1))
    return best
