"""Nelder and Mead's simplex search (1965), one evaluation at a time, for objectives that cost a captured frame.

Textbook coefficients: reflection 1, expansion 2, contraction 1/2, shrink 1/2. The search is a generator: it yields the
next point and is sent the objective there, so that a camera's frames can be its evaluations.
"""

from __future__ import annotations

from collections.abc import Generator

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError

Point = NDArray[np.float64]


def search(
    simplex: NDArray[np.float64], tolerance: float = 1e-5, evaluations: int = 50
) -> Generator[Point, float, tuple[Point, float]]:
    """Minimise a function over the unit square or any box; points are clipped to [0, 1].

    Args:
        simplex: (n + 1, n) starting points in [0, 1].
        tolerance: stop when worst and best differ by less.
        evaluations: at most so many; at least one for each starting point.

    Yields:
        (n,) the next point; `send` the objective there.

    Returns:
        the best point and its objective.

    Raises:
        InputError: fewer evaluations than starting points.
    """
    points = np.clip(np.array(simplex, dtype=np.float64), 0.0, 1.0)
    if evaluations < len(points):
        raise InputError(f"search: evaluations is {evaluations!r}; expected at least {len(points)}, one for each start")
    values = np.empty(len(points))
    used = 0
    for index in range(len(points)):
        values[index] = yield points[index]
        used += 1
    while used < evaluations:
        order = np.argsort(values, kind="stable")
        points, values = points[order], values[order]
        if values[-1] - values[0] < tolerance:
            break
        centre = points[:-1].mean(axis=0)
        reflected = np.clip(2.0 * centre - points[-1], 0.0, 1.0)
        value = yield reflected
        used += 1
        if value < values[0] and used < evaluations:
            expanded = np.clip(3.0 * centre - 2.0 * points[-1], 0.0, 1.0)
            further = yield expanded
            used += 1
            points[-1], values[-1] = (expanded, further) if further < value else (reflected, value)
        elif value < values[-2]:
            points[-1], values[-1] = reflected, value
        elif used < evaluations:
            outside = value < values[-1]
            towards = reflected if outside else points[-1]
            contracted = 0.5 * (centre + towards)
            nearer = yield contracted
            used += 1
            if nearer < min(value, values[-1]):
                points[-1], values[-1] = contracted, nearer
                continue
            for index in range(1, len(points)):
                if used >= evaluations:
                    break
                points[index] = 0.5 * (points[0] + points[index])
                values[index] = yield points[index]
                used += 1
    best = int(np.argmin(values))
    return points[best], float(values[best])
