"""Which patches are blurred alike: those whose MTF estimates agree within the estimates' own spread.

The distance of patch i from the median patch, in units of its Laplace scale b_i,

    d_i = mean over directions and frequencies of |m_i - median m| / b_i,

is below 2 for 97 % of equally blurred patches, because errors of one estimator on one scene have the same sign; a
moving object, or a patch at another distance, stands out. Ours.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

LARGEST_DISTANCE = 2.0
LEAST_SHARE = 0.5  # of the patches that must agree, so that the median means something


def distances(mtf: NDArray[np.floating], scale: NDArray[np.floating]) -> NDArray[np.float64]:
    """Distance of each patch from the median patch, in units of its scale.

    Args:
        mtf: (N, 2, 8) in [0, 1], without NaN.
        scale: (N, 2, 8) Laplace scale of it.

    Returns:
        (N,).
    """
    deviation = np.abs(mtf - np.median(mtf, axis=0)) / scale
    return np.asarray(deviation.mean(axis=(1, 2)), np.float64)


def groups(mtf: NDArray[np.floating], scale: NDArray[np.floating]) -> list[NDArray[np.int_]]:
    """Split patches into those that share a blur and single ones.

    Args:
        mtf: see `distances`.
        scale: see there.

    Returns:
        indices of patches: at most one group with several members, the patches that agree with the median patch where
        those are at least half of all; every other patch is its own group. Together they hold every index once.
    """
    count = len(mtf)
    if count == 0:
        return []
    agreeing = distances(mtf, scale) <= LARGEST_DISTANCE
    if count < 2 or agreeing.sum() < max(2, LEAST_SHARE * count):
        return [np.array([index]) for index in range(count)]
    return [np.flatnonzero(agreeing), *(np.array([index]) for index in np.flatnonzero(~agreeing))]


def spread(indices: Sequence[int] | NDArray[np.int_], count: int) -> NDArray[np.int_]:
    """At most `count` of the indices, evenly spread from the first to the last."""
    every = np.asarray(indices)
    if len(every) <= count:
        return every
    return np.asarray(every[np.linspace(0, len(every) - 1, count).round().astype(int)])
