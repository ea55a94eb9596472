"""Labelled samples for noise of delivered pictures: shots of procedural scenes through random cameras.

A scene is a procedural view with fine texture, blurred by a lens and coloured; three shots go through one random camera
(`pipeline.learning.cameras`). The label is what the shots themselves show: their unbiased temporal standard deviation,
its white part and the correlation between neighbours (`pipeline.camera.processing.temporal_noise`). Every shot is a
sample. Some shots get white noise on top (a noisy digitiser, or noise added in software); its variance adds to the
label.

Chunk i is a pure function of (seed, purpose, i).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.processing import temporal_noise
from pipeline.camera.processing.develop import grey
from pipeline.camera.processing.gaussian import blurred
from pipeline.learning import cameras, images
from pipeline.learning.textures import fur, lettering
from pipeline.noise.settings import CameraSamplesRecipe
from pipeline.noise.training.samples import exposed, textured
from pipeline.streams import stream

PATCH_PX = 128
MARGIN_PX = 16
SHOTS = 3
LARGEST_PX = 384


@dataclass(frozen=True)
class Chunk:
    """Labelled samples; N = 3 x scenes.

    Attributes:
        patches_dn: (N, 128, 128) uint8.
        sigma_dn, white_sigma_dn: (N,) float32.
        correlation: (N,) float32, lag-1.
        map_dn: (N, 16, 16) float32, sigma per cell.
    """

    patches_dn: NDArray[np.uint8]
    sigma_dn: NDArray[np.float32]
    white_sigma_dn: NDArray[np.float32]
    correlation: NDArray[np.float32]
    map_dn: NDArray[np.float32]


def chunk(tiles: NDArray[np.uint8], recipe: CameraSamplesRecipe, seed: int, purpose: str, index: int) -> Chunk:
    """One chunk of samples.

    Args:
        tiles: (M, T, T) bank of pictures (`pipeline.learning.images`).
        recipe: fractions and ranges.
        seed: root of the streams.
        purpose: of the streams; training and validation differ by it.
        index: number of the chunk.
    """
    generator = stream(seed, purpose, index)
    parts = [_samples(tiles[int(generator.integers(len(tiles)))], recipe, generator) for _ in range(recipe.scenes)]
    return Chunk(*(np.concatenate([getattr(part, name) for part in parts]) for name in Chunk.__dataclass_fields__))


def _samples(tile: NDArray[np.uint8], recipe: CameraSamplesRecipe, generator: np.random.Generator) -> Chunk:
    """Shots of one scene through one camera."""
    camera = cameras.draw(generator, recipe.cameras)
    view = scene(tile, recipe, generator, side_px(camera.scaling))
    rgb = cameras.coloured(view, generator, linear=camera.demosaicing is not None)
    shots = np.stack([middle(grey(camera.shoot(rgb, generator))) for _ in range(SHOTS)])
    truth = temporal_noise.measure(shots)
    added = np.zeros(SHOTS, np.float32)
    if generator.random() < recipe.added_fraction:
        even, logarithmic = generator.uniform(0, 30), float(np.exp(generator.uniform(np.log(0.5), np.log(6.0))))
        added[-1] = even if generator.random() < 0.5 else logarithmic
        noisy = shots[-1] + added[-1] * generator.standard_normal(shots[-1].shape, dtype=np.float32)
        shots[-1] = np.clip(np.rint(noisy), 0, 255).astype(np.uint8)
    variance = np.float32(truth.sigma_dn**2) + added**2
    return Chunk(
        shots,
        np.sqrt(variance),
        np.sqrt(np.float32(truth.white_sigma_dn**2) + added**2),
        (truth.correlation * truth.sigma_dn**2 / np.maximum(variance, 1e-6)).astype(np.float32) * (variance > 0.04),
        np.sqrt(truth.map_dn[None] ** 2 + added[:, None, None] ** 2),
    )


def scene(
    tile: NDArray[np.uint8], recipe: CameraSamplesRecipe, generator: np.random.Generator, size_px: int
) -> NDArray[np.float32]:
    """A textured, lit view behind a lens: (S, S) encoded grey levels in [0, 1]."""
    image = images.view(tile, generator, size_px) * np.float32(255)
    if generator.random() < recipe.texture_fraction:
        image = image + np.float32(generator.uniform(0.05, 1.0)) * (textured(image, generator) - image)
    if generator.random() < recipe.fur_fraction:
        image = fur(generator, image)
    if generator.random() < recipe.text_fraction:
        image = lettering(generator, image)
    image = exposed(image, generator)
    return np.clip(blurred(image, float(generator.uniform(*recipe.lens_px))) / np.float32(255), 0, 1)


def side_px(scaling: float) -> int:
    """Side of a scene of which enough is left behind a camera that scales its pictures; pixels, even."""
    return min(int(np.ceil((PATCH_PX + 2 * MARGIN_PX) / min(scaling, 1.0) / 2)) * 2, LARGEST_PX)


def middle(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The middle of a picture, 128 x 128 px."""
    top, left = ((side - PATCH_PX) // 2 for side in picture.shape)
    return picture[top : top + PATCH_PX, left : left + PATCH_PX]
