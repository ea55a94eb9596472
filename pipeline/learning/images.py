"""A bank of sharp procedural pictures, and the views of them that training samples start from.

Picture i is a pure function of (seed, i). A view is a crop under a random anisotropic shrink, mirror image, bars and
tone curve; scenes stay upright: real street scenes hold less fine detail across than along, and a network that has only
seen isotropic pictures reads that difference as blur.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.streams import stream

TILE_PX = 384
LEAVES_SHARE = 0.6
UPRIGHT_SHARE = 0.85
"""How often a shrink is vertical and bars are horizontal."""


def picture(index: int, seed: int, purpose: str = "training image", size_px: int = TILE_PX) -> NDArray[np.uint8]:
    """Picture number `index`: dead leaves or a street.

    Returns:
        (size, size) uint8; dithered before rounding, so flat parts carry a camera's rounding noise.
    """
    import cv2

    from pipeline.learning import dead_leaves, streets

    cv2.setNumThreads(1)
    generator = stream(seed, purpose, index)
    draw = dead_leaves.draw if generator.random() < LEAVES_SHARE else streets.draw
    image = draw(generator, size_px) + generator.uniform(-0.5, 0.5, (size_px, size_px))
    return np.rint(np.clip(image, 0, 255)).astype(np.uint8)


def bank(
    count: int,
    seed: int,
    *,
    purpose: str = "training image",
    folder: Path | None = None,
    executor: Mapping[str, Any] | None = None,
) -> NDArray[np.uint8]:
    """Pictures 0 .. count - 1, drawn once and kept in a cache.

    Args:
        count: how many.
        seed: root of the streams.
        purpose: of the streams; training and validation pictures differ by it.
        folder: of the cache; None keeps nothing.
        executor: arguments of `pipeline.executor.run_map`.

    Returns:
        (count, 384, 384) uint8; mapped from the file where there is a cache.
    """
    from pipeline.executor import run_map
    from pipeline.learning.bank import kept

    def draw() -> NDArray[np.uint8]:
        picture_of = partial(picture, seed=seed, purpose=purpose)
        return np.stack(run_map(picture_of, range(count), label=f"{purpose}s", **(executor or {})))

    return kept(folder, purpose, seed, count, __name__, draw)


def view(
    tile: NDArray[np.uint8], generator: np.random.Generator, size_px: int, anisotropy: float = 0.7
) -> NDArray[np.float32]:
    """A random view of a picture.

    Args:
        tile: (T, T) uint8, T >= size.
        generator: source of randomness.
        size_px: side of the view, pixels.
        anisotropy: share of views that are shrunk, a quarter of them along both axes, the others along one (mostly
            vertically); half as many get bars.

    Returns:
        (size, size) float32 in [0, 1].
    """
    import cv2

    side = tile.shape[0]
    height = width = size_px
    if generator.random() < anisotropy:
        long_px = int(size_px * generator.uniform(1, side / size_px))
        kind = generator.random()
        if kind < 0.25:
            height = width = long_px
        elif kind < 0.25 + 0.75 * UPRIGHT_SHARE:
            height = long_px
        else:
            width = long_px
    y, x = (int(generator.integers(side - length + 1)) for length in (height, width))
    crop: NDArray[Any] = tile[y : y + height, x : x + width].copy()  # bars are drawn in place
    if (height, width) != (size_px, size_px):
        crop = cv2.resize(crop, (size_px, size_px), interpolation=cv2.INTER_AREA)
    if generator.random() < 0.5 * anisotropy:
        _bars(crop, generator)
    if generator.random() < 0.5:
        crop = crop[::-1]
    if generator.random() < 0.5:
        crop = crop[:, ::-1]
    return _tone(crop.astype(np.float32) / np.float32(255), generator)


def _bars(image: NDArray[Any], generator: np.random.Generator) -> None:
    """Many thin bars of one orientation, drawn in place: kerbs, window rows, wires, or poles."""
    target = image if generator.random() < UPRIGHT_SHARE else image.T
    size = image.shape[0]
    for _ in range(int(generator.integers(2, 30))):
        length = int(np.exp(generator.uniform(np.log(8), np.log(size))))
        thickness = int(np.exp(generator.uniform(0, np.log(10))))
        y, x = generator.integers(size, size=2)
        target[y : y + thickness, x : x + length] = generator.integers(256)


def _tone(image: NDArray[np.float32], generator: np.random.Generator) -> NDArray[np.float32]:
    """A random gamma, gain and offset, clipped to [0, 1]; now and then the negative."""
    if generator.random() < 0.15:
        image = 1 - image
    gamma, gain = np.exp(generator.uniform(-0.5, 0.5)), np.exp(generator.uniform(-1.2, 0.35))
    toned = np.power(np.maximum(image, 1e-4), np.float32(gamma)) * np.float32(gain)
    toned += np.float32(generator.uniform(-0.1, 0.25))
    return np.clip(toned, 0, 1, out=toned)
