"""The default noise estimator: right on white sensor noise and on pictures as cameras deliver them.

Two networks answer:

    cellwise      white noise: rendered frames, raw and machine-vision cameras, noise added in software
    correlated    noise behind demosaicing, denoising, sharpening or a codec

and the answer is a mean of their ln(1 + sigma) with weight w of the second:

    w = 1                  where the picture shows the traces of a codec: `cellwise` takes what a codec has removed for
                           a noise-free surface, and what it left for less than it is
    w = ramp of r          of the correlation r of adjacent pixels, 0.24 to 0.38
    w = disagreement       where the intervals of the two do not meet and the second is sure
    w = 0                  where the second network is not sure at all, and nothing points to processing

Traces of a codec are steps at block edges, vanished fine detail (`compressed`) and quantised transform blocks
(`pipeline.noise.block_quantisation`). Where the interval reaches zero the noise is not detected, and the answer moves
towards zero by as much as the interval would reach below it.

A patch is abstained from, as ``"compressed"`` where a codec shows, else as ``"uncertain"``, where

    (1 - w) reach_1 + w reach_2  >  (1 - w) widest_1 + w widest_2

with the reach of both intervals of ln(1 + sigma). What is wide depends on what shows that the picture was processed:
behind a codec, smooth grain is probably noise; where nothing shows one, it may as well be asphalt, gravel or foliage,
which rendered pictures have and which no statistic of one patch separates from noise that was smoothed. An interval
that ends below 2.5 DN is of use however wide it is relative to the answer, unless detail that a codec quantises anew
from shot to shot may flicker unseen. An answer of zero is not given where a codec that left detail shows, be it by
traces too weak for anything else: H.264 removes weak noise, and its own error changes from shot to shot.

Nor is there an answer where grain that looks like smoothed noise is finer along columns than along rows
(`FORESHORTENED`). Noise of a camera has no direction but for row noise; the grain of a road or floor that is seen at a
slant is compressed vertically, whether the frame was coded or not.

Nor where the patch alternates from pixel to pixel (`pipeline.noise.alternation`), as a raw colour mosaic does, where
neighbours are equal as behind a median filter (`pipeline.noise.streaks`), or where the interval begins above
`LARGEST_DN`: neither network has seen such pictures, or as much noise.

`NoiseEstimate.sigma_dn` is the total noise of the delivered picture, `white_sigma_dn` its white part. Each network runs
where it has a weight: a patch that is plainly white and not coded skips the second one, a patch that is coded or
clearly correlated the first.

The constants were chosen on the development pictures of two sets of real camera noise (CC and PolyU), on frames with
white noise, and on such frames behind JPEG and video codecs; `WIDEST_REACH` on *Sim* and on procedural scenes through
cameras without a codec, and checked on KITTI, Udacity and the *Sim* of the paper's authors.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.constants import FULL_SCALE_DN
from pipeline.noise.alternation import alternating
from pipeline.noise.base import ALTERNATING, COMPRESSED, STREAKED, UNCERTAIN, Measured
from pipeline.noise.block_quantisation import at_corner, present, suspected
from pipeline.noise.cell_mapper import CellMapper
from pipeline.noise.cellwise import RELEASED as RELEASED_CELLWISE
from pipeline.noise.cellwise import SATURATED_FRACTION, Cellwise
from pipeline.noise.correlated import RELEASED as RELEASED_CORRELATED
from pipeline.noise.correlated import Correlated, Prediction
from pipeline.noise.correlated_features import (
    GRID_START,
    LEAST_PX,
    QUANTISED_START,
    Moments,
    anisotropy,
    fine_windows,
    moments,
    whiteness,
)
from pipeline.noise.maps import CELL_PX
from pipeline.noise.streaks import streaked

RELEASED_BESIDE = {"cellwise_weights": RELEASED_CELLWISE, "correlated_weights": RELEASED_CORRELATED}
"""Option -> the released weights that it stands for; for records of what was measured with what."""

WHITE_BELOW, CORRELATED_ABOVE = 0.24, 0.38
"""Correlation of adjacent pixels between which the answer moves from one network to the other."""

SURE_BELOW, UNSURE_ABOVE = 0.7, 1.1
"""Half-width of the second network's interval of ln(1 + sigma) between which its disagreement loses its weight."""

CLEARLY_CORRELATED = 0.45  # an unsure network is still asked above this correlation
DISAGREEMENT_WIDTH = 0.15  # of ln(1 + sigma), over which disagreeing intervals hand over
MIN_REACH = 0.05  # of the interval of cellwise, for that comparison
PLAINLY_WHITE = 0.04
"""Lag-1 correlation of flat windows below which noise that certainly exceeds `PLAIN_SIGMA_DN` is white. Noise of 5 and
10 DN that a mild codec (JPEG 90, Motion JPEG) has passed lies at 0.05 to 0.09, where `cellwise` reads 0.1 to 0.7 of it;
of white noise of 5 and 10 DN nine tenths lie below on photographs, but none and six tenths on the authors' *Sim*, whose
patches then ask both networks."""

PLAIN_SIGMA_DN = 1.0
REAL_CAMERAS = 1.5
"""How much wider the second network's intervals must be on real cameras than on the simulated ones that set them."""

COARSE_PART = 0.04
"""Of ln(1 + sigma), added where noise is as correlated as behind a camera's processing: its coarsest part, which real
cameras have more of than the simulated ones, is taken for the picture."""

PROCESSED = (0.4, 0.5)  # correlation of adjacent pixels over which it sets in
WIDEST_REACH = 0.22
"""Half-width of the interval of ln(1 + sigma) beyond which there is no answer where nothing shows a codec: 25 % either
way. Asphalt and cobbles of rendered scenes, which the second network takes for noise of 5 to 17 DN, lie beyond it."""

WIDEST_WHITE_REACH = 0.9
"""The same, upwards, for `cellwise`: beyond it, on foliage and gravel, its answer is far too low."""

WIDEST_COMPRESSED_REACH = 0.47  # the same behind a strong codec: a factor of 1.6
WIDEST_QUANTISED_REACH = 0.65  # the same where only quantised transform blocks show a codec
FORESHORTENED = 0.2
"""Lag-1 correlation along rows less that along columns, in flat windows, beyond which correlated grain belongs to a
ground plane. Chosen on tiles of simulated cameras with noise, 99 % of which lie below, and on rendered roads, three
quarters of whose wrong answers lie above."""

LARGEST_DN = 60.0  # the networks were trained on noise up to 45 DN; more is no camera's, but a pattern
WEAK_DN = 2.5  # where the interval ends below, noise is certainly weak
UNDETECTED_DN, UNDETECTED_LOW_DN = 0.5, 0.05  # an answer and lower end below these are an answer of zero
SMOOTH = 0.9  # fraction of vanished coefficients of quantised blocks above which no detail is left to flicker
VANISHED_COEFFICIENTS = 0.85  # of high-frequency DCT coefficients: a codec has removed them
GRID_STEP = 0.12  # ln of the step at block edges over that elsewhere


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
        self.white = Cellwise(cellwise_weights)
        self.correlated = Correlated(correlated_weights)
        self.released = self.white.released and self.correlated.released
        self.widest_reach, self.widest_compressed_reach = widest_reach, widest_compressed_reach
        self.widest_white_reach = widest_white_reach

    def measure_cells(
        self, stack: NDArray[np.floating], reason: NDArray[np.object_]
    ) -> tuple[Measured, NDArray[np.float32]]:
        """See `pipeline.noise.cell_mapper.CellMapper.measure_cells`; writes its own reasons to abstain."""
        count, (height, width) = len(stack), (side // CELL_PX for side in stack.shape[1:])
        sigma, low, high, white_sigma, correlation = np.zeros((5, count))
        cells = np.zeros((count, height, width), np.float32)

        def answer_white(indices: NDArray[np.intp]) -> None:
            if len(indices):
                part = stack if len(indices) == count else stack[indices]
                white, cells[indices] = self.white.measure_cells(part, reason[indices])
                sigma[indices], low[indices], high[indices] = white.sigma_dn, white.low_dn, white.high_dn
                white_sigma[indices] = white.sigma_dn

        looks_white, streaks, known = _screened(stack)
        answer_white(np.flatnonzero(looks_white))
        requested = np.flatnonzero(~(looks_white & (low > PLAIN_SIGMA_DN)))
        answer = self.correlated.predict(stack[requested], [known[index] for index in requested])
        answer = replace(answer, reach=REAL_CAMERAS * answer.reach)
        traces = codec_traces(answer.statistics, stack.shape[1] * stack.shape[2])
        answer_white(requested[~looks_white[requested] & ~decided(answer, traces.coded)])
        weight = weights(sigma[requested], high[requested], answer, traces.coded)

        reach, widest = np.log1p(high) - np.log1p(sigma), np.full(count, self.widest_white_reach)
        reach[requested] += weight * (answer.reach - reach[requested])
        widest[requested] += weight * (self._widest(traces) - widest[requested])

        processed = np.interp(answer.correlation, PROCESSED, (0.0, 1.0))
        level, apart = np.log1p(answer.sigma_dn) + COARSE_PART * processed, answer.reach
        sigma[requested] = _between(sigma[requested], np.maximum(level - np.maximum(apart - level, 0), 0), weight)
        low[requested] = _between(low[requested], np.maximum(level - apart, 0.0), weight)
        high[requested] = _between(high[requested], level + apart, weight)
        white_sigma[requested] = _between(white_sigma[requested], np.log1p(answer.white_sigma_dn), weight)
        correlation[requested] = answer.correlation
        scale = sigma[requested] / np.maximum(np.sqrt((answer.cells_dn**2).mean(axis=(1, 2))), 1e-6)
        adapted = answer.cells_dn * scale[:, None, None].astype(np.float32)
        cells[requested] = np.where(weight[:, None, None] >= 0.5, adapted, cells[requested])

        coded, flickering, hiding, grain = np.zeros((4, count), bool)
        coded[requested], flickering[requested] = traces.coded, traces.quantised & traces.detail
        hiding[requested] = (traces.quantised | traces.suspected) & traces.detail
        wide = (reach > widest) & ((high >= WEAK_DN) | flickering)
        grain[requested] = (
            (weight >= 0.5)
            & (answer.correlation > WHITE_BELOW)
            & (anisotropy(answer.statistics) > FORESHORTENED)
            & (high[requested] >= WEAK_DN)
        )
        hidden = hiding & (sigma < UNDETECTED_DN) & (low < UNDETECTED_LOW_DN)
        unsure = (wide | hidden | grain) & (reason == "")
        reason[unsure] = np.where((coded | hidden)[unsure], COMPRESSED, UNCERTAIN)
        beyond = (low > LARGEST_DN) & (reason == "")
        reason[beyond] = UNCERTAIN
        reason[streaks & ~coded & ((reason == "") | unsure | beyond)] = STREAKED
        reason[alternating(stack) & ((reason == "") | unsure | beyond)] = ALTERNATING
        return Measured(sigma, low, high, np.minimum(white_sigma, sigma), correlation), cells

    def _widest(self, traces: Traces) -> NDArray[np.float64]:
        """Reach of the second network's interval beyond which there is no answer, (N,)."""
        uncoded_or_quantised = np.where(traces.quantised, WIDEST_QUANTISED_REACH, self.widest_reach)
        return np.asarray(np.where(traces.strong, self.widest_compressed_reach, uncoded_or_quantised))


def _screened(
    stack: NDArray[np.floating],
) -> tuple[NDArray[np.bool_], NDArray[np.bool_], list[Moments | None]]:
    """Which patches (N, H, W) are white, which are streaked, and the moments of those that are not white.

    White: flat areas vary without correlation, and no codec shows at the corner.
    """
    white, streaks, known = np.zeros(len(stack), bool), np.zeros(len(stack), bool), []
    for index, patch in enumerate(stack):
        pixels = np.rint(patch * np.float32(FULL_SCALE_DN)).astype(np.uint8)
        fine = fine_windows(pixels)
        white[index] = whiteness(pixels, fine) < PLAINLY_WHITE and not at_corner(pixels)
        streaks[index] = not white[index] and streaked(fine)
        known.append(None if white[index] else moments(pixels, fine))
    return white, streaks, known


def decided(answer: Prediction, coded: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Patches that the network for correlated noise answers alone (weight 1), whatever `cellwise` estimates.

    Args:
        answer: of that network.
        coded: (N,) whether they show the traces of a codec.

    Returns:
        (N,).
    """
    sure = (answer.reach <= UNSURE_ABOVE) | (answer.correlation >= CLEARLY_CORRELATED)
    return coded | (sure & (answer.correlation >= CORRELATED_ABOVE))


def weights(
    white_dn: NDArray[np.float64], white_high_dn: NDArray[np.float64], answer: Prediction, coded: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Weight of the network for correlated noise; see the module.

    Args:
        white_dn: (N,) sigma of `cellwise`, DN.
        white_high_dn: (N,) upper end of its interval, DN.
        answer: of the other network, for the same patches.
        coded: (N,) whether they show the traces of a codec.

    Returns:
        (N,) in [0, 1].
    """
    first, second = np.log1p(white_dn), np.log1p(answer.sigma_dn)
    reach = np.maximum(np.log1p(white_high_dn) - first, MIN_REACH)
    apart = np.clip((np.abs(first - second) - answer.reach - reach) / DISAGREEMENT_WIDTH + 1, 0, 1)
    sure = np.clip((UNSURE_ABOVE - answer.reach) / (UNSURE_ABOVE - SURE_BELOW), 0, 1)
    ramp = np.clip((answer.correlation - WHITE_BELOW) / (CORRELATED_ABOVE - WHITE_BELOW), 0, 1)
    lost = (answer.reach > UNSURE_ABOVE) & (answer.correlation < CLEARLY_CORRELATED)
    return np.where(coded, 1.0, np.where(lost, 0.0, np.maximum(ramp, apart * sure)))


@dataclass(frozen=True)
class Traces:
    """Traces of a codec in N patches.

    Attributes:
        strong: (N,) steps at block edges or vanished fine detail (`compressed`).
        quantised: (N,) quantised transform blocks (`pipeline.noise.block_quantisation.present`).
        suspected: (N,) likewise, but too weak to be sure of (`pipeline.noise.block_quantisation.suspected`).
        detail: (N,) whether coefficients are left in the blocks, which may change from shot to shot.
    """

    strong: NDArray[np.bool_]
    quantised: NDArray[np.bool_]
    suspected: NDArray[np.bool_]
    detail: NDArray[np.bool_]

    @property
    def coded(self) -> NDArray[np.bool_]:
        """(N,) whether a codec shows."""
        return self.strong | self.quantised


def codec_traces(statistics: NDArray[np.float32], pixels: int) -> Traces:
    """Traces of a codec.

    Args:
        statistics: (N, COUNT), see `correlated_features.statistics`.
        pixels: of a patch.
    """
    numbers, strong = statistics[:, QUANTISED_START:], compressed(statistics)
    return Traces(strong, present(numbers, pixels), suspected(numbers, pixels) & ~strong, numbers[:, -1] <= SMOOTH)


def compressed(statistics: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Whether patches show the traces of a strong codec: steps at block edges or vanished fine detail.

    Args:
        statistics: (N, COUNT), see `correlated_features.statistics`.
    """
    grid = statistics[:, GRID_START : GRID_START + 9]
    return np.asarray((np.minimum(grid[:, 0], grid[:, 3]) > GRID_STEP) | (grid[:, 8] > VANISHED_COEFFICIENTS))


def _between(
    first_dn: NDArray[np.float64], level: NDArray[np.float64], weight: NDArray[np.float64]
) -> NDArray[np.float64]:
    """A weighted mean, DN: the first where the weight is 0, expm1 of the level where it is 1."""
    return np.where(weight > 0, np.expm1((1 - weight) * np.log1p(first_dn) + weight * level), first_dn)
