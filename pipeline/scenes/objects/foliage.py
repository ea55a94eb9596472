"""Leaves: many small rhombic blades, folded along the midrib, lit from both sides."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.scenes.mesh import Mesh

Array = NDArray[np.float64]
_TILE_M = 6.0


def blades(
    generator: np.random.Generator,
    centres: ArrayLike,
    outward: ArrayLike,
    length_m: float,
    width: float = 0.42,
    upright: float = 0.5,
    hang: float = 0.0,
) -> Mesh:
    """Two triangles for every leaf, material "leaf".

    A leaf's plane is random but leans outwards and upwards; its shading normal is drawn towards the outward
    direction, so that a crown is shaded as a whole and not as confetti. Each leaf lies at a random place of
    its texture, so leaves differ in tone.

    Args:
        generator: random numbers.
        centres: (N, 3) metres.
        outward: (N, 3) unit directions out of the crown.
        length_m: mean half length.
        width: ratio of width to length.
        upright: how much leaves face upwards.
        hang: how much their tips point down.
    """
    centres, outward = np.asarray(centres, np.float64), np.asarray(outward, np.float64)
    count = len(centres)
    normal = _unit(0.8 * outward + generator.normal(0, 0.55, (count, 3)) + [0, 0, upright])
    along = np.cross(normal, generator.normal(0, 1, (count, 3))) - [0, 0, hang]
    along = _unit(along - normal * np.einsum("ij,ij->i", along, normal)[:, None])
    across = np.cross(normal, along)
    size = length_m * generator.uniform(0.6, 1.3, count)[:, None]
    fold = 0.22 * size * normal
    stem, tip = centres - along * size, centres + along * size
    left, right = centres + across * size * width + fold, centres - across * size * width + fold
    corners = np.concatenate([np.stack([stem, tip, left], axis=1), np.stack([stem, right, tip], axis=1)])
    smooth = _unit(0.5 * normal + 0.65 * outward)
    tilt = 0.25 * across
    normals = np.concatenate([_unit(smooth - tilt), _unit(smooth + tilt)])
    location = generator.uniform(0, _TILE_M, (count, 2))
    offset = np.concatenate([np.repeat(location[:, None], 3, axis=1)] * 2)
    flat = np.array([[-1.0, 0.0], [1.0, 0.0], [0.0, width]]), np.array([[-1.0, 0.0], [0.0, -width], [1.0, 0.0]])
    shape = np.concatenate([np.repeat(part[None], count, axis=0) for part in flat])
    position = corners.astype(np.float32)
    return Mesh(
        position=position,
        normal=np.repeat(normals[:, None], 3, axis=1).astype(np.float32),
        local=position.copy(),
        uv=(offset + shape * length_m).astype(np.float32),
        material=np.zeros(2 * count, np.int16),
        materials=("leaf",),
    )


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12))
