"""Courses of bricks, stones, tiles or planks: a periodic lattice with joints and a tone for every piece."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.scenes.textures.noise import power_noise

Array = NDArray[np.float32]


@dataclass(frozen=True)
class Courses:
    """A lattice laid over a (S, S) tile.

    Attributes:
        body: (S, S) 1 inside a piece, 0 in a joint, soft between.
        tone: (S, S) one random value per piece, normal with the tails cut off.
        along: (S, S) 0..1 across a piece in u.
        up: (S, S) 0..1 across a piece in v.
    """

    body: Array
    tone: Array
    along: Array
    up: Array


def lay(
    generator: np.random.Generator,
    size_px: int,
    columns: int,
    rows: int,
    joint: float,
    shift: float = 0.5,
    ragged: float = 0.0,
) -> Courses:
    """Lays courses, every other row shifted.

    Args:
        generator: random numbers.
        size_px: side of the tile.
        columns: pieces in a row.
        rows: number of rows; even if `shift` is not 0, so that the tile repeats.
        joint: half width of a joint, as a part of the tile.
        shift: part of a piece by which odd rows are moved.
        ragged: standard deviation of a smooth warp of the lattice, as a part of the tile.
    """
    grid = (np.arange(size_px, dtype=np.float32) + np.float32(0.5)) / np.float32(size_px)
    warp_v = power_noise(generator, size_px, 1.2) * np.float32(ragged)
    warp_u = power_noise(generator, size_px, 1.2) * np.float32(ragged)
    v = (grid[:, None] + warp_v) * np.float32(rows)
    row = np.floor(v).astype(np.int32)
    u = (grid[None] + warp_u) * np.float32(columns) + np.float32(shift) * (row % 2).astype(np.float32)
    column = np.floor(u).astype(np.int32)
    along, up = u - column, v - row
    to_joint_u = (1 - np.abs(along - np.float32(0.5)) * 2) / np.float32(2 * columns)
    to_joint_v = (1 - np.abs(up - np.float32(0.5)) * 2) / np.float32(2 * rows)
    body = np.clip(np.minimum(to_joint_u, to_joint_v) / np.float32(joint) - np.float32(0.6), 0, 1)
    # one very bright piece would show where the tile repeats
    tones = np.clip(generator.standard_normal((rows, columns), dtype=np.float32), -2, 1.6)
    tone = tones[row % rows, column % columns]
    return Courses(body.astype(np.float32), tone.astype(np.float32), along.astype(np.float32), up.astype(np.float32))
