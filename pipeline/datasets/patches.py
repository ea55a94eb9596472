"""Patches: which squares of a frame are handed to an estimator.

Blur is estimated on 192 px patches over labelled objects (`object_patches`), noise on 128 px tiles of the whole
frame (`tiles`). Rules: Wischow et al. 2023, Sec. V, and their program where the paper is silent. All coordinates are
0-based pixels; a patch covers [x, x + size) x [y, y + size) and always lies inside the frame.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import ceil, floor

import numpy as np

from pipeline.datasets.frame import Box
from pipeline.errors import InputError

BLUR_PX = 192
NOISE_PX = 128
SAME_PATCH_IOU = 0.7
POLICIES = ("complete", "cover")


@dataclass(frozen=True)
class Patch:
    """A square of a frame.

    Attributes:
        x_px, y_px: upper left corner, pixels.
        size_px: side, pixels.
        label: class of the object it was taken from, or empty.
    """

    x_px: int
    y_px: int
    size_px: int
    label: str = ""


def object_patches(
    frame_shape: Sequence[int],
    boxes: Iterable[Box],
    size_px: int = BLUR_PX,
    *,
    same_iou: float = SAME_PATCH_IOU,
    one_more: bool = True,
) -> list[Patch]:
    """Patches over labelled objects: the paper's object mode.

    Each box is extended to the right and downwards until its sides are multiples of the patch size, clipped to the
    frame and cut into patches, which are shifted back inside where they would leave it. A patch that overlaps an
    earlier one by an intersection over union of `same_iou` or more is the same patch and not repeated.

    Args:
        frame_shape: (H, W).
        boxes: objects; ignored ones are passed over.
        size_px: side of a patch.
        same_iou: overlap in [0, 1] from which two patches are the same.
        one_more: a side that already is a multiple gets one more patch, as in the authors' program; without, it
            stays as it is.

    Returns:
        patches in the order of the boxes, then from top to bottom and left to right; none where the frame is smaller
        than a patch.
    """
    height, width = _checked(frame_shape, size_px)
    if min(height, width) < size_px:
        return []
    chosen: list[Patch] = []
    for box in boxes:
        inside = None if box.ignore else box.clipped(width, height)
        if inside is None:
            continue
        for y in _object_starts(inside.y1, inside.y2, height, size_px, one_more):
            for x in _object_starts(inside.x1, inside.x2, width, size_px, one_more):
                if all(_iou(x, y, patch, size_px) < same_iou for patch in chosen):
                    chosen.append(Patch(x, y, size_px, box.label))
    return chosen


def _object_starts(low: float, high: float, length: int, size_px: int, one_more: bool) -> list[int]:
    """Where patches begin along one axis, for a box from low to high."""
    first, last = floor(low), ceil(high)
    side = last - first
    count = side // size_px + 1 if one_more else ceil(side / size_px)
    end = min(first + count * size_px, length)
    return [min(start, length - size_px) for start in range(first, end, size_px)]


def _iou(x: int, y: int, other: Patch, size_px: int) -> float:
    overlap = max(0, size_px - abs(x - other.x_px)) * max(0, size_px - abs(y - other.y_px))
    return overlap / (2 * size_px * size_px - overlap)


def tiles(frame_shape: Sequence[int], size_px: int = NOISE_PX, policy: str = "complete") -> list[Patch]:
    """Square tiles over a whole frame.

    Args:
        frame_shape: (H, W).
        size_px: side of a tile.
        policy: ``"complete"``: only whole tiles from the upper left corner (the paper's 135 on a 1920x1200 frame);
            ``"cover"``: the last tile of a row or column is shifted back to end at the border, so that every pixel is
            in a tile (150).

    Returns:
        tiles from top to bottom, each row from left to right; none where the frame is smaller than a tile.
    """
    height, width = _checked(frame_shape, size_px)
    if policy not in POLICIES:
        raise InputError(f"patches.policy={policy!r}: expected one of {', '.join(POLICIES)}")
    if min(height, width) < size_px:
        return []
    rows, columns = (_tile_starts(length, size_px, policy == "cover") for length in (height, width))
    return [Patch(x, y, size_px) for y in rows for x in columns]


def _tile_starts(length: int, size_px: int, cover: bool) -> list[int]:
    starts = list(range(0, length - size_px + 1, size_px))
    if cover and starts[-1] + size_px < length:
        starts.append(length - size_px)
    return starts


def cut(image: np.ndarray, patches: Sequence[Patch]) -> np.ndarray:
    """The pixels of patches.

    Args:
        image: (H, W) float in [0, 1], or uint8 (divided by 255).
        patches: all of one size, inside the image.

    Returns:
        (N, 1, size, size) float32, a copy; (0, 1, 0, 0) without patches.

    Raises:
        InputError: an image of another shape or type, patches of different sizes, or one that leaves the image.
    """
    if image.ndim != 2:
        raise InputError(f"an image of shape {image.shape} was given to cut patches from, expected (H, W)")
    if image.dtype != np.uint8 and image.dtype.kind != "f":
        raise InputError(
            f"an image to cut patches from is uint8, or float in [0, 1], got {image.dtype}; divide by its full scale"
        )
    if not patches:
        return np.zeros((0, 1, 0, 0), np.float32)
    size_px = patches[0].size_px
    result = np.empty((len(patches), 1, size_px, size_px), np.float32)
    for index, patch in enumerate(patches):
        if patch.size_px != size_px:
            raise InputError(f"patches of {size_px} and {patch.size_px} px in one batch, expected one size")
        piece = image[patch.y_px : patch.y_px + size_px, patch.x_px : patch.x_px + size_px]
        if patch.x_px < 0 or patch.y_px < 0 or piece.shape != (size_px, size_px):
            raise InputError(f"{patch} leaves the image of {image.shape[1]}x{image.shape[0]} px")
        result[index, 0] = piece
    if image.dtype == np.uint8:
        result /= np.float32(255)
    return result


def _checked(frame_shape: Sequence[int], size_px: int) -> tuple[int, int]:
    if len(frame_shape) != 2 or min(frame_shape) < 0:
        raise InputError(f"frame shape {tuple(frame_shape)}: expected (height, width)")
    if size_px < 1:
        raise InputError(f"patches.size_px={size_px}: expected at least 1")
    return int(frame_shape[0]), int(frame_shape[1])
