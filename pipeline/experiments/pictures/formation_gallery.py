"""Pictures of one frame along the image-formation chain and under every noise source and level."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pipeline.camera.psf import create
from pipeline.camera.psf.kernel import Kernel
from pipeline.camera.quantise import to_8bit
from pipeline.camera.settings import CameraSettings
from pipeline.camera.steps import steps
from pipeline.datasets.frame import Frame
from pipeline.experiments.condition import Condition
from pipeline.experiments.corrupt import SharpFrame
from pipeline.streams import stream


def gallery(
    frame: Frame,
    effects: Sequence[str],
    target_sigmas_dn: Sequence[float],
    camera: CameraSettings,
    seed: int,
    sigma_dn: float,
    kernel_size_px: int,
    crop_px: int,
) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Arrays and their description, as the report draws them.

    Args:
        frame: the frame shown.
        effects: noise sources shown, as in the experiment.
        target_sigmas_dn: their levels, DN.
        camera: the camera.
        seed: root seed.
        sigma_dn: level of the chain's combined noise, DN.
        kernel_size_px: size of the chain's non-linear motion blur.
        crop_px: side of the square shown, from around the first object or the frame's middle.

    Returns:
        name -> (crop, crop) uint8, and ``{"frame", "chain": [...], "effects": [...]}``.
    """
    sharp = SharpFrame(frame, camera, seed, paired=False)
    window = _window(frame, sharp.image.shape, crop_px)

    def shown(image: np.ndarray) -> np.ndarray:
        return to_8bit(image[window])

    psf = create("nonlinear_motion", kernel_size_px, generator=stream(seed, "gallery", "psf"))
    kernel = Kernel("gallery", "nonlinear_motion", kernel_size_px, 0.0, psf)
    chain = steps(sharp.formation(Condition(kernel, "combined", sigma_dn)))
    arrays = {f"chain_{step.name}": shown(step.image) for step in chain}
    described: dict[str, Any] = {
        "frame": frame.name,
        "chain": [{"array": f"chain_{step.name}", "title": step.title, "caption": step.caption} for step in chain],
        "effects": [],
    }
    for noise_source in effects:
        for level in target_sigmas_dn:
            name = f"{noise_source}_{level:g}"
            arrays[name] = shown(sharp.under(Condition(noise_source=noise_source, target_sigma_dn=float(level))).image)
            described["effects"].append({"array": name, "noise_source": noise_source, "target_sigma_dn": float(level)})
    return arrays, described


def _window(frame: Frame, shape: Sequence[int], crop_px: int) -> tuple[slice, slice]:
    """The square around the largest object that counts, shifted inside the frame; the middle without objects."""
    height, width = shape[:2]
    side = min(crop_px, height, width)
    objects = [box for box in frame.boxes if not box.ignore]
    largest = max(objects, key=lambda box: box.width_px * box.height_px, default=None)
    if largest is None:
        x, y = width / 2, height / 2
    else:
        x, y = (largest.x1 + largest.x2) / 2, (largest.y1 + largest.y2) / 2
    left = int(np.clip(round(x - side / 2), 0, width - side))
    top = int(np.clip(round(y - side / 2), 0, height - side))
    return slice(top, top + side), slice(left, left + side)
