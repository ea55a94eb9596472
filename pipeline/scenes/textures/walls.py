"""What buildings and trunks are clad with. On walls v runs up; on roofs v runs down from the ridge."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pipeline.scenes.textures.masonry import lay
from pipeline.scenes.textures.noise import power_noise
from pipeline.scenes.textures.texture import Texture

Draw = Callable[[str], np.random.Generator]


def brick(draw: Draw, size_px: int) -> Texture:
    """Stretcher bond, 240 x 75 mm, with light mortar."""
    wall = lay(draw("lattice"), size_px, 10, 32, 0.0035, ragged=0.0006)
    stain, fine = power_noise(draw("stain"), size_px, 0.9), power_noise(draw("fine"), size_px, 0.5)
    clay = 0.26 * np.exp(0.18 * wall.tone + 0.20 * stain + 0.12 * fine)
    albedo = np.where(wall.body > 0.5, clay, 0.42 * np.exp(0.10 * fine))
    return Texture(np.clip(albedo, 0.03, 0.8), wall.body + 0.06 * fine, 2.4, 0.006)


def stone(draw: Draw, size_px: int) -> Texture:
    """Rough-hewn blocks of about 50 x 25 cm with warped joints."""
    wall = lay(draw("lattice"), size_px, 6, 12, 0.006, ragged=0.004)
    stain, fine = power_noise(draw("stain"), size_px, 1.0), power_noise(draw("fine"), size_px, 0.5)
    rock = 0.24 * np.exp(0.30 * wall.tone + 0.30 * stain + 0.20 * fine)
    albedo = np.where(wall.body > 0.4, rock, 0.38 * np.exp(0.15 * fine))
    relief = wall.body + 0.25 * power_noise(draw("relief"), size_px, 1.0)
    return Texture(np.clip(albedo, 0.03, 0.8), relief, 3.0, 0.02)


def plank(draw: Draw, size_px: int) -> Texture:
    """Boards of 20 cm lying along u, with grain along u."""
    boards = lay(draw("lattice"), size_px, 2, 14, 0.002)
    grain_along = power_noise(draw("grain"), size_px, 0.8, stretch_v=0.08)
    tone = 0.16 * boards.tone + 0.30 * grain_along + 0.12 * power_noise(draw("tone"), size_px, 1.2)
    albedo = 0.34 * np.exp(tone) * (0.35 + 0.65 * boards.body)
    return Texture(np.clip(albedo, 0.03, 0.8), boards.body + 0.05 * grain_along, 2.8, 0.012)


def tile(draw: Draw, size_px: int) -> Texture:
    """Clay roof tiles of 24 x 20 cm, lapped: each rises towards its lower edge."""
    roof = lay(draw("lattice"), size_px, 10, 12, 0.004, ragged=0.001)
    stain, fine = power_noise(draw("stain"), size_px, 0.9), power_noise(draw("fine"), size_px, 0.5)
    albedo = 0.20 * np.exp(0.22 * roof.tone + 0.22 * stain + 0.12 * fine)
    albedo = albedo * (0.45 + 0.55 * roof.body) * (0.70 + 0.45 * roof.up)
    relief = 0.8 * roof.up + 0.4 * roof.body + 0.05 * fine + 0.3 * np.cos(3 * (roof.along - 0.5))
    return Texture(np.clip(albedo, 0.02, 0.7), relief, 2.4, 0.03)


def shingle(draw: Draw, size_px: int) -> Texture:
    """Slates or wooden shingles of 15 x 15 cm: flat, thin, with strong tones from piece to piece."""
    roof = lay(draw("lattice"), size_px, 16, 16, 0.0022, ragged=0.0008)
    streaks = power_noise(draw("streaks"), size_px, 0.8, stretch_u=0.6, stretch_v=3.0)
    fine = power_noise(draw("fine"), size_px, 0.5)
    albedo = 0.15 * np.exp(0.25 * roof.tone + 0.20 * streaks + 0.10 * fine)
    albedo = albedo * (0.4 + 0.6 * roof.body) * (0.75 + 0.35 * roof.up)
    return Texture(np.clip(albedo, 0.02, 0.6), 0.7 * roof.up + 0.3 * roof.body + 0.06 * fine, 2.4, 0.018)


def plaster(draw: Draw, size_px: int) -> Texture:
    """Bright render with dark runs of rain down the wall."""
    runs = np.clip(power_noise(draw("runs"), size_px, 1.0, stretch_u=0.2) - 1, 0, 3)
    tone = 0.10 * power_noise(draw("tone"), size_px, 1.3) + 0.05 * power_noise(draw("fine"), size_px, 0.4)
    albedo = np.clip(0.58 * np.exp(tone - 0.25 * runs), 0.05, 0.9)
    return Texture(albedo, power_noise(draw("relief"), size_px, 0.7), 3.5, 0.003)


def bark(draw: Draw, size_px: int) -> Texture:
    """Furrows along v, the direction of the trunk."""
    furrows = power_noise(draw("furrows"), size_px, 0.9, stretch_u=0.35, stretch_v=2.0)
    tone = 0.50 * furrows + 0.15 * power_noise(draw("fine"), size_px, 0.5)
    return Texture(np.clip(0.15 * np.exp(tone), 0.02, 0.5), furrows, 1.5, 0.006)
