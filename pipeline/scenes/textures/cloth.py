"""What people wear, as factors near 1 on a garment's own albedo; and hair."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pipeline.scenes.textures.noise import power_noise
from pipeline.scenes.textures.texture import Texture

Draw = Callable[[str], np.random.Generator]


def fabric(draw: Draw, size_px: int) -> Texture:
    """Plain cloth: weak tone, weak and smooth folds (strong ones look like camouflage)."""
    folds = power_noise(draw("folds"), size_px, 2.0, stretch_u=1.3, stretch_v=0.6)
    tone = 0.05 * power_noise(draw("weave"), size_px, 0.5) + 0.04 * folds
    return Texture(np.exp(tone), folds, 0.9, 0.011)


def stripe(draw: Draw, size_px: int) -> Texture:
    """Cloth with rings of about six centimetres, a stripe of three."""
    folds = power_noise(draw("folds"), size_px, 2.0, stretch_u=1.3, stretch_v=0.6)
    rings = (np.sin(2 * np.pi * 14 * (np.arange(size_px) + 0.5) / size_px) > 0.2).astype(np.float32)[:, None]
    tone = np.exp(0.06 * power_noise(draw("weave"), size_px, 0.6))
    return Texture((0.62 + 0.75 * rings) * tone, folds, 0.9, 0.011)


def hair(draw: Draw, size_px: int) -> Texture:
    """Strands along v."""
    strands = power_noise(draw("strands"), size_px, 0.7, stretch_u=0.25, stretch_v=2.5)
    return Texture(np.clip(np.exp(0.35 * strands), 0.3, 2.5), strands, 0.4, 0.0004)
