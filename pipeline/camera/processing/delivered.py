"""A picture as another camera would deliver it, with the ground truth of the noise in it.

A finished picture stands for the scene: its grey levels are decoded to linear light, several shots of it go through one
camera (`develop.CameraPipeline`), and what differs between the shots is the noise. Noise or blur that the picture
already has belongs to the scene.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import tone_curve
from pipeline.camera.processing import temporal_noise
from pipeline.camera.processing.develop import CameraPipeline, Float, Picture, grey
from pipeline.camera.processing.temporal_noise import CELL_PX, LEAST_SIDE_PX, TemporalNoise
from pipeline.errors import InputError


@dataclass(frozen=True)
class Delivered:
    """A shot and its ground truth.

    Attributes:
        picture: (h, w, 3) uint8 RGB, the first shot.
        noise: of the grey levels of all shots, over the part of the picture that is whole cells of 8 px.
    """

    picture: Picture
    noise: TemporalNoise


def deliver(
    picture: NDArray[np.floating], camera: CameraPipeline, shots: int, generator: np.random.Generator
) -> Delivered:
    """Shots of a picture through a camera.

    Args:
        picture: (H, W) or (H, W, 3) grey levels or RGB as displayed, [0, 1]; an odd last row or column is cut.
        camera: with its noise.
        shots: number of shots that the noise is measured from, 2 or more.
        generator: source of the noise.

    Returns:
        the first shot, with the noise of all.

    Raises:
        InputError: fewer than two shots, a picture below 24 x 24 px, before or behind the camera's scaling, or of
            another shape.
    """
    if shots < 2:
        raise InputError(f"shots: {shots}, expected 2 or more to measure noise from")
    if picture.ndim not in (2, 3) or min(picture.shape[:2]) < LEAST_SIDE_PX or picture.shape[2:] not in ((), (3,)):
        raise InputError(f"picture: shape {picture.shape}, expected (H, W) or (H, W, 3) of {LEAST_SIDE_PX} px or more")
    scene = linear_scene(picture)
    pictures = [camera.shoot(scene, generator) for _ in range(shots)]
    greys = np.stack([grey(shot) for shot in pictures])
    height, width = (side // CELL_PX * CELL_PX for side in greys.shape[1:])
    return Delivered(pictures[0], temporal_noise.measure(greys[:, :height, :width]))


def linear_scene(picture: NDArray[np.floating]) -> Float:
    """Linear light of a picture as displayed, (H, W) or (H, W, 3) in [0, 1]: (H, W, 3) float32 with even sides."""
    even = picture[: picture.shape[0] // 2 * 2, : picture.shape[1] // 2 * 2]
    rgb = np.repeat(even[..., None], 3, axis=2) if even.ndim == 2 else even
    return tone_curve.linearise(np.ascontiguousarray(rgb, dtype=np.float32))
