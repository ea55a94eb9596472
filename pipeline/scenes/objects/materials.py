"""Every material a mesh may name: its texture, mean albedo, roughness of relief, mirror reflectance and thickness."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Material:
    """How light meets a surface where no painter changes it.

    The diffuse albedo of a hit is ``texture sample * tint`` (tint from `SceneObject.tint`, 1 if absent), or
    ``albedo * tint`` where there is no texture; a painter's answer replaces both.

    Attributes:
        texture: name in the texture library, or None for a plain surface.
        albedo: mean diffuse albedo: the colour of a plain surface, and what mirrors show of this material; equals the
            texture's mean. 1 for cloth, skin and hair, whose tint is their albedo.
        bump: factor on the texture's slopes, >= 0.
        f0: mirror reflectance at normal incidence, [0, 1] (Schlick 1994).
        two_sided: thin and translucent, lit from both sides (leaves).
    """

    texture: str | None
    albedo: float
    bump: float = 1.0
    f0: float = 0.0
    two_sided: bool = False


MATERIALS: dict[str, Material] = {
    # ground
    "asphalt": Material("asphalt", 0.18),
    "grass": Material("grass", 0.2),
    "litter": Material("litter", 0.27),
    "dirt": Material("dirt", 0.25),
    "paver": Material("paver", 0.335),
    "cobble": Material("cobble", 0.19),
    "concrete": Material("concrete", 0.38, 0.6),
    # buildings
    "brick": Material("brick", 0.32),
    "stone": Material("stone", 0.29),
    "plank": Material("plank", 0.35),
    "plaster": Material("plaster", 0.57),
    "tile": Material("tile", 0.18),
    "shingle": Material("shingle", 0.135),
    "trim": Material("plaster", 0.57, 0.3),
    "door": Material("plank", 0.35, 0.5),
    "shutter": Material("plank", 0.35, 0.5),
    "window": Material(None, 0.05, 0.0, 0.08),
    "gutter": Material(None, 0.30, 0.0, 0.06),
    # plants
    "bark": Material("bark", 0.17),
    "leaf": Material("leaf", 0.15, 0.3, 0.0, True),
    "hedge": Material(None, 0.045, 0.0),
    # fences and street furniture
    "picket": Material("plank", 0.35, 0.5),
    "bench": Material("plank", 0.35, 0.5),
    "metal": Material(None, 0.25, 0.0, 0.06),
    "sign": Material(None, 0.45, 0.0, 0.03),
    "lens": Material(None, 0.65, 0.0, 0.08),
    "bin": Material(None, 0.08, 0.0, 0.04),
    # cars
    "car_body": Material(None, 0.25, 0.0, 0.05),
    "car_paint": Material(None, 0.25, 0.0, 0.05),
    "black": Material(None, 0.02, 0.0, 0.01),
    "chrome": Material(None, 0.35, 0.0, 0.50),
    "tyre": Material(None, 0.035, 0.0),
    "rim": Material(None, 0.40, 0.0, 0.12),
    "plate": Material(None, 0.60, 0.0, 0.02),
    # people and bicycles
    "top": Material("fabric", 1.0, 0.6),
    "trousers": Material("fabric", 1.0, 0.7),
    "skin": Material("fabric", 1.0, 0.1),
    "hair": Material("hair", 1.0, 0.5),
    "shoe": Material(None, 0.08, 0.0, 0.02),
    "bag": Material("fabric", 1.0, 0.6),
    "frame": Material(None, 0.20, 0.0, 0.04),
}
