"""Radiance of rendered viewpoints with their boxes, for cameras that look at them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.datasets.frame import Box
from pipeline.datasets.sim import NAME, NOTHING_IGNORED, Sim
from pipeline.errors import InputError
from pipeline.store import read_arrays

SPLIT = "evaluation"
SUN_RADIANCE = 400.0


@dataclass(frozen=True)
class View:
    """One rendered moment of one viewpoint.

    Attributes:
        name: of the frame.
        viewpoint: it belongs to.
        moment: 0..3.
        path: of its radiance.
        boxes: labelled objects.
    """

    name: str
    viewpoint: str
    moment: int
    path: Path
    boxes: tuple[Box, ...]

    def radiance(self) -> NDArray[np.float32]:
        """(H, W) linear radiance."""
        return radiance_at(self.path)


@lru_cache(maxsize=64)  # every moment of a fold, 3 MB each: a worker returns to them at every step
def radiance_at(path: Path) -> NDArray[np.float32]:
    """(H, W) linear radiance of a file that the stage `render_sim` wrote.

    Raises:
        InputError: it cannot be read or holds no radiance.
    """
    arrays = read_arrays(path)
    if "radiance" not in arrays:
        raise InputError(f"{path}: expected the array 'radiance'; render again with scenes.radiance=true")
    return arrays["radiance"].astype(np.float32)


def views(root: Path, moments: int | None = None) -> list[View]:
    """Rendered moments with radiance, by viewpoint and moment.

    Args:
        root: folder the stage `render_sim` writes, with a sub-folder ``evaluation``.
        moments: so many of every viewpoint, the first ones; None for all.

    Raises:
        InputError: no frame, or a frame without radiance.
    """
    results = []
    for frame in Sim("sim", root, split=SPLIT, moments="all", **NOTHING_IGNORED).frames():
        match = NAME.match(frame.name)
        path = frame.path.with_name(f"{frame.name}.radiance.npz")
        if match is None or frame.defect or (moments is not None and int(match["moment"]) >= moments):
            continue
        if not path.is_file():
            raise InputError(f"{path}: no such file; control needs linear radiance: render with scenes.radiance=true")
        results.append(View(frame.name, match["viewpoint"], int(match["moment"]), path, frame.boxes))
    if not results:
        raise InputError(f"{root / SPLIT}: no rendered frame; run the stage render_sim")
    return sorted(results, key=lambda view: (view.viewpoint, view.moment))


def folds(found: list[View], viewpoints: int, count: int = 2) -> list[list[View]]:
    """Viewpoints dealt to folds, so that each fold is controlled by a surface measured on the others.

    With at least two viewpoints for each fold, consecutive pairs stay together (a street and a village); with fewer,
    viewpoints are dealt singly. With fewer viewpoints than folds each viewpoint is a fold; a single one is controlled
    by its own surface.

    Args:
        found: `views`.
        viewpoints: used at most.
        count: folds at most.

    Returns:
        the views of each fold, as many folds as ``count`` or as there are viewpoints, whichever is fewer.
    """
    names = list(dict.fromkeys(view.viewpoint for view in found))[:viewpoints]
    count = min(count, len(names))
    parts: list[list[str]] = [[] for _ in range(count)]
    size = 2 if len(names) >= 2 * count else 1
    for number, name in enumerate(names):
        parts[(number // size) % count].append(name)
    return [[view for view in found if view.viewpoint in part] for part in parts]


def with_sun(radiance: NDArray[np.float32], radius_fraction: float) -> NDArray[np.float32]:
    """The radiance with a sun: a bright disc in the upper middle, radius as a fraction of the width."""
    if radius_fraction <= 0.0:
        return radiance
    height, width = radiance.shape
    y, x = np.ogrid[:height, :width]
    disc = (x - 0.6 * width) ** 2 + (y - 0.15 * height) ** 2 <= (radius_fraction * width) ** 2
    return np.where(disc, np.float32(SUN_RADIANCE), radiance)
