"""Fit an image into a network's input without changing its proportions, and take boxes back."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Placement:
    """Where an image lies on the canvas: ``canvas = scale * image + offset``.

    Attributes:
        scale: canvas pixels per image pixel.
        x_px, y_px: left and top margin on the canvas.
        width_px, height_px: of the image.
    """

    scale: float
    x_px: float
    y_px: float
    width_px: int
    height_px: int

    def undo(self, boxes: NDArray[np.floating]) -> NDArray[np.float64]:
        """Boxes (M, 4) on the canvas as boxes in the image, clipped to it."""
        back = np.asarray(boxes, dtype=np.float64) - [self.x_px, self.y_px, self.x_px, self.y_px]
        back /= self.scale
        limit = [self.width_px, self.height_px, self.width_px, self.height_px]
        return np.clip(back, 0.0, limit)


def letterbox(
    image: NDArray[np.float32], width_px: int, height_px: int, fill: float, centred: bool = False
) -> tuple[NDArray[np.float32], Placement]:
    """Scale an image to fit (bilinear, the larger side exactly, the other rounded) and fill the rest.

    Args:
        image: (H, W) in any unit.
        width_px: of the canvas.
        height_px: of the canvas.
        fill: value of the margin, in the image's unit.
        centred: margins on both sides (rounded down), else right and bottom only.

    Returns:
        the canvas (height_px, width_px) and where the image lies on it.
    """
    height, width = image.shape
    scale = min(width_px / width, height_px / height)
    inner = (max(1, min(width_px, round(width * scale))), max(1, min(height_px, round(height * scale))))
    x, y = ((width_px - inner[0]) // 2, (height_px - inner[1]) // 2) if centred else (0, 0)
    canvas = np.full((height_px, width_px), fill, dtype=np.float32)
    resized = image if inner == (width, height) else cv2.resize(image, inner, interpolation=cv2.INTER_LINEAR)
    canvas[y : y + inner[1], x : x + inner[0]] = resized
    return canvas, Placement(scale, x, y, width, height)
