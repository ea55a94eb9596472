"""A picture with an estimate written into each of its tiles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pipeline.datasets.patches import Patch


def noise_overlay(
    image: NDArray[np.float32], tiles: Sequence[Patch], sigma_dn: NDArray[np.floating], brightest_dn: float = 25.0
) -> NDArray[np.uint8]:
    """Colour each tile by its noise and write the number in; a tile without an estimate is crossed out.

    Args:
        image: (H, W) float32 in [0, 1].
        tiles: N squares.
        sigma_dn: (N,) DN; NaN where the estimator abstained.
        brightest_dn: noise that gets the scale's last colour.

    Returns:
        (H, W, 3) RGB.
    """
    import cv2

    from pipeline.camera.quantise import to_8bit

    picture = np.repeat(to_8bit(image)[..., None], 3, axis=2)
    colours = cv2.applyColorMap(np.arange(256, dtype=np.uint8)[None], cv2.COLORMAP_VIRIDIS)[0, :, ::-1]
    for tile, sigma in zip(tiles, sigma_dn, strict=True):
        rows, columns = slice(tile.y_px, tile.y_px + tile.size_px), slice(tile.x_px, tile.x_px + tile.size_px)
        area = picture[rows, columns]
        if np.isnan(sigma):
            cv2.line(area, (0, 0), (tile.size_px, tile.size_px), (128, 128, 128), 1, cv2.LINE_AA)  # crossed out
            cv2.line(area, (0, tile.size_px), (tile.size_px, 0), (128, 128, 128), 1, cv2.LINE_AA)
            continue
        tint = colours[int(np.clip(255 * sigma / brightest_dn, 0, 255))]
        area[:] = np.rint(0.65 * area + 0.35 * tint).astype(np.uint8)
        cv2.rectangle(area, (0, 0), (tile.size_px - 1, tile.size_px - 1), tint.tolist(), 1)
        _write(area, f"{sigma:.1f}")
    return picture


def _write(area: NDArray[np.uint8], text: str) -> None:
    """Text in the middle of an area, white with a dark rim."""
    import cv2

    scale = area.shape[0] / 220
    (width, height), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, scale, 1)
    at = ((area.shape[1] - width) // 2, (area.shape[0] + height) // 2)
    for colour, thickness in (((0, 0, 0), 3), ((255, 255, 255), 1)):
        cv2.putText(area, text, at, cv2.FONT_HERSHEY_SIMPLEX, scale, colour, thickness, cv2.LINE_AA)
