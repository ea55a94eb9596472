"""Samples without noise that look like delivered pictures: what the mean of many shots of a random camera shows.

Such a picture went through the camera's demosaicing, denoising and sharpening, so that its texture is as smooth as that
of a noisy shot, while the mean has taken the noise away and with it the traces of the codec of each shot. Some were
stored as JPEG once more. From these samples a network learns which smooth texture is no noise.

Chunk i is a pure function of (seed, purpose, i).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.processing.codec import Codec, store
from pipeline.camera.processing.develop import grey
from pipeline.learning import cameras
from pipeline.noise.maps import CELL_PX
from pipeline.noise.settings import CameraSamplesRecipe
from pipeline.noise.training.camera_samples import Chunk, middle, scene, side_px
from pipeline.streams import stream

JPEG_FRACTION = 0.5
JPEG_QUALITY = (70, 99)


def chunk(tiles: NDArray[np.uint8], recipe: CameraSamplesRecipe, seed: int, purpose: str, index: int) -> Chunk:
    """One chunk of samples, one per scene, all labels zero.

    Args:
        tiles: (M, T, T) bank of pictures (`pipeline.learning.images`).
        recipe: fractions and ranges; cameras that are drawn without noise do not denoise.
        seed: root of the streams.
        purpose: of the streams; training and validation differ by it.
        index: number of the chunk.
    """
    generator = stream(seed, purpose, index)
    patches = np.stack(
        [_sample(tiles[int(generator.integers(len(tiles)))], recipe, generator) for _ in range(recipe.scenes)]
    )
    nothing, cells = np.zeros(len(patches), np.float32), patches.shape[1] // CELL_PX
    return Chunk(patches, nothing, nothing, nothing, np.zeros((len(patches), cells, cells), np.float32))


def _sample(tile: NDArray[np.uint8], recipe: CameraSamplesRecipe, generator: np.random.Generator) -> NDArray[np.uint8]:
    """One scene through one camera that denoises as it would denoise a noisy shot."""
    camera = replace(cameras.draw(generator, recipe.cameras), earlier_codec=Codec(), codec=Codec(), frames_before=0)
    view = scene(tile, recipe, generator, side_px(camera.scaling))
    rgb = cameras.coloured(view, generator, linear=camera.demosaicing is not None)
    picture = camera.develop(camera.expose(rgb))
    if generator.random() < JPEG_FRACTION:
        corner = generator.integers(8, size=2)
        quality = int(generator.integers(*JPEG_QUALITY))
        picture = store(picture, Codec("jpeg", quality, corner=(int(corner[0]), int(corner[1]))))
    return middle(grey(picture))
