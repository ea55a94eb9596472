"""The shape of a car: one loft along its length, wheel arches cut out of it, and the curves that paint refers to."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import PchipInterpolator

from pipeline.errors import InputError, did_you_mean
from pipeline.scenes.mesh import Mesh, join, soup
from pipeline.scenes.objects.car_types import CAR_TYPES, CarType
from pipeline.scenes.shapes import skin, vertex_normals

Array = NDArray[np.float64]

ARCH_GAP_M = 0.055
_WELL_DEPTH_M = 0.26
# Width of the body along its length, as a part of the full width: rounded corners at both ends.
_PLAN = np.array(
    [
        [0, 0.70], [0.004, 0.79], [0.012, 0.865], [0.03, 0.925], [0.07, 0.97], [0.16, 1.0], [0.82, 1.0],
        [0.93, 0.975], [0.975, 0.935], [0.992, 0.875], [1, 0.76],
    ]
)  # fmt: skip
_UNDERSIDE = np.array([[0, 0.34], [0.012, 0.26], [0.05, 0.20], [0.95, 0.20], [0.985, 0.27], [1, 0.36]])
# Half of a section below the belt, from the middle of the floor: parts of the half width, parts of the height.
_FLANK = np.array(
    [
        [0, 0], [0.45, 0], [0.82, 0], [0.94, 0.045], [0.978, 0.12], [0.995, 0.30], [1.0, 0.46], [0.999, 0.62],
        [0.992, 0.78], [0.978, 0.90], [0.955, 1.0],
    ]
)  # fmt: skip
# Above the belt: parts of the height of the glasshouse, and how much the roof rail is rounded off there, metres.
_CABIN = np.array([[0.12, 0.004], [0.3, 0.004], [0.5, 0.006], [0.68, 0.012], [0.82, 0.03], [0.91, 0.07], [0.97, 0.14]])
_CROWN = np.array([[0.66, 0.005], [0.33, 0.001], [0.0, 0.0]])


@dataclass(frozen=True)
class CarBody:
    """One car's shape. Coordinates: x forward with the origin at mid length, y left, z up from the road, metres.

    Attributes:
        kind: name of the type.
        type: its proportions.
        length_m: of this car.
        width_m: of this car, without mirrors.
        rise: factor on all heights above the sills.
    """

    kind: str
    type: CarType
    length_m: float
    width_m: float
    rise: float

    @classmethod
    def draw(cls, kind: str, generator: np.random.Generator) -> CarBody:
        """A car of a kind, 5 % longer or shorter, 3 % wider or higher than its type.

        Raises:
            InputError: no such kind.
        """
        if kind not in CAR_TYPES:
            raise InputError(f"car kind '{kind}' is unknown; {did_you_mean(kind, CAR_TYPES)}")
        shape = CAR_TYPES[kind]
        long, wide, high = generator.uniform((0.96, 0.975, 0.97), (1.05, 1.03, 1.035))
        return cls(kind, shape, shape.length_m * float(long), shape.width_m * float(wide), float(high))

    @cached_property
    def _top(self) -> PchipInterpolator:
        along, height = np.asarray(self.type.top).T
        return PchipInterpolator(along, height * self.rise)

    def along(self, x: ArrayLike) -> Array:
        """Fraction t of the length at x: 0 at the nose, 1 at the tail, clipped."""
        return np.clip(0.5 - np.asarray(x, np.float64) / self.length_m, 0.0, 1.0)

    def x(self, along: ArrayLike) -> Array:
        """Position x at the fraction t."""
        return np.asarray((0.5 - np.asarray(along, np.float64)) * self.length_m)

    def top_m(self, along: ArrayLike) -> Array:
        """Height of the upper contour."""
        return np.asarray(self._top(along))

    def belt_m(self, along: ArrayLike) -> Array:
        """Height of the belt line (lower edge of the side windows)."""
        front, rear = self.type.belt_m
        return np.asarray((front + (rear - front) * np.asarray(along, np.float64)) * self.rise)

    @property
    def roof_m(self) -> float:
        """Height of the highest point."""
        return max(height for _, height in self.type.top) * self.rise

    @property
    def axles_m(self) -> tuple[float, float]:
        """Positions x of the front and of the rear axle."""
        front, rear = self.x(self.type.axles)
        return float(front), float(rear)

    def sections(self) -> Array:
        """Closed cross-sections (M, N, 3), nose to tail."""
        ends = np.array([0, 0.002, 0.005, 0.009, 0.014, 0.021])
        along = np.unique(np.concatenate([ends, np.linspace(0.03, 0.97, 72), 1 - ends]))
        half = self.width_m / 2 * PchipInterpolator(*_PLAN.T)(along)
        floor = PchipInterpolator(*_UNDERSIDE.T)(along)
        top = self.top_m(along)
        belt = np.minimum(self.belt_m(along), top - 0.045)
        cabin = (top - belt)[:, None]
        low_y = half[:, None] * _FLANK[:, 0]
        low_z = floor[:, None] + (belt - floor)[:, None] * _FLANK[:, 1]
        rounding = _CABIN[:, 1] * np.minimum(1.0, cabin / 0.3 + 0.35)
        high_y = half[:, None] * 0.955 - self.type.tumble * cabin * _CABIN[:, 0] - rounding
        high_z = belt[:, None] + cabin * _CABIN[:, 0]
        crown_y, crown_z = high_y[:, -1:] * _CROWN[:, 0], top[:, None] - _CROWN[:, 1]
        y = np.concatenate([low_y, high_y, crown_y], axis=1)
        z = np.concatenate([low_z, high_z, crown_z], axis=1)
        # wings swell a little round the wheels
        from_axle = self.x(along)[:, None] - np.array(self.axles_m)
        swell = np.exp(-((from_axle / (1.25 * self.type.wheel_m)) ** 2)).sum(axis=1)
        y = y + 0.014 * swell[:, None] * np.exp(-(((z - 0.55) / 0.22) ** 2)) * (y > 0.3)
        around = y.shape[1]
        x = np.repeat(self.x(along)[:, None], 2 * around - 2, axis=1)
        return np.stack(
            [x, np.concatenate([y, -y[:, -2:0:-1]], axis=1), np.concatenate([z, z[:, -2:0:-1]], axis=1)], axis=-1
        )

    def mesh(self, arches: bool = True) -> Mesh:
        """The painted body ("car_body") with black wheel wells, closed.

        Args:
            arches: cut wheel wells; if the boolean library is absent or refuses, the body stays uncut.
        """
        sections = self.sections()
        apexes = sections[[0, -1]].mean(axis=1)
        apexes[:, 0] += (0.012, -0.012)
        vertices, faces = skin(sections, apexes)
        normals = vertex_normals(vertices, faces)
        cut = self._cut(vertices, faces, normals) if arches else None
        return soup(vertices, faces, "car_body", normals) if cut is None else cut

    def _cut(self, vertices: Array, faces: NDArray[np.int64], normals: Array) -> Mesh | None:
        """Difference of the body and four cylinders, or None if it cannot be had."""
        try:
            from manifold3d import Error, Manifold
            from manifold3d import Mesh as Solid
        except ImportError:
            return None
        properties = np.concatenate([vertices, normals], axis=1).astype(np.float32)
        body = Manifold(Solid(vert_properties=properties, tri_verts=faces.astype(np.uint32))).as_original()
        if body.status() != Error.NoError:
            return None
        painted = body.original_id()
        radius = self.type.wheel_m + ARCH_GAP_M
        well = Manifold.cylinder(2 * _WELL_DEPTH_M, radius, radius, 44, True).rotate([90, 0, 0])
        for x in self.axles_m:
            for side in (1, -1):
                body = body - well.translate([x, side * self.width_m / 2, self.type.wheel_m])
        cut = body.to_mesh()
        corners = np.asarray(cut.tri_verts, np.int64)
        values = np.asarray(cut.vert_properties, np.float64)
        run_end = np.asarray(cut.run_index[1:]) // 3
        origin = np.repeat(np.asarray(cut.run_original_id), np.diff(np.concatenate([[0], run_end])))
        outer, inner = corners[origin == painted], corners[origin != painted]
        if not len(inner) or values.shape[1] < 6:
            return None
        length = np.linalg.norm(values[:, 3:], axis=1, keepdims=True)
        skin_mesh = soup(values[:, :3], outer, "car_body", values[:, 3:] / np.maximum(length, 1e-9))
        # where interpolated normals lie (slivers of the cut), flat ones are right
        flat = np.cross(
            skin_mesh.position[:, 1] - skin_mesh.position[:, 0], skin_mesh.position[:, 2] - skin_mesh.position[:, 0]
        )
        flat /= np.linalg.norm(flat, axis=1, keepdims=True)
        wrong = np.einsum("fcx,fx->fc", skin_mesh.normal, flat).min(axis=1) < 0.3
        normal = np.where(wrong[:, None, None], flat[:, None], skin_mesh.normal)
        return join([replace(skin_mesh, normal=normal.astype(np.float32)), soup(values[:, :3], inner, "black")])
