"""The variance of a sum of terms that are correlated with their neighbours, as the noise of a processed picture is.

Of terms g_i of mean 0 along a line, with weights that fall from 1 to 0 (Bartlett) over k neighbours,

    var(sum g) = sum_i g_i^2 + 2 sum_{d < k} (1 - d / k) sum_i g_i g_{i + d},

which is never negative. Of independent terms it is the sum of the squares, on average.

Source: W. Newey, K. West: A simple, positive semi-definite, heteroskedasticity and autocorrelation consistent
covariance matrix, Econometrica 55 (1987).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

NEIGHBOURS = 8  # pixels; a codec's blocks are as long


def sum_variance(terms: NDArray[np.float64]) -> NDArray[np.float64]:
    """The variance of the sum of terms.

    Args:
        terms: (N, k) of k sums, in steps of a pixel, any unit.

    Returns:
        (k,) in the unit's square.
    """
    variance = np.square(terms).sum(axis=0)
    for distance in range(1, min(NEIGHBOURS, len(terms))):
        variance += 2 * (1 - distance / NEIGHBOURS) * (terms[distance:] * terms[:-distance]).sum(axis=0)
    return np.asarray(variance)
