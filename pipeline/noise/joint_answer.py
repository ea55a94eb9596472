"""One answer from both networks of the default noise estimator: their weighted mean, and an interval that both allow.

With t = ln(1 + sigma), the weight w of the network for correlated noise, and its answer t_2 with reach r_2,

    processed   where noise is as correlated as behind a camera's processing, t_2 moves by a + b ln((1 + white) / (1 +
                sigma)) of its own answers (`WHITE_PART`): the noise of real cameras is stronger than it looks where it
                has kept much of its white part
    detected    t_2' = max(t_2 - max(r_2 - t_2, 0), 0): where the interval reaches zero the noise is not detected, and
                the answer moves towards zero by as much as the interval would reach below it
    joined      t = (1 - w) t_1 + w t_2', ends of the interval likewise, wider by sqrt(w (1 - w)) |t_2 - t_1|
    conceded    where flat areas are correlated (`FILTERED`), or no noise is detected, the upper end is at least that of
                the second network, whatever w is, up to `MOST_HIDDEN` times what the flattest areas allow: `cellwise`,
                whose interval is that of white noise, does not know how much smoothed noise texture may hide. Where
                they are correlated along rows or columns alone (`DIRECTIONAL`) neither network knows: the finest
                detail along these lines is gone, by a filter behind the noise, as of band-limited analogue video, or by
                motion; or the scene's texture has that direction. The end then reaches as far as these areas vary.
                Where a codec shows and the interval ends below `WEAK_DN` there may as well be no noise: the lower end
                is zero
    widened     `cellwise` does not know of mild codecs, which leave strong noise white and no trace of themselves, but
                change its strength, nor of a sensor's fixed pattern: where it answers alone, or together with the
                other network because the noise looks sharpened, the interval is wider by `PLAIN_PART`
    raised      where there is noise for certain, the upper end is at least `PRINCIPAL_REACH` times the white noise by
                principal components of the whole patch, however it is distributed over it. Both networks take it for
                that of a camera, and read a half to four fifths of what a filter that looks for similar areas leaves at
                edges and in texture
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.noise.abstentions import FILTERED, UNDETECTED_LOW_DN, WEAK_DN
from pipeline.noise.correlated import Prediction
from pipeline.noise.networks.correlated_features import anisotropy
from pipeline.noise.traces.codec import Traces

PLAIN_PART = 0.1
"""Of ln(1 + sigma), added in squares to both halves of the interval of white and sharpened noise. JPEG 80 to 95, Motion
JPEG and MPEG-4 change noise of 7 to 25 DN by up to 6 % of ln(1 + sigma), and real sensors have a fixed pattern besides.
"""

WHITE_PART = (0.3, 0.27)
"""a and b of the module. Fitted to seven of the eight cameras of CC and PolyU and judged on the eighth, such a line
within `MOST_MOVED` lowers the mean error of each camera, of all patches from .48 to .33 DN."""

MOST_MOVED = (-0.05, 0.12)
"""Of ln(1 + sigma), at most, by `WHITE_PART`. Noise that was white before a codec or a filter needs no such move; where
it looks like a camera's it is moved none the less, upwards mostly. With -0.3 as the lower end a camera whose noise is
less white than that of those fitted is read too low: the error of all patches above is .38 DN then, not .33."""

PROCESSED = (0.4, 0.5)  # correlation of adjacent pixels over which it sets in
MOST_HIDDEN = 3.0
"""How much noise there may be over the white noise with which the flattest windows would vary as they do. It is at most
1.2 times that as recorded, scaled or turned, 3 behind a bilateral filter and in most pictures of real cameras."""

DIRECTIONAL, DIRECTIONAL_HIDES = 0.45, 2.0
"""Difference of the lag-1 correlations along rows and columns in flat windows beyond which these have a direction, and
how much noise there may be then over the white noise with which the flattest would vary as they do. Noise smoothed
along rows or columns by 1 to 2 px lies beyond in nine tenths of all patches of KITTI and Udacity, and is 1.1 to 1.8
times the latter; both networks read none. As recorded 3 % of the patches of KITTI lie beyond, none of CC, .5 % of
PolyU and a third of the authors' *Sim*, whose road is seen at a slant."""

PRINCIPAL_REACH = 1.15
"""Over the noise by principal components. Behind non-local means the intervals of patches with 10 DN so hold 93 % of
the noise (32 % without this end), behind a bilateral filter with 25 DN 81 % (43 %); those of even white noise are 9 %
wider at 2 DN and 1 to 3 % from 5 DN on."""


@dataclass(frozen=True)
class Levels:
    """Answers for all N patches, which are written one network after the other.

    Attributes:
        sigma_dn, low_dn, high_dn, white_sigma_dn, correlation: (N,), see `pipeline.noise.base.Measured`.
        cells_dn: (N, H // 8, W // 8).
    """

    sigma_dn: NDArray[np.float64]
    low_dn: NDArray[np.float64]
    high_dn: NDArray[np.float64]
    white_sigma_dn: NDArray[np.float64]
    correlation: NDArray[np.float64]
    cells_dn: NDArray[np.float32]

    @classmethod
    def zero(cls, patches: int, cells: tuple[int, int]) -> Levels:
        """Levels of so many patches, each of (rows, columns) of cells, before anything is written."""
        sigma, low, high, white, correlation = np.zeros((5, patches))
        return cls(sigma, low, high, white, correlation, np.zeros((patches, *cells), np.float32))

    def copy(self) -> Levels:
        """The same in arrays of its own."""
        return replace(self, **{name: values.copy() for name, values in vars(self).items()})


@dataclass(frozen=True)
class Second:
    """Answers of the network for correlated noise for the K patches that ask it.

    Attributes:
        indices: (K,) of these patches.
        answer: its answers.
        traces: of a codec in them.
        weight: (K,) of its answers.
        demosaiced: (K,) how sure it is that they were demosaiced and hardly processed since, 0 to 1.
    """

    indices: NDArray[np.intp]
    answer: Prediction
    traces: Traces
    weight: NDArray[np.float64]
    demosaiced: NDArray[np.float64]


def joined(levels: Levels, second: Second) -> Levels:
    """The answers of `cellwise` with those of the second network joined; see the module.

    Args:
        levels: of `cellwise`.
        second: of the other network.
    """
    at, answer, weight = second.indices, second.answer, second.weight
    joint = levels.copy()
    level, white_level = np.log1p(answer.sigma_dn), np.log1p(levels.sigma_dn[at])
    apart = np.sqrt(weight * (1 - weight)) * np.abs(level - white_level)  # deviation of two values by their weights
    level = level + (1 - second.demosaiced) * _moved(answer)
    detected = np.maximum(level - np.maximum(answer.reach - level, 0.0), 0.0)
    joint.sigma_dn[at] = _between(levels.sigma_dn[at], detected, weight)
    joint.low_dn[at] = _between(levels.low_dn[at], np.maximum(level - answer.reach, 0.0), weight, -apart)
    joint.high_dn[at] = _between(levels.high_dn[at], level + answer.reach, weight, apart)
    joint.white_sigma_dn[at] = _between(levels.white_sigma_dn[at], np.log1p(answer.white_sigma_dn), weight)
    joint.correlation[at] = answer.correlation
    scale = joint.sigma_dn[at] / np.maximum(np.sqrt((answer.cells_dn**2).mean(axis=(1, 2))), 1e-6)
    adapted = answer.cells_dn * scale[:, None, None].astype(np.float32)
    joint.cells_dn[at] = np.where(weight[:, None, None] >= 0.5, adapted, levels.cells_dn[at])
    return joint


def _moved(answer: Prediction) -> NDArray[np.float64]:
    """(K,) by how much the answers of the second network move for processed noise; see `WHITE_PART`."""
    processed = np.interp(answer.correlation, PROCESSED, (0.0, 1.0))
    white_part = np.log1p(answer.white_sigma_dn) - np.log1p(answer.sigma_dn)
    return np.asarray(processed * np.clip(WHITE_PART[0] + WHITE_PART[1] * white_part, *MOST_MOVED))


def conceded(
    joint: Levels, second: Second, flat_dn: NDArray[np.float64], flat_correlation: NDArray[np.float64]
) -> Levels:
    """The joint answers with ends of intervals moved to what a network cannot rule out; see the module.

    Args:
        joint: answers of both networks.
        second: of that for correlated noise.
        flat_dn: (N,) the white noise with which the flattest tenth of windows would vary as it does, DN.
        flat_correlation: (N,) of adjacent pixels there.
    """
    at, answer = second.indices, second.answer
    high, low = joint.high_dn[at], joint.low_dn[at]
    may_hide = (flat_correlation[at] > FILTERED) | (low < UNDETECTED_LOW_DN)
    most = np.minimum(answer.high_dn, MOST_HIDDEN * flat_dn[at])
    high = np.where(may_hide, np.maximum(high, most), high)
    has_direction = np.abs(anisotropy(answer.statistics)) > DIRECTIONAL
    high = np.where(has_direction, np.maximum(high, DIRECTIONAL_HIDES * flat_dn[at]), high)
    may_be_none = second.traces.coded & (high < WEAK_DN)
    moved = joint.copy()
    moved.high_dn[at], moved.low_dn[at] = high, np.where(may_be_none, 0.0, low)
    return moved


def raised(joint: Levels, detected: NDArray[np.intp], principal_dn: NDArray[np.float64]) -> Levels:
    """The joint answers with upper ends that allow for unevenly distributed noise; see the module.

    Args:
        joint: answers of both networks.
        detected: indices of the K patches in which there is noise for certain.
        principal_dn: (K,) white noise of these by principal components, DN.
    """
    wide = joint.copy()
    wide.high_dn[detected] = np.maximum(joint.high_dn[detected], PRINCIPAL_REACH * principal_dn)
    return wide


def widened(joint: Levels, at: NDArray[np.intp]) -> Levels:
    """The joint answers with wider intervals of noise that is not correlated; see `PLAIN_PART`.

    Args:
        joint: answers of both networks.
        at: indices of the patches with such noise, plainly white or sharpened.
    """
    level = np.log1p(joint.sigma_dn[at])
    below, above = (np.hypot(np.log1p(end[at]) - level, PLAIN_PART) for end in (joint.low_dn, joint.high_dn))
    wide = joint.copy()
    wide.low_dn[at], wide.high_dn[at] = np.expm1(np.maximum(level - below, 0.0)), np.expm1(level + above)
    return wide


def _between(
    first_dn: NDArray[np.float64],
    level: NDArray[np.float64],
    weight: NDArray[np.float64],
    beyond: NDArray[np.float64] | float = 0.0,
) -> NDArray[np.float64]:
    """A weighted mean, and so much beyond it, DN: the first where the weight is 0, expm1 of the level where it is 1."""
    return np.expm1(np.maximum((1 - weight) * np.log1p(first_dn) + weight * level + beyond, 0.0))
