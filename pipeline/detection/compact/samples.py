"""Training samples of the compact detectors: crops of *Sim* frames at random scale, mirrored, with random tone.

Sharp images only, like those that public detectors were trained on: what blur and noise do to a detector is what the
sweeps measure. Objects under `LOWEST_PX` high or less visible than `LEAST_VISIBLE` are neither wanted nor wrong.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.detection.compact.assignment import ABSENT, IGNORED
from pipeline.detection.settings import CropRecipe
from pipeline.detection.sim_frames import SimFrames, sim_frames
from pipeline.scenes.labels import LABELS
from pipeline.streams import stream

MOST = 32
"""Objects in a sample; more are left out, smallest first."""
LOWEST_PX = 14.0
LEAST_VISIBLE = 0.25
LEAST_LEFT = 0.3
"""Share of a box that must be in the crop."""


def crop(
    frames: SimFrames, generator: np.random.Generator, recipe: CropRecipe
) -> tuple[NDArray[np.uint8], NDArray[np.float32], NDArray[np.int8]]:
    """One sample.

    Returns:
        image (S, S) uint8, boxes (MOST, 4) float32 in its pixels, and class numbers (MOST,) int8 (see `assign`).
    """
    import cv2

    cv2.setNumThreads(1)
    number = int(generator.integers(len(frames)))
    image, box = frames.images[number], frames.boxes[number]
    scale = float(np.exp(generator.uniform(*np.log(recipe.scale))))
    side = recipe.size_px / scale
    height, width = image.shape
    if len(box) and generator.random() < recipe.at_object:
        x1, y1, x2, y2 = box[int(generator.integers(len(box)))]
        middle = np.array([generator.uniform(x1, x2), generator.uniform(y1, y2)])
        corner = middle - generator.uniform(0.15, 0.85, 2) * side
    else:
        corner = generator.uniform(0, 1, 2) * np.array([width - side, height - side])
    corner = np.clip(corner, np.minimum(0, [width - side, height - side]), np.maximum(0, [width - side, height - side]))
    # Pixel centres lie at half-integers: sample pixel u looks at frame position corner + (u + 1/2) / scale - 1/2.
    matrix = np.array([[1 / scale, 0, corner[0] + 0.5 / scale - 0.5], [0, 1 / scale, corner[1] + 0.5 / scale - 0.5]])
    if scale < 1:  # a mean over the pixels that are merged
        small = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        matrix = np.array([[1.0, 0, corner[0] * scale], [0, 1.0, corner[1] * scale]])
        image = small
    size = (recipe.size_px, recipe.size_px)
    cut = cv2.warpAffine(
        image,
        matrix,
        size,
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=114,
    )
    placed, kind = _objects(frames, number, corner, scale, recipe.size_px)
    if generator.random() < 0.5:
        cut = np.ascontiguousarray(cut[:, ::-1])
        placed[:, [0, 2]] = recipe.size_px - placed[:, [2, 0]]
    boxes = np.zeros((MOST, 4), np.float32)
    kinds = np.full(MOST, ABSENT, np.int8)
    boxes[: len(placed)], kinds[: len(placed)] = placed, kind
    return _tone(np.asarray(cut, np.uint8), generator), boxes, kinds


def _objects(
    frames: SimFrames, number: int, corner: NDArray[np.float64], scale: float, size_px: int
) -> tuple[NDArray[np.float32], NDArray[np.int8]]:
    """Boxes in the sample, largest first, and what they are."""
    whole = (frames.boxes[number].reshape(-1, 2, 2) - corner).reshape(-1, 4) * scale
    inside = np.clip(whole, 0, size_px)

    def area(box: NDArray[np.floating]) -> NDArray[np.floating]:
        sides: NDArray[np.floating] = (box[:, 2] - box[:, 0]) * (box[:, 3] - box[:, 1])
        return sides

    left = area(inside) / np.maximum(area(whole), 1e-6)
    visible = left * frames.visible[number]
    kind = np.array([LABELS.index(label) for label in frames.labels[number]], np.int8)
    unclear = (inside[:, 3] - inside[:, 1] < LOWEST_PX) | (visible < LEAST_VISIBLE) | (left < LEAST_LEFT)
    kind = np.where(unclear, np.int8(IGNORED), kind).astype(np.int8)
    order = np.argsort(-area(inside), kind="stable")
    order = order[area(inside)[order] > 1][:MOST]
    return inside[order].astype(np.float32), kind[order]


def _tone(image: NDArray[np.uint8], generator: np.random.Generator) -> NDArray[np.uint8]:
    """A random gamma, gain and offset, as exposure and cameras differ."""
    gamma, gain = np.exp(generator.uniform(-0.4, 0.4)), np.exp(generator.uniform(-0.6, 0.3))
    offset = generator.uniform(-20, 30)
    table = np.power(np.arange(256) / 255, gamma) * 255 * gain + offset
    toned: NDArray[np.uint8] = np.rint(np.clip(table, 0, 255)).astype(np.uint8)[image]
    return toned


@dataclass
class CropMaker:
    """Chunk number -> arrays ``image`` (n, 1, S, S) uint8, ``box`` (n, MOST, 4), ``kind`` (n, MOST).

    Opens its frames on first use, in whichever process that is.
    """

    recipe: CropRecipe
    seed: int
    source: Mapping[str, Any]
    _frames: SimFrames | None = None

    def __call__(self, number: int) -> dict[str, np.ndarray]:
        """The arrays of one chunk."""
        if self._frames is None:
            self._frames = sim_frames(**self.source)
        generator = stream(self.seed, "detector samples", number)
        made = [crop(self._frames, generator, self.recipe) for _ in range(self.recipe.count)]
        image, box, kind = (np.stack(parts) for parts in zip(*made, strict=True))
        return {"image": image[:, None], "box": box, "kind": kind}
