"""Clothes and faces: what textures cannot say of a person."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.scenes.objects.base import Surface
from pipeline.scenes.objects.brush import Coat, beyond, grating, stripe
from pipeline.scenes.objects.figure import Figure

Array = NDArray[np.float32]


@dataclass(frozen=True)
class TopPaint:
    """The garment of the trunk, in coordinates whose origin is between the hips.

    Attributes:
        figure: whose.
    """

    figure: Figure

    def __call__(self, surface: Surface) -> tuple[Array, Array]:
        """Stripes, an open front over a shirt, the seam, the collar."""
        k, foot = self.figure.height_m, surface.footprint_m
        x, y, z = (surface.local / np.float32(k)).T
        coat = Coat(surface.albedo.astype(np.float32).copy(), np.zeros(len(x), np.float32))
        if self.figure.stripes:
            rings = np.where(z > -1, surface.local[:, 2], surface.uv[:, 1])
            coat.albedo *= 1.25 - 0.6 * grating(rings, 0.064, 0.5, foot)
        front = beyond((x - 0.02) * k, foot) * (z > -1)
        if self.figure.open_front:
            shirt = 0.62 if self.figure.top < 0.4 else 0.06
            edge = np.minimum(np.minimum((z - 0.10) * 0.20, 0.034), 0.32 - z) - np.abs(y)
            coat.lay(front * beyond((edge + 0.008) * k, foot), 0.6 * self.figure.top)
            coat.lay(front * beyond(edge * k, foot), shirt)
        seam = front * stripe(y * k, 0.006, foot) * beyond((0.30 - z) * k, foot)
        coat.albedo *= 1 - 0.5 * seam
        collar = stripe((z - 0.328) * k, 0.012, foot) * (z > -1)
        coat.albedo *= 1 - 0.35 * collar
        return coat.result()


@dataclass(frozen=True)
class SkinPaint:
    """Eyes, brows and mouth, in the coordinates of the head.

    Attributes:
        figure: whose.
    """

    figure: Figure

    def __call__(self, surface: Surface) -> tuple[Array, Array]:
        """The skin's own tone with the face drawn on its front."""
        k, foot = self.figure.height_m, surface.footprint_m
        x, y, z = (surface.local / np.float32(k)).T
        coat = Coat(surface.albedo.astype(np.float32).copy(), np.full(len(x), 0.02, np.float32))
        face = (x > 0.02) & (z > -1)
        beside = np.abs(y) - 0.0175
        socket = 1 - np.hypot(beside / 0.013, (z - 0.004) / 0.011)
        coat.lay(face * 0.45 * beyond(0.011 * k * socket, foot), 0.3 * self.figure.skin)
        eye = 1 - np.hypot(beside / 0.0085, (z - 0.004) / 0.0042)
        coat.lay(face * beyond(0.0042 * k * eye, foot), 0.55)
        pupil = 0.0042 - np.hypot(beside, z - 0.004)
        coat.lay(face * beyond(pupil * k, foot), 0.02)
        brow = stripe((z - 0.017 + 0.25 * np.abs(beside)) * k, 0.0028 * k, foot)
        coat.lay(face * brow * beyond((0.012 - np.abs(beside)) * k, foot), self.figure.hair_tone)
        mouth = stripe((z + 0.036) * k, 0.003 * k, foot) * beyond((0.014 - np.abs(y)) * k, foot)
        coat.lay(face * mouth * 0.8, 0.4 * self.figure.skin)
        return coat.result()
