"""Fields without a surface of their own: leaf tones, the second layer of every ground, clouds."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pipeline.scenes.textures.noise import power_noise
from pipeline.scenes.textures.texture import Texture

Draw = Callable[[str], np.random.Generator]


def leaf(draw: Draw, size_px: int) -> Texture:
    """Foliage, mean albedo near .15. The tile is large and every leaf lies at a random place of it.

    So leaves differ from each other far more than one leaf does within itself, and the mip levels average
    over whole leaves only when these are smaller than a pixel.
    """
    tone = 0.32 * power_noise(draw("tone"), size_px, 0.8) + 0.10 * power_noise(draw("fine"), size_px, 0.2)
    return Texture(np.clip(0.145 * np.exp(tone), 0.03, 0.5), power_noise(draw("relief"), size_px, 0.8), 6.0, 0.01)


def fbm(draw: Draw, size_px: int) -> Texture:
    """Zero-mean, unit-deviation 1/f field (one metre a tile): sampled at a larger scale it breaks repetition."""
    return Texture(power_noise(draw("tone"), size_px, 1.1), power_noise(draw("relief"), size_px, 1.3), 1.0, 0.02)


def cloud(draw: Draw, size_px: int) -> Texture:
    """Zero-mean, unit-deviation field of a cloudy sky (one unit a tile)."""
    tone = power_noise(draw("tone"), size_px, 1.25)
    return Texture(tone, tone, 1.0, 0.0)
