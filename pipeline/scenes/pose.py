"""Where the camera is and how it looks: pinhole pose, rays through pixels, projection of points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float32]


@dataclass(frozen=True)
class Pose:
    """A pinhole camera. World axes: x forward at heading 0, y left, z up; metres.

    A point with camera coordinates (right, up, ahead) projects to
    ``u = W/2 + f right/ahead``, ``v = H/2 - f up/ahead``; pixel (column j, row i) covers [j, j+1) x [i, i+1).

    Attributes:
        position_m: (3,) optical centre.
        heading_rad: turn about z, 0 looks along +x, positive to the left.
        pitch_rad: positive looks up.
        roll_rad: positive lowers the right side of the camera.
        focal_px: focal length in pixels.
        width_px, height_px: size of the image.
    """

    position_m: tuple[float, float, float]
    heading_rad: float = 0.0
    pitch_rad: float = 0.0
    roll_rad: float = 0.0
    focal_px: float = 760.0
    width_px: int = 896
    height_px: int = 768

    def axes(self) -> Array:
        """(3, 3) rows: unit vectors to the right, up and ahead, in world coordinates."""
        ch, sh = np.cos(self.heading_rad), np.sin(self.heading_rad)
        cp, sp = np.cos(self.pitch_rad), np.sin(self.pitch_rad)
        ahead = np.array([ch * cp, sh * cp, sp])
        right = np.array([sh, -ch, 0.0])
        up = np.cross(right, ahead)
        cr, sr = np.cos(self.roll_rad), np.sin(self.roll_rad)
        return np.stack([cr * right - sr * up, sr * right + cr * up, ahead]).astype(np.float32)

    def rays(self, columns_px: ArrayLike, rows_px: ArrayLike) -> Array:
        """Unit directions through the grid of image positions columns x rows.

        Args:
            columns_px: (C,) horizontal image coordinates (pixel centres are at j + 0.5).
            rows_px: (R,) vertical image coordinates.

        Returns:
            (R * C, 3) float32, row by row.
        """
        right, up, ahead = self.axes().astype(np.float64)
        across = (np.asarray(columns_px, np.float64) - self.width_px / 2) / self.focal_px
        down = (np.asarray(rows_px, np.float64) - self.height_px / 2) / self.focal_px
        inverse = 1.0 / np.sqrt(1.0 + across**2 + (down**2)[:, None])
        direction = (ahead - down[:, None] * up)[:, None, :] + across[None, :, None] * right
        return (direction * inverse[..., None]).astype(np.float32).reshape(-1, 3)

    def project(self, points_m: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Image positions of world points.

        Args:
            points_m: (K, 3).

        Returns:
            (K, 2) image coordinates in pixels (nan where not ahead of the camera) and (K,) distances ahead, metres.
        """
        camera = (np.asarray(points_m, np.float64) - self.position_m) @ self.axes().astype(np.float64).T
        ahead = camera[:, 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            scale = np.where(ahead > 1e-6, self.focal_px / ahead, np.nan)
        u = self.width_px / 2 + scale * camera[:, 0]
        v = self.height_px / 2 - scale * camera[:, 1]
        return np.stack([u, v], axis=1), ahead

    def angle_per_pixel_rad(self) -> float:
        """Angle one pixel spans at the image centre."""
        return 1.0 / self.focal_px
