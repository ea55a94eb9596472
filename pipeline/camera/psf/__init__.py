"""Point-spread functions (PSFs): the pattern that one point of light leaves on the sensor.

Every kind is a function of size, rotation and, where it is random, a generator; all return a float32 array that is
centred (centroid within 0.05 px of the centre pixel), non-negative and of unit sum, with odd sides.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.camera.psf.bank import bank
from pipeline.camera.psf.kernel import Kernel, centroid_px
from pipeline.errors import InputError, did_you_mean
from pipeline.registry import Registry

CAMERAS = ("physical", "authors")

REGISTRY = Registry(
    "point-spread function",
    "pipeline.psf",
    {
        "defocus": "pipeline.camera.psf.defocus:create",
        "gaussian": "pipeline.camera.psf.gaussian:create",
        "linear_motion": "pipeline.camera.psf.linear_motion:create",
        "nonlinear_motion": "pipeline.camera.psf.nonlinear_motion:create",
    },
)

__all__ = ["CAMERAS", "REGISTRY", "Kernel", "bank", "centroid_px", "create", "kinds"]


def kinds() -> list[str]:
    """Names that `create` knows, sorted."""
    return REGISTRY.names()


def create(
    kind: str,
    size_px: float,
    angle_deg: float = 0.0,
    generator: np.random.Generator | None = None,
    *,
    camera: str = "physical",
    **options: Any,
) -> np.ndarray:
    """Make one PSF.

    Args:
        kind: one of `kinds()`.
        size_px: diameter of the disc, length of the straight motion, bounding box of the bent motion, or full width
            at half maximum of the Gaussian; pixels, >= 0; at most 1 px is no blur (a Gaussian narrows to it).
        angle_deg: rotation, degrees, counter-clockwise as seen in the image.
        generator: needed by ``"nonlinear_motion"``.
        camera: ``"authors"`` draws defocus as the paper's program does, off centre and about one pixel too wide.
            Motion is the same with either: the authors' motion kernels were picked by hand from random draws and
            can only be loaded (`pipeline.camera.psf.paper_kernels`).
        options: keyword options of the kind; see its module.

    Returns:
        (h, w) float32, sum 1.

    Raises:
        InputError: unknown kind, camera or option, or a value outside its range.
    """
    if camera not in CAMERAS:
        raise InputError(f"unknown camera '{camera}'; {did_you_mean(camera, CAMERAS)}")
    if camera == "authors" and kind == "defocus":
        options["camera"] = camera
    psf: np.ndarray = REGISTRY.create(kind, size_px=size_px, angle_deg=angle_deg, generator=generator, **options)
    return psf
