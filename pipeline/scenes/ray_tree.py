"""Where rays meet triangles, through a tree of bounding boxes: the same answers on every processor.

The tree is a bounding volume hierarchy split by the surface area heuristic over bins (Wald 2007); where a ray meets a
triangle is computed after Möller and Trumbore (1997). All of it is double precision, compiled by Numba without fast
math, so that every operation is rounded as IEEE 754 has it and no multiplication is joined with an addition. Embree is
two to three times as fast, but its trees and approximate reciprocals differ between processors: 7 to 50 of the four
million rays of a frame met another triangle, and all that reads the frames differed. Tests compare with Embree.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float32]
Doubles = NDArray[np.float64]
Indices = NDArray[np.int64]
Integers = NDArray[np.int32]
Booleans = NDArray[np.bool_]
Function = TypeVar("Function", bound=Callable[..., Any])

_BINS = 8
_LARGEST_LEAF = 8  # triangles; beyond it a box is split even where the heuristic sees no gain
_STEP_COST = 2.0  # of descending one level, in tests of a triangle
_BALANCED_FROM = 64  # levels, from which halves are of equal numbers; a street of a million triangles has about 40
_DEEPEST = 128  # boxes waiting at once, one a level: those 64, and 31 that halve the most triangles there can be
_SLACK = 1.0 + 1e-12  # rounding of where a ray enters and leaves a box


def _compiled(function: Function) -> Function:
    """The function in machine code, kept beside the module, else in the user's cache, else for this process only."""
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy"}
    try:
        compiled: Any = numba.njit(cache=True, **options)(function)
    except RuntimeError:  # neither folder can be written
        compiled = numba.njit(**options)(function)
    return cast(Function, compiled)


class RayTree:
    """Triangles, ready for rays."""

    def __init__(self, triangles: Array) -> None:
        """Build the tree.

        Args:
            triangles: (F, 3, 3) corners, finite numbers; F at least 1.
        """
        count = len(triangles)
        low, high = triangles.min(axis=1), triangles.max(axis=1)
        boxes = np.empty((2 * count, 6), np.float32)
        begin = np.empty(2 * count, np.int32)
        number = np.empty(2 * count, np.int32)
        order = np.arange(count, dtype=np.int32)
        size = _build(low, high, boxes, begin, number, order)
        self._boxes, self._begin, self._number = boxes[:size].copy(), begin[:size].copy(), number[:size].copy()
        self._order = order
        self._corners = triangles[order].reshape(count, 9)

    def first(self, origin: Array, direction: Array) -> tuple[Indices, Doubles, Doubles, Doubles]:
        """The triangle that each ray meets first, from either side.

        Args:
            origin: (K, 3) float32 where the rays begin.
            direction: (K, 3) float32 unit vectors.

        Returns:
            (K,) row of the triangle, or -1; (K,) barycentric weights u and v of its second and third corner; (K,)
            distance along the ray, greater than 0, infinite where nothing is met.
        """
        count = len(direction)
        place, distance = np.empty(count, np.int64), np.empty(count)
        u, v = np.zeros(count), np.zeros(count)
        _first(self._boxes, self._begin, self._number, self._corners, origin, direction, place, u, v, distance)
        return np.where(place >= 0, self._order[place], -1), u, v, distance

    def any(self, origin: Array, direction: Array, reach_m: float = np.inf) -> Booleans:
        """Whether each ray meets a triangle nearer than `reach_m`.

        Args:
            origin: (K, 3) float32.
            direction: (K, 3) float32 unit vectors.
            reach_m: how far to look.
        """
        met = np.empty(len(direction), np.bool_)
        _any(self._boxes, self._begin, self._number, self._corners, origin, direction, reach_m, met)
        return met


@_compiled
def _half_surface(box: Doubles) -> float:
    """Half the surface of a box (lowest, then highest corner)."""
    width, depth, height = box[3] - box[0], box[4] - box[1], box[5] - box[2]
    return float(width * depth + depth * height + height * width)


@_compiled
def _bin(low: float, high: float, base: float, extent: float) -> int:
    """The bin of a triangle along an axis, by the middle of its box (twice the middle, which is exact)."""
    return min(int((np.float64(low) + np.float64(high) - base) * (_BINS / extent)), _BINS - 1)


@_compiled
def _join(box: Doubles, other: Doubles) -> None:
    """Widen a box to hold another."""
    for axis in range(3):
        box[axis] = min(box[axis], other[axis])
        box[axis + 3] = max(box[axis + 3], other[axis + 3])


@_compiled
def _clear(box: Doubles) -> None:
    """Make a box hold nothing."""
    box[:3], box[3:] = np.inf, -np.inf


@_compiled
def _best_split(
    low: Array, high: Array, rows: Integers, base: Doubles, extent: Doubles, parts: Doubles, filled: Indices,
    above: Doubles,
) -> tuple[float, int, int]:  # fmt: skip
    """The cheapest of the boundaries between bins of all axes: its cost, its axis and the last bin below it.

    The cost is the sum over both sides of half the surface times the number of triangles. ``parts`` (B, 6), ``filled``
    and ``above`` (B,) are room to work in. The axis is -1 where all triangles have one middle.
    """
    best, best_axis, best_bin = np.inf, -1, 0
    side = np.empty(6)
    for axis in range(3):
        if extent[axis] <= 0.0:
            continue
        filled[:] = 0
        for chosen in range(_BINS):
            _clear(parts[chosen])
        for row in rows:
            chosen = _bin(low[row, axis], high[row, axis], base[axis], extent[axis])
            filled[chosen] += 1
            part = parts[chosen]
            for other in range(3):
                part[other] = min(part[other], np.float64(low[row, other]))
                part[other + 3] = max(part[other + 3], np.float64(high[row, other]))
        _clear(side)
        count = 0
        for chosen in range(_BINS - 1, 0, -1):
            _join(side, parts[chosen])
            count += filled[chosen]
            above[chosen] = count * _half_surface(side) if count else 0.0
        _clear(side)
        count = 0
        for chosen in range(_BINS - 1):
            _join(side, parts[chosen])
            count += filled[chosen]
            if 0 < count < len(rows):
                cost = count * _half_surface(side) + above[chosen + 1]
                if cost < best:
                    best, best_axis, best_bin = cost, axis, chosen
    return best, best_axis, best_bin


@_compiled
def _partition(low: Array, high: Array, rows: Integers, axis: int, chosen: int, base: float, extent: float) -> int:
    """Bring the triangles of bins up to ``chosen`` to the front; returns how many they are."""
    front, back = 0, len(rows) - 1
    while front <= back:
        row = rows[front]
        if _bin(low[row, axis], high[row, axis], base, extent) <= chosen:
            front += 1
        else:
            rows[front], rows[back] = rows[back], row
            back -= 1
    return front


@_compiled
def _build(low: Array, high: Array, boxes: Array, begin: Integers, number: Integers, order: Integers) -> int:
    """Fill the tree from the boxes (F, 3) of triangles; returns how many boxes it has.

    Box k is ``boxes[k]`` (lowest, then highest corner). A leaf holds the ``number[k]`` triangles from
    ``order[begin[k]]`` on; where that number is 0, boxes ``begin[k]`` and ``begin[k] + 1`` are its parts.
    """
    waiting, levels = np.empty(_DEEPEST, np.int64), np.empty(_DEEPEST, np.int64)
    base, extent = np.empty(3), np.empty(3)
    parts, filled, above = np.empty((_BINS, 6)), np.empty(_BINS, np.int64), np.empty(_BINS)
    begin[0], number[0], waiting[0], levels[0] = 0, len(order), 0, 0
    top, size = 1, 1
    while top > 0:
        top -= 1
        box, level = waiting[top], levels[top]
        start, count = begin[box], number[box]
        for axis in range(3):
            lowest, highest, first, last = np.inf, -np.inf, np.inf, -np.inf
            for row in order[start : start + count]:
                one, other = np.float64(low[row, axis]), np.float64(high[row, axis])
                lowest, highest = min(lowest, one), max(highest, other)
                first, last = min(first, one + other), max(last, one + other)
            boxes[box, axis], boxes[box, axis + 3] = lowest, highest
            base[axis], extent[axis] = first, last - first
        if count <= 2:
            continue
        cost, axis, chosen = _best_split(low, high, order[start : start + count], base, extent, parts, filled, above)
        if count <= _LARGEST_LEAF:
            sides = _half_surface(boxes[box].astype(np.float64))
            if axis < 0 or cost + _STEP_COST * sides >= count * sides:
                continue
        middle = start + count // 2  # where all triangles have one middle
        if axis >= 0 and level < _BALANCED_FROM:
            middle = start + _partition(low, high, order[start : start + count], axis, chosen, base[axis], extent[axis])
        begin[size], number[size] = start, middle - start
        begin[size + 1], number[size + 1] = middle, start + count - middle
        begin[box], number[box] = size, 0
        waiting[top], waiting[top + 1] = size, size + 1
        levels[top], levels[top + 1] = level + 1, level + 1
        top, size = top + 2, size + 2
    return size


@_compiled
def _per(component: float) -> float:
    """1 / component of a direction; very large where the component is 0, so that products stay numbers."""
    return 1.0 / max(component, 1e-30) if component >= 0.0 else 1.0 / min(component, -1e-30)


@_compiled
def _within(
    boxes: Array, box: int, x: float, y: float, z: float, per_x: float, per_y: float, per_z: float
) -> tuple[float, float]:
    """Distances along a ray at which it enters a box (at least 0) and leaves it, the rounding of both allowed for."""
    one, other = (boxes[box, 0] - x) * per_x, (boxes[box, 3] - x) * per_x
    near, far = (one, other) if one < other else (other, one)
    one, other = (boxes[box, 1] - y) * per_y, (boxes[box, 4] - y) * per_y
    low, high = (one, other) if one < other else (other, one)
    near, far = low if low > near else near, high if high < far else far
    one, other = (boxes[box, 2] - z) * per_z, (boxes[box, 5] - z) * per_z
    low, high = (one, other) if one < other else (other, one)
    near, far = low if low > near else near, high if high < far else far
    return near if near > 0.0 else 0.0, far * _SLACK


@_compiled
def _meet(
    corners: Array, place: int, x: float, y: float, z: float, dx: float, dy: float, dz: float
) -> tuple[float, float, float]:
    """Where the ray o + t d meets the triangle p0, p1, p2: t, u and v, or t = -1.

    With e1 = p1 - p0, e2 = p2 - p0, s = o - p0, h = d x e2 and q = s x e1: t = e2.q / e1.h, u = s.h / e1.h,
    v = d.q / e1.h, in the triangle where u >= 0, v >= 0 and u + v <= 1.
    """
    px, py, pz = np.float64(corners[place, 0]), np.float64(corners[place, 1]), np.float64(corners[place, 2])
    ax, ay, az = corners[place, 3] - px, corners[place, 4] - py, corners[place, 5] - pz
    bx, by, bz = corners[place, 6] - px, corners[place, 7] - py, corners[place, 8] - pz
    hx, hy, hz = dy * bz - dz * by, dz * bx - dx * bz, dx * by - dy * bx
    determinant = ax * hx + ay * hy + az * hz
    if determinant == 0.0:  # the ray lies in the plane, or the triangle has no area
        return -1.0, 0.0, 0.0
    per = 1.0 / determinant
    sx, sy, sz = x - px, y - py, z - pz
    u = (sx * hx + sy * hy + sz * hz) * per
    if not 0.0 <= u <= 1.0:
        return -1.0, 0.0, 0.0
    qx, qy, qz = sy * az - sz * ay, sz * ax - sx * az, sx * ay - sy * ax
    v = (dx * qx + dy * qy + dz * qz) * per
    if not (v >= 0.0 and u + v <= 1.0):
        return -1.0, 0.0, 0.0
    return (bx * qx + by * qy + bz * qz) * per, u, v


@_compiled
def _first(
    boxes: Array, begin: Integers, number: Integers, corners: Array, origin: Array, direction: Array,
    met: Indices, weight_u: Doubles, weight_v: Doubles, distance: Doubles,
) -> None:  # fmt: skip
    """`RayTree.first`: places in `corners`, weights and distances are written to the last four arguments."""
    waiting, entered = np.empty(_DEEPEST, np.int32), np.empty(_DEEPEST)
    for ray in range(len(direction)):
        x, y, z = np.float64(origin[ray, 0]), np.float64(origin[ray, 1]), np.float64(origin[ray, 2])
        dx, dy, dz = np.float64(direction[ray, 0]), np.float64(direction[ray, 1]), np.float64(direction[ray, 2])
        per_x, per_y, per_z = _per(dx), _per(dy), _per(dz)
        best, found, best_u, best_v = np.inf, -1, 0.0, 0.0
        waiting[0], entered[0], top = 0, 0.0, 1
        while top > 0:
            top -= 1
            if entered[top] >= best:
                continue
            box = waiting[top]
            start, count = begin[box], number[box]
            if count > 0:
                for place in range(start, start + count):
                    t, u, v = _meet(corners, place, x, y, z, dx, dy, dz)
                    if 0.0 < t < best:
                        best, found, best_u, best_v = t, place, u, v
                continue
            near, far = _within(boxes, start, x, y, z, per_x, per_y, per_z)
            other_near, other_far = _within(boxes, start + 1, x, y, z, per_x, per_y, per_z)
            met_one, met_other = near <= far and near < best, other_near <= other_far and other_near < best
            # the nearer one is looked at first, so it is put on top
            if met_one and met_other and near <= other_near:
                waiting[top], entered[top] = start + 1, other_near
                waiting[top + 1], entered[top + 1] = start, near
                top += 2
            else:
                if met_one:
                    waiting[top], entered[top] = start, near
                    top += 1
                if met_other:
                    waiting[top], entered[top] = start + 1, other_near
                    top += 1
        met[ray], weight_u[ray], weight_v[ray], distance[ray] = found, best_u, best_v, best


@_compiled
def _any(
    boxes: Array, begin: Integers, number: Integers, corners: Array, origin: Array, direction: Array, reach_m: float,
    met: Booleans,
) -> None:  # fmt: skip
    """`RayTree.any`, written to `met`."""
    waiting = np.empty(_DEEPEST, np.int32)
    for ray in range(len(direction)):
        x, y, z = np.float64(origin[ray, 0]), np.float64(origin[ray, 1]), np.float64(origin[ray, 2])
        dx, dy, dz = np.float64(direction[ray, 0]), np.float64(direction[ray, 1]), np.float64(direction[ray, 2])
        per_x, per_y, per_z = _per(dx), _per(dy), _per(dz)
        waiting[0], top, found = 0, 1, False
        while top > 0 and not found:
            top -= 1
            box = waiting[top]
            start, count = begin[box], number[box]
            if count > 0:
                for place in range(start, start + count):
                    if 0.0 < _meet(corners, place, x, y, z, dx, dy, dz)[0] < reach_m:
                        found = True
                        break
                continue
            near, far = _within(boxes, start, x, y, z, per_x, per_y, per_z)
            other_near, other_far = _within(boxes, start + 1, x, y, z, per_x, per_y, per_z)
            met_one, met_other = near <= far and near < reach_m, other_near <= other_far and other_near < reach_m
            if met_one and met_other and near <= other_near:
                waiting[top], waiting[top + 1] = start + 1, start
                top += 2
            else:
                if met_one:
                    waiting[top] = start
                    top += 1
                if met_other:
                    waiting[top] = start + 1
                    top += 1
        met[ray] = found
