"""MTF relative to a generic lens, for cameras without sharp reference frames: the pictures it is calibrated on.

A network that estimates the *total* MTF includes the blur of the lens. Sharp frames of the camera remove it
(`Estimator.calibrated`, `pipeline.blur.camera_calibration`). Without any, a generic lens stands in: sharp procedural
pictures are blurred by lenses of usual quality,

    S = I * G_a,    a ~ U(intrinsic_px),    G_a a Gaussian of standard deviation a, integrated over pixels,

and the estimator is calibrated to them as to one camera (`camera_calibration.calibrate`): it learns the blur added to S
while a is unknown. For lenses sharper than the generic one, and for renderings without a lens, it underestimates blur;
there the total MTF is the better estimate.

Ours. The paper's network learns kernels alone, applied to frames that have the blur of a lens already: a similar
quantity.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pipeline.blur.base import PATCH_PX

PURPOSE = "typical camera"
PICTURES = f"{PURPOSE} image"
"""Purposes of random streams, kept since they key every number drawn; no picture of theirs is a training picture."""

ANISOTROPY = 0.7
LEAST_BLUR_PX = 0.05
"""A Gaussian narrower than this changes no grey level."""


def sharp_patches(
    tiles: NDArray[np.uint8], count: int, intrinsic_px: Sequence[float], seed: int
) -> NDArray[np.float32]:
    """Sharp pictures, each blurred by another lens.

    Args:
        tiles: (M, T, T) sharp pictures (`pipeline.learning.images.bank`), T >= 192; taken in turn.
        count: of patches.
        intrinsic_px: least and greatest standard deviation of a lens's blur, pixels.
        seed: root of the random streams; patch i depends on it, i and its tile alone.

    Returns:
        (count, 1, 192, 192) in [0, 1].
    """
    from pipeline.camera.blur import blur
    from pipeline.camera.psf.gaussian import gaussian
    from pipeline.learning import images
    from pipeline.streams import stream

    low, high = intrinsic_px
    patches = np.empty((count, 1, PATCH_PX, PATCH_PX), np.float32)
    for index in range(count):
        generator = stream(seed, PURPOSE, index)
        view = images.view(tiles[index % len(tiles)], generator, PATCH_PX, ANISOTROPY)
        spread = generator.uniform(low, high)
        patches[index, 0] = blur(view, gaussian(spread)) if spread >= LEAST_BLUR_PX else view
    return patches.clip(0, 1)
