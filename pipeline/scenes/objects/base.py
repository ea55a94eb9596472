"""What a scene needs to know of an object: its shape, its class for detectors, and its paint."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.scenes.mesh import Mesh

Array = NDArray[np.float32]


@dataclass(frozen=True)
class Surface:
    """K points hit on one material of one object.

    Attributes:
        local: (K, 3) object coordinates, metres.
        normal: (K, 3) smooth normals in object coordinates.
        uv: (K, 2) texture coordinates, metres.
        albedo: (K,) of the material's texture, in (0, 1).
        footprint_m: (K,) size of a pixel sample on the surface, metres, to fade what is finer.
        view: (K, 3) unit direction from the camera to the point, in object coordinates (turned with the object,
            like `normal`), for painters that look through glass; None where the caller does not know it.
    """

    local: Array
    normal: Array
    uv: Array
    albedo: Array
    footprint_m: Array
    view: Array | None = None


class Painter(Protocol):
    """Paints a material of one object at the points hit."""

    def __call__(self, surface: Surface) -> tuple[Array, Array]:
        """Albedo (K,) in (0, 1) and mirror reflectance at normal incidence F0 (K,) in [0, 1]."""
        ...


@dataclass(frozen=True)
class SceneObject:
    """One object, in its own coordinates: origin on the ground, x forward, y left, z up, metres.

    Attributes:
        mesh: its triangles.
        label: class for detectors (``"car"``, ``"person"``, ``"bicycle"``), or None for background.
        kind: finer name (``"sedan"``, ``"coat"``, ``"house"``).
        tint: material name -> factor on that material's texture albedo.
        paint: material name -> painter, for what textures cannot say (glass, lamps, plates, clothing).
    """

    mesh: Mesh
    label: str | None = None
    kind: str = ""
    tint: Mapping[str, float] = field(default_factory=dict)
    paint: Mapping[str, Painter] = field(default_factory=dict)
