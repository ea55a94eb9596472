"""Labelled samples for the fusion gate: blurred procedural pictures, and what GBB and PMP make of them.

    D = round_or_floor(clip(255 (I * h * G_a) + n)),    label(f) = |H(f)| exp(-2 pi^2 a^2 f^2)

as for the networks (`pipeline.learning.samples`): I a procedural view, h a training kernel, G_a the lens, n the noise.
The patch is blurred by that Gaussian integrated over pixels, whose MTF differs from the label's by .25 points on
average and 1.1 at most. A gate trained on the MTF of what blurred errs by 3.98 instead of 4.00 points in
cross-validation, and on the frames of Udacity in Table I by 1.54 instead of 1.52: it is not better, and not released.
Kernels whose mean MTF is above a limit are passed over, because there the fused estimator does not deconvolve.

GBB and PMP see one patch at a time, although they are run on several later: a gate trained on kernels of several
patches relies on them more than pictures of real cameras allow (on KITTI and Udacity the error rose by .4 to .6
points), one trained on single patches gains from better kernels.

Sample i is a pure function of (settings, i). The answers of GBB and PMP, which take a third of a second, are kept in a
cache.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.blur.base import PATCH_PX
from pipeline.blur.settings import FusionRecipe
from pipeline.streams import stream, torch_stream

PURPOSE = "fusion samples"
KERNELS = 12
"""Kernels drawn for a sample, of which the first under the limit is used."""


@dataclass(frozen=True)
class Blurred:
    """One sample.

    Attributes:
        patch: (192, 192) uint8.
        mtf: (2, 8) total MTF.
        sigma_dn: noise added, DN.
    """

    patch: NDArray[np.uint8]
    mtf: NDArray[np.float64]
    sigma_dn: float


def blurred(recipe: FusionRecipe, index: int) -> Blurred:
    """Sample `index`."""
    import torch

    from pipeline.camera import mtf
    from pipeline.camera.blur import blur
    from pipeline.camera.psf.gaussian import gaussian
    from pipeline.learning import images
    from pipeline.learning.samples import KINDS, noise_e, scaled

    generator = stream(recipe.seed, PURPOSE, index)
    kernel = _kernel(recipe, index)
    spread = float(generator.uniform(*recipe.intrinsic_px))
    label = np.asarray(mtf.sample(kernel)) * mtf.gaussian(spread, mtf.FREQUENCIES)
    picture = images.picture(index, recipe.seed, f"{PURPOSE} image")
    view = images.view(picture, generator, PATCH_PX, recipe.anisotropy)
    seen = torch.from_numpy(blur(blur(view, kernel), gaussian(spread)).clip(0, 1))[None]
    sigma_dn, dn = 0.0, seen * 255
    if generator.random() >= recipe.clean_fraction:
        even = generator.uniform(0, recipe.largest_sigma_dn)
        logarithmic = np.exp(generator.uniform(0, np.log(recipe.largest_sigma_dn)))
        sigma_dn = float(even if generator.random() < 0.5 else logarithmic)
        kind = torch.tensor([int(generator.integers(len(KINDS)))])
        noise = noise_e(seen, kind, torch_stream(recipe.seed, PURPOSE, index))
        dn = dn + scaled(noise, torch.tensor([sigma_dn]))
    half = 0.5 if generator.random() < 0.5 else 0.0  # rounded, or truncated as by many cameras' programs
    whole = (dn.clamp(0, 255) + half).floor().clamp(0, 255).to(torch.uint8)
    return Blurred(whole[0].numpy(), label, sigma_dn)


def _kernel(recipe: FusionRecipe, index: int) -> NDArray[np.floating]:
    """The first of a sample's kernels that is under the limit, else the widest of them; unit sum."""
    from pipeline.camera import mtf
    from pipeline.learning.kernels import block

    drawn = block(index, recipe.seed, f"{PURPOSE} kernels", KERNELS, recipe.kernel_distribution)
    means = np.asarray(mtf.sample(drawn)).mean(axis=(1, 2))
    under = np.flatnonzero(means < recipe.largest_mean_mtf)
    kernel = drawn[under[0] if len(under) else int(means.argmin())]
    return np.asarray(kernel / kernel.sum())


def deconvolved(index: int, recipe: FusionRecipe, folder: Path) -> dict[str, NDArray[Any]]:
    """A sample with the answers of GBB and PMP, from the cache or made now and kept there.

    Returns:
        patch: (192, 192) uint8; mtf: (2, 8); sigma_dn: (); others: (2, 2, 8) by GBB and PMP, NaN where no kernel is
        identifiable.
    """
    from pipeline.blur.fusion.members import Deconvolution
    from pipeline.store import read_arrays, write_arrays

    path = folder / f"{index:05d}.npz"
    if not path.is_file():
        sample = blurred(recipe, index)
        others = Deconvolution()(sample.patch[None, None].astype(np.float32) / np.float32(255))
        write_arrays(path, patch=sample.patch, mtf=sample.mtf, sigma_dn=np.array(sample.sigma_dn), others=others)
    return read_arrays(path)
