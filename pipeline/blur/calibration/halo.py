"""Kernels with a wide halo in a calibrated answer: the network that was trained on them leads where it sees one.

The main spectral network knows compact kernels. Of a core in a wide halo (spherical aberration, coma, a large mirror
lens) it sees the core and answers far too sharp; the network for processed pictures was trained with halos and rendered
lenses and reads them, but is a little worse on compact kernels. A halo spreads light widely, and in all directions: it
lowers the MTF from the lowest frequencies on, where a compact kernel of a few pixels leaves it near 1, and about as
much horizontally as vertically. With M the MTF by the map of both networks, M' that by a map of the latter alone, e_H
and e_V the mean of M - M' over the three lowest frequencies of either direction,

    logit(answer) = (1 - s) logit(M) + s logit(M'),      s = clip((e - 0.005) / 0.015, 0, 1),
    e = (e_H + e_V) / 2 - |e_H - e_V|.

Under strong noise the lowest frequencies hardly tell a halo from a compact core, and M' is the worse of both: s falls
to 0 between 5 and 15 DN of noise, as the networks see it. (With 25 DN the error of linear motions on KITTI was a
twentieth larger with s than without; up to 7 DN rendered lenses were read better with it.)

On rendered lenses of photographs and of KITTI frames kept apart this lowered the error of the median by 8 and 22 %;
that on the paper's kernels fell by 0.03 points there or stayed, that of single patches rose by 0.2 points on KITTI
(measured beside a map alone, without `pipeline.blur.calibration.output_layers`). By the mean over all frequencies small
motions were taken for halos, and without the difference of directions scenes of one direction. On a camera that
sharpens strongly the second network may be wrong wherever it reads less: `pipeline.blur.camera_calibration` has an M'
only where scenes held out allow it. Ours.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.blur.calibration.affine_logits import Floats, logit, sigmoid

DIRECTIONS = 2
LOWEST = 3
"""Frequencies of a direction that the excess of M over M' is averaged over."""
FROM = 0.005
FULLY_FROM = 0.02
"""Excess e from which M' is mixed in, and from which it stands alone."""
NOISE_DN = (5.0, 15.0)
"""Noise up to which a halo is told from a compact core, and from which not at all."""


def mixed(joint: Floats, alone: Floats, sigma_dn: NDArray[np.floating] | None = None) -> Floats:
    """The calibrated MTF.

    Args:
        joint: (N, V) M in [0, 1], frequencies of the horizontal direction first.
        alone: (N, V) M'.
        sigma_dn: (N,) noise of the patches, DN; None for none.

    Returns:
        (N, V).
    """
    excess = (joint - alone).reshape(len(joint), DIRECTIONS, -1)[..., :LOWEST].mean(axis=2)
    alike = excess.mean(axis=1) - np.abs(excess[:, 0] - excess[:, 1])
    share = np.clip((alike - FROM) / (FULLY_FROM - FROM), 0.0, 1.0)
    if sigma_dn is not None:
        share *= np.clip((NOISE_DN[1] - sigma_dn) / (NOISE_DN[1] - NOISE_DN[0]), 0.0, 1.0)
    share = share[:, None]
    return np.where(share > 0, sigmoid((1 - share) * logit(joint) + share * logit(alone)), joint)
