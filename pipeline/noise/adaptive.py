"""The default noise estimator: right on white sensor noise and on pictures as cameras deliver them.

Two networks answer:

    cellwise      white noise: rendered frames, raw and machine-vision cameras, noise added in software
    correlated    noise behind demosaicing, denoising, sharpening or a codec

and the answer is a mean of their ln(1 + sigma), t, with weight w of the second:

    w = 0    where flat areas look white, certainly hold noise (`PLAIN_SIGMA_DN`) and vary less than `FLAT_EXCESS` times
             what `cellwise` estimates
    w = 1    where they do not look white, and a codec shows or the noise is clearly correlated (`decided`), or
             demosaicing shows (`DEMOSAICED`)
    w = 1 / (1 + exp(-(o + s (t_2 - t_1) + c p)))    elsewhere, but at least that of sharpened noise (`SHARPENED`) or
             demosaicing

Codecs, scaling and rotation take the finest part of noise away, and `cellwise`, which tells noise from texture by it,
then reads less than there is or nothing; the second network does not. So it is believed where it reads more (`OFFSET`,
`SLOPE`), the sooner the more p, 0 to 1, the picture shows of such processing (`PROCESSING`): the traces of a codec, or
noise that looks smoothed (`SMOOTHED`). Sharpening, in a camera or by scaling with cubic and wider kernels,
leaves noise strongest in its finest part, of which `cellwise` reads 10 to 45 % too much; the second network does not.
Traces of a codec are steps at block edges, vanished fine detail (`compressed`) and quantised transform blocks
(`pipeline.noise.block_quantisation`). The mean and its interval, with what neither network can rule out, are
those of `pipeline.noise.joint_answer`.

There is no answer (`pipeline.noise.abstentions`) where

    (1 - w) reach_1 + w reach_2  >  (1 - w) widest_1 + w widest_2

with the reach of both intervals of ln(1 + sigma), unless noise is certainly weak. What is wide depends on what shows
that the picture was processed: behind a codec, smooth grain is probably noise; where nothing shows one, it may as well
be asphalt, gravel or foliage, which rendered pictures have and which no statistic of one patch separates from noise
that was smoothed. Nor is there an answer to grain that belongs to the ground, to noise that a codec may have removed,
that a filter left at edges only, or that neither network has seen the like of.

`NoiseEstimate.sigma_dn` is the total noise of the delivered picture, `white_sigma_dn` its white part. Each network runs
where it may have a weight: a patch that is plainly white skips the second one, a coded or clearly correlated one the
first.

The constants were chosen on the development pictures of two sets of real camera noise (CC and PolyU), on frames with
white noise, and on such frames behind JPEG and video codecs; `WIDEST_REACH` on *Sim* and on procedural scenes through
cameras without a codec, and checked on KITTI, Udacity and the *Sim* of the paper's authors. Those of w are a logistic
regression on 6,360 patches of *Sim*, KITTI, Udacity and the authors' *Sim* with 0 to 25 DN as they are, behind JPEG 90,
Motion JPEG, MPEG-4 and H.264, scaled by 0.7 and 1.3, smoothed and turned by 2 degrees. Fitted without one of these four
sets and judged on it, the mean error of ln(1 + sigma), before abstentions, fell from .297 to .274, of frames as they
are from .132 to .130. `SMOOTHED` and `SHARPENED` were chosen on patches of the same frames and of the means of CC, with
2 to 12 DN, as they are, scaled, turned, rectified, blurred and sharpened.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.constants import FULL_SCALE_DN
from pipeline.errors import InputError
from pipeline.noise.abstentions import UNDETECTED_LOW_DN, Evidence, reasons
from pipeline.noise.base import Measured
from pipeline.noise.block_quantisation import at_corner
from pipeline.noise.cell_mapper import CellMapper
from pipeline.noise.cellwise import RELEASED as RELEASED_CELLWISE
from pipeline.noise.cellwise import SATURATED_FRACTION, Cellwise
from pipeline.noise.correlated import RELEASED as RELEASED_CORRELATED
from pipeline.noise.correlated import Correlated
from pipeline.noise.joint_answer import Levels, Second, conceded, joined, raised, widened
from pipeline.noise.maps import CELL_PX
from pipeline.noise.networks.correlated_features import (
    LEAST_PX,
    Grey,
    Moments,
    anisotropy,
    fine_windows,
    flat_areas,
    moments,
    principal_noise_dn,
)
from pipeline.noise.traces.alternation import alternating
from pipeline.noise.traces.codec import Traces, codec_traces
from pipeline.noise.traces.demosaicing import lattice_contrast
from pipeline.noise.traces.streaks import streaked

RELEASED_BESIDE = {"cellwise_weights": RELEASED_CELLWISE, "correlated_weights": RELEASED_CORRELATED}
"""Option -> the released weights that it stands for; for records of what was measured with what."""

OFFSET, SLOPE, PROCESSING = -3.6, 6.8, 3.2
"""Of the logistic weight: w = 1/2 where 1 + sigma of the second network is 1.7 times that of `cellwise`, or 1.06 times
where processing shows."""

SMOOTHED, SMOOTHED_CORRELATION, SMOOTHED_DN = (0.05, 0.1), (0.08, 0.14), (2.0, 3.0)
"""Noise looks smoothed, as by scaling, where adjacent pixels of flat areas are that much more correlated than diagonal
ones, where the second network finds the noise correlated, and where it reads enough for that to be a property of the
noise rather than of texture: p is the product of how far each lies between its two ends. It is above 0 in 6 to 16 % of
the patches with 5 to 12 DN as they are (most on the two *Sim*), scaled by .7 or .85 with a low-pass in 58 to 95 %."""

CORRELATED_ALONE = 0.45
"""Correlation of adjacent pixels from which the second network decides alone. Of noise this correlated `cellwise` reads
next to nothing; where a codec shows it takes as much time and changes as good as nothing."""

FLATTEST_TENTH = 0.661
"""Deviation about the mean in the flattest tenth of windows of 4 x 4 pixels with white noise of 1: the root of the mean
of the lowest tenth of a chi-squared distribution of 15 degrees of freedom, over 16."""

FLAT_EXCESS = 1.25
"""How much more than the estimated white noise flat areas may vary, before the second network is asked too."""

PLAINLY_WHITE = 0.04
"""Lag-1 correlation of flat windows below which noise that certainly exceeds `PLAIN_SIGMA_DN` may be white. Noise of 5
and 10 DN that a mild codec (JPEG 90, Motion JPEG) has passed lies at 0.02 to 0.09, where `cellwise` reads 0.1 to 0.9 of
it; of white noise of 5 and 10 DN nine tenths lie below on photographs, but none and six tenths on the authors' *Sim*,
whose patches then ask both networks."""

SHARPENED = (0.04, 0.06)
"""By how much adjacent pixels of flat areas are less correlated than diagonal ones, over which the weight of the second
network rises to 1. On KITTI, Udacity and the means of CC 1 % of the patches with white noise of 2 to 12 DN exceed the
first, of those behind an added Laplacian (all of it or half) 98 to 100 %, with 5 and 12 DN behind scaling by half with
a cubic kernel or by 0.7 with a Lanczos one 71 to 97 %; on rendered texture fewer. Behind an unsharp mask of 1 px few
do; `cellwise` then reads 2 to 10 % too much, as intervals allow for."""

DEMOSAICED = (0.2, 0.35)
"""Contrast of the chessboard that demosaicing leaves (`pipeline.noise.traces.demosaicing`) over which the weight of the
second network rises to 1, where flat areas do not look white. Of 1,638 patches of KITTI, Udacity and the means of CC
and PolyU with 4 to 15 DN before OpenCV's four methods 74 % are answered then, 8 % of these wrong (by 20 % and .5 DN),
and intervals hold 99.6 %; without it 32, 13 and 95 %."""

SURE_SIDE_PX = 128
"""Side of the patches for which `SMOOTHED`, `SHARPENED` and `DEMOSAICED` hold; flat areas of smaller ones are fewer."""

PLAIN_SIGMA_DN = 1.0

SURELY_NOISE_DN = 0.3
"""Lower end of an interval beyond which there is noise for certain, which may be uneven (`joint_answer.raised`)."""

REAL_CAMERAS = 1.5
"""How much wider the second network's intervals must be on real cameras than on the simulated ones that set them."""

WIDEST_REACH = 0.22
"""Half-width of the interval of ln(1 + sigma) beyond which there is no answer where nothing shows a codec: 25 % either
way. Asphalt and cobbles of rendered scenes, which the second network takes for noise of 5 to 17 DN, lie beyond it."""

WIDEST_WHITE_REACH = 0.9
"""The same, upwards, for `cellwise`: beyond it, on foliage and gravel, its answer is far too low."""

WIDEST_SMOOTHED_REACH = 0.35  # the same where noise looks smoothed and both see it (`SEEN_BY_BOTH`): a factor of 1.4
SEEN_BY_BOTH = (0.15, 0.3)
"""Lower end of the interval of `cellwise` over sigma of the second network, over which both see the same noise: .27 by
the median behind scaling of 12 DN, .08 on a noise-free lawn that the second network reads as 15 DN."""

WIDEST_DEMOSAICED_REACH = 0.4  # the same where demosaicing shows: a factor of 1.5
WIDEST_COMPRESSED_REACH = 0.47  # as `WIDEST_REACH`, behind a strong codec: a factor of 1.6
WIDEST_QUANTISED_REACH = 0.65  # the same where only quantised transform blocks show a codec


class Adaptive(CellMapper):
    """See the module.

    Args:
        cellwise_weights, correlated_weights: weight files of the two networks; None for the released ones.
        widest_reach, widest_compressed_reach: half-width of the second network's interval of ln(1 + sigma) beyond which
            a patch is abstained from, without a codec and with the traces of a strong one.
        widest_white_reach: the same where the noise is white, for the upper half of the interval.
        saturated_fraction: of saturated pixels, (0, 1], from which a patch is refused.

    Raises:
        InputError: weights that are absent, broken or of another network; an option out of range.
    """

    min_size_px = LEAST_PX

    def __init__(
        self,
        cellwise_weights: str | Path | None = None,
        correlated_weights: str | Path | None = None,
        *,
        widest_reach: float = WIDEST_REACH,
        widest_compressed_reach: float = WIDEST_COMPRESSED_REACH,
        widest_white_reach: float = WIDEST_WHITE_REACH,
        saturated_fraction: float = SATURATED_FRACTION,
    ) -> None:
        super().__init__(saturated_fraction)
        for name, reach in (
            ("widest_reach", widest_reach),
            ("widest_compressed_reach", widest_compressed_reach),
            ("widest_white_reach", widest_white_reach),
        ):
            check_reach(name, reach)
        self.white = Cellwise(cellwise_weights)
        self.correlated = Correlated(correlated_weights)
        self.released = self.white.released and self.correlated.released
        self.widest_reach, self.widest_compressed_reach = widest_reach, widest_compressed_reach
        self.widest_white_reach = widest_white_reach

    def measure_cells(
        self, stack: NDArray[np.floating], reason: NDArray[np.object_]
    ) -> tuple[Measured, NDArray[np.float32]]:
        """See `pipeline.noise.cell_mapper.CellMapper.measure_cells`; writes its own reasons to abstain."""
        height, width = (side // CELL_PX for side in stack.shape[1:])
        levels = Levels.zero(len(stack), (height, width))
        seen = _screened(stack)
        self._answer_white(stack, reason, np.flatnonzero(seen.looks_white), levels)
        plain = seen.looks_white & (levels.low_dn > PLAIN_SIGMA_DN) & (seen.flat_dn < FLAT_EXCESS * levels.sigma_dn)
        plain &= seen.sharpened == 0
        indices = np.flatnonzero(~plain)
        answer = self.correlated.predict(stack[indices], [seen.moments[index] for index in indices])
        answer = replace(answer, reach=REAL_CAMERAS * answer.reach)
        traces = codec_traces(answer.statistics, stack.shape[1] * stack.shape[2])
        alone = decided(answer.correlation, traces.coded) & ~seen.looks_white[indices]
        self._answer_white(stack, reason, indices[~seen.looks_white[indices] & ~alone], levels)
        smoothed = seen.smoothed[indices] * np.interp(answer.correlation, SMOOTHED_CORRELATION, (0.0, 1.0))
        smoothed *= np.interp(answer.sigma_dn, SMOOTHED_DN, (0.0, 1.0))
        processed = np.where(traces.coded, 1.0, smoothed)
        either = weights(levels.sigma_dn[indices], answer.sigma_dn, processed)
        least = np.maximum(seen.sharpened, seen.demosaiced)[indices]
        weight = np.where(alone, 1.0, np.maximum(either, least))
        second = Second(indices, answer, traces, weight, seen.demosaiced[indices])

        joint = joined(levels, second)
        wide = self._reaches_too_far(levels, second, smoothed)
        reason[:] = reasons(_evidence(seen, second, joint, wide, alternating(stack)), reason)
        uncorrelated = np.flatnonzero(plain | (seen.sharpened > 0))
        joint = widened(conceded(joint, second, seen.flat_dn, seen.flat_correlation), uncorrelated)
        detected = np.flatnonzero(joint.low_dn > SURELY_NOISE_DN)
        joint = raised(joint, detected, seen.principal_dn[detected])
        white_sigma_dn = np.minimum(joint.white_sigma_dn, joint.sigma_dn)
        measured = Measured(joint.sigma_dn, joint.low_dn, joint.high_dn, white_sigma_dn, joint.correlation)
        return measured, joint.cells_dn

    def _answer_white(
        self, stack: NDArray[np.floating], reason: NDArray[np.object_], indices: NDArray[np.intp], levels: Levels
    ) -> None:
        """Writes the answers of `cellwise` for the patches with these indices."""
        if len(indices):
            part = stack if len(indices) == len(stack) else stack[indices]
            white, levels.cells_dn[indices] = self.white.measure_cells(part, reason[indices])
            levels.sigma_dn[indices], levels.low_dn[indices] = white.sigma_dn, white.low_dn
            levels.high_dn[indices], levels.white_sigma_dn[indices] = white.high_dn, white.sigma_dn

    def _reaches_too_far(self, levels: Levels, second: Second, smoothed: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(N,) whether the interval of both networks is wider than it may be; see the module.

        Args:
            levels: of `cellwise`.
            second: of the other network.
            smoothed: (K,) how much the noise of patches that ask it looks smoothed, 0 to 1.
        """
        share = levels.low_dn[second.indices] / np.maximum(second.answer.sigma_dn, UNDETECTED_LOW_DN)
        smoothed = smoothed * np.interp(share, SEEN_BY_BOTH, (0.0, 1.0))
        reach = np.log1p(levels.high_dn) - np.log1p(levels.sigma_dn)
        widest = np.full(len(reach), self.widest_white_reach)
        reach[second.indices] += second.weight * (second.answer.reach - reach[second.indices])
        widest[second.indices] += second.weight * (self._widest(second, smoothed) - widest[second.indices])
        return np.asarray(reach > widest)

    def _widest(self, second: Second, smoothed: NDArray[np.float64]) -> NDArray[np.float64]:
        """Reach of the second network's interval beyond which there is no answer, (K,)."""
        shown = ((smoothed, WIDEST_SMOOTHED_REACH), (second.demosaiced, WIDEST_DEMOSAICED_REACH))
        uncoded = np.maximum.reduce(
            [self.widest_reach + part * max(widest - self.widest_reach, 0.0) for part, widest in shown]
        )
        uncoded_or_quantised = np.where(second.traces.quantised, WIDEST_QUANTISED_REACH, uncoded)
        return np.asarray(np.where(second.traces.strong, self.widest_compressed_reach, uncoded_or_quantised))


@dataclass(frozen=True)
class Screened:
    """What is measured of all N patches before a network answers.

    Attributes:
        looks_white: (N,) flat areas vary without correlation, and no codec shows at the corner.
        streaks: (N,) neighbours are equal too often.
        flat_dn: (N,) the white noise with which the flattest tenth of windows would vary as it does, DN.
        flat_correlation: (N,) of adjacent pixels there.
        smoothed: (N,) how much flat areas look smoothed, by `SMOOTHED`, 0 to 1.
        sharpened: (N,) least weight of the network for correlated noise, by `SHARPENED`.
        demosaiced: (N,) likewise, by `DEMOSAICED`; 0 where flat areas look white.
        principal_dn: (N,) white noise by principal components, DN.
        moments: of patches that do not look white.
    """

    looks_white: NDArray[np.bool_]
    streaks: NDArray[np.bool_]
    flat_dn: NDArray[np.float64]
    flat_correlation: NDArray[np.float64]
    smoothed: NDArray[np.float64]
    sharpened: NDArray[np.float64]
    demosaiced: NDArray[np.float64]
    principal_dn: NDArray[np.float64]
    moments: list[Moments | None]


def check_reach(name: str, value: float) -> None:
    """An option that is a half-width of an interval of ln(1 + sigma).

    Raises:
        InputError: it is no positive number.
    """
    if not (isinstance(value, Real) and value > 0):
        raise InputError(f"{name}: expected a number above 0, not {value!r}")


def _whole(patch: NDArray[np.floating]) -> Grey:
    """A patch in whole grey levels."""
    return np.rint(patch * np.float32(FULL_SCALE_DN)).astype(np.uint8)


def _screened(stack: NDArray[np.floating]) -> Screened:
    """`Screened` of patches (N, H, W)."""
    white, streaks = np.zeros((2, len(stack)), bool)
    deviation_dn, adjacent, diagonal, principal_dn, lattice = np.zeros((5, len(stack)))
    known: list[Moments | None] = []
    for index, patch in enumerate(stack):
        pixels = _whole(patch)
        fine = fine_windows(pixels)
        deviation_dn[index], adjacent[index], diagonal[index] = flat_areas(pixels, fine)
        white[index] = adjacent[index] < PLAINLY_WHITE and not at_corner(pixels)
        streaks[index] = not white[index] and streaked(fine)
        known.append(None if white[index] else moments(pixels, fine))
        lattice[index] = 0.0 if white[index] else lattice_contrast(pixels)
        principal_dn[index] = principal_noise_dn(pixels, fine)
    uncertain = max(SURE_SIDE_PX / np.sqrt(stack.shape[1] * stack.shape[2]), 1.0)
    smoothed, sharpened, demosaiced = (
        np.interp(difference, np.multiply(ends, uncertain), (0.0, 1.0))
        for difference, ends in (
            (adjacent - diagonal, SMOOTHED), (diagonal - adjacent, SHARPENED), (lattice, DEMOSAICED),
        )
    )  # fmt: skip
    flat_dn = deviation_dn / FLATTEST_TENTH
    return Screened(white, streaks, flat_dn, adjacent, smoothed, sharpened, demosaiced, principal_dn, known)


def decided(correlation: NDArray[np.float64], coded: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Of patches whose flat areas do not look white: those that the network for correlated noise answers alone.

    Args:
        correlation: (N,) of adjacent pixels, as that network estimates it.
        coded: (N,) whether the patches show the traces of a codec.

    Returns:
        (N,).
    """
    return np.asarray(coded | (correlation >= CORRELATED_ALONE))


def weights(
    white_dn: NDArray[np.float64], correlated_dn: NDArray[np.float64], processed: NDArray[np.floating | np.bool_]
) -> NDArray[np.float64]:
    """Weight of the network for correlated noise where both answer; see the module.

    Args:
        white_dn: (N,) sigma of `cellwise`, DN.
        correlated_dn: (N,) sigma of the other network for the same patches, DN.
        processed: (N,) how much processing they show, 0 to 1.

    Returns:
        (N,) in (0, 1).
    """
    apart = np.log1p(correlated_dn) - np.log1p(white_dn)
    return np.asarray(1 / (1 + np.exp(-(OFFSET + SLOPE * apart + PROCESSING * processed))))


def _evidence(
    seen: Screened, second: Second, levels: Levels, reaches_too_far: NDArray[np.bool_], alternates: NDArray[np.bool_]
) -> Evidence:
    """What is known of all N patches when it is decided whether to answer; (N,) each of the last two."""

    def everywhere(values: NDArray[Any]) -> NDArray[Any]:
        """(N,) of the patches that asked the second network, 0 or False elsewhere."""
        spread = np.zeros(len(alternates), values.dtype)
        spread[second.indices] = values
        return spread

    traces = second.traces
    return Evidence(
        sigma_dn=levels.sigma_dn,
        low_dn=levels.low_dn,
        high_dn=levels.high_dn,
        weight=everywhere(second.weight),
        reaches_too_far=reaches_too_far,
        correlation=everywhere(second.answer.correlation),
        anisotropy=everywhere(anisotropy(second.answer.statistics)),
        traces=Traces(*(everywhere(getattr(traces, part.name)) for part in fields(traces))),
        flat_correlation=seen.flat_correlation,
        streaks=seen.streaks,
        alternates=alternates,
    )
