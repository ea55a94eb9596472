"""Blur relative to a generic lens, for a camera of which nothing is known: an estimator calibrated to a generic camera.

A network that answers the *total* MTF counts a lens's own blur among what it sees. With sharp frames of the camera this
is taken out (`Estimator.calibrated`, `pipeline.blur.camera_calibration`). Without any, the best guess is a typical
lens: sharp procedural pictures are seen through lenses of any usual quality,

    S = I * G_a,    a ~ U(intrinsic_px),    G_a a Gaussian of standard deviation a, integrated over pixels,

and the estimator is calibrated to them as to one camera (`camera_calibration.calibrate`): it learns the blur that was
added to S when a
is not known. Frames of a better lens than most, or a rendering, which has none, then read too sharp; there the total
MTF is the right answer.

Ours. The paper's network learns kernels alone, added to frames that have a lens's blur already: a similar answer.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pipeline.blur.base import PATCH_PX

PURPOSE = "typical camera"
PICTURES = f"{PURPOSE} image"
"""Purpose of the pictures' random streams: none of them is a training picture."""

ANISOTROPY = 0.7
LEAST_BLUR_PX = 0.05
"""A Gaussian narrower than this changes no grey level."""


def sharp_patches(
    tiles: NDArray[np.uint8], count: int, intrinsic_px: Sequence[float], seed: int
) -> NDArray[np.float32]:
    """Sharp pictures, each seen through a lens of its own.

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
