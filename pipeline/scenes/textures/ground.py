"""What one walks and drives on: asphalt, grass, leaf litter, soil, paving and cobbles."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pipeline.scenes.textures.masonry import lay
from pipeline.scenes.textures.noise import grain, power_noise
from pipeline.scenes.textures.strokes import blades, leaves
from pipeline.scenes.textures.texture import Texture

Draw = Callable[[str], np.random.Generator]


def asphalt(draw: Draw, size_px: int) -> Texture:
    """Fine bright grain with little low-frequency tone (more of it looks like marble)."""
    chips = grain(draw("chips"), size_px, 0.9)
    tone = 0.09 * power_noise(draw("tone"), size_px, 1.2) + 0.16 * power_noise(draw("fine"), size_px, 0.25)
    relief = chips + 0.3 * power_noise(draw("relief"), size_px, 0.4)
    return Texture(np.clip(0.17 * np.exp(tone + 0.20 * chips), 0.03, 0.6), relief, 4.5, 0.0010)


def grass(draw: Draw, size_px: int) -> Texture:
    """Blades at all angles in patches of different vigour."""
    part = size_px / 1024
    turf = blades(draw("blades"), size_px, int(60000 * part**2), (10 * part, 34 * part), 0.20, 0.075)
    patches = np.exp(0.18 * power_noise(draw("patches"), size_px, 1.2))
    return Texture(np.clip(turf * patches, 0.02, 0.45), turf, 2.0, 0.03)


def litter(draw: Draw, size_px: int) -> Texture:
    """Fallen leaves over soil."""
    part = size_px / 1024
    cover = leaves(draw("leaves"), size_px, int(9000 * part**2) + 50, (4 * part, 17 * part), 0.26, 0.10)
    tone = 0.35 * power_noise(draw("tone"), size_px, 1.1) + 0.15 * power_noise(draw("fine"), size_px, 0.4)
    relief = cover + 0.1 * power_noise(draw("relief"), size_px, 1.0)
    return Texture(np.clip(cover * np.exp(tone), 0.02, 0.7), relief, 4.0, 0.06)


def dirt(draw: Draw, size_px: int) -> Texture:
    """Bare soil: strong low-frequency tone, some grain."""
    tone = 0.45 * power_noise(draw("tone"), size_px, 1.15) + 0.25 * power_noise(draw("fine"), size_px, 0.6)
    return Texture(np.clip(0.22 * np.exp(tone), 0.03, 0.7), power_noise(draw("relief"), size_px, 1.0), 5.0, 0.008)


def paver(draw: Draw, size_px: int) -> Texture:
    """Square concrete flags, half a metre."""
    flags = lay(draw("lattice"), size_px, 6, 6, 0.003, shift=0.0, ragged=0.0003)
    fine = power_noise(draw("fine"), size_px, 0.5)
    tone = 0.10 * flags.tone + 0.14 * power_noise(draw("stain"), size_px, 0.9) + 0.14 * fine
    albedo = 0.34 * np.exp(tone) * (0.4 + 0.6 * flags.body)
    return Texture(np.clip(albedo, 0.03, 0.8), flags.body + 0.05 * fine, 3.0, 0.006)


def cobble(draw: Draw, size_px: int) -> Texture:
    """Rounded setts of twelve centimetres with dark joints."""
    setts = lay(draw("lattice"), size_px, 18, 18, 0.006, ragged=0.003)
    fine = power_noise(draw("fine"), size_px, 0.5)
    albedo = 0.26 * np.exp(0.20 * setts.tone + 0.16 * fine) * (0.35 + 0.65 * setts.body)
    crown = (1 - (2 * setts.along - 1) ** 4) * (1 - (2 * setts.up - 1) ** 4)
    return Texture(np.clip(albedo, 0.03, 0.8), np.sqrt(setts.body) + 0.4 * crown + 0.1 * fine, 2.2, 0.016)


def concrete(draw: Draw, size_px: int) -> Texture:
    """Cast concrete: kerbs, posts, copings; fine grain and a few dark pores."""
    fine = grain(draw("fine"), size_px, 1.0)
    pores = np.clip(grain(draw("pores"), size_px, 2.0) - 2.2, 0, 1)
    tone = 0.12 * power_noise(draw("tone"), size_px, 1.1) + 0.07 * fine - 0.5 * pores
    return Texture(np.clip(0.38 * np.exp(tone), 0.05, 0.8), fine - 3 * pores, 2.0, 0.0006)
