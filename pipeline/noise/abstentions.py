"""When the default noise estimator (`pipeline.noise.adaptive`) gives no answer for a patch, and why.

    too wide         the interval is wider than is of use (`Evidence.reaches_too_far`) and does not end below `WEAK_DN`,
                     where noise is certainly weak, or detail that a codec quantises anew from shot to shot may flicker
    removed          the answer is zero, but a codec that left detail shows, be it by traces too weak for anything
                     else: H.264 removes weak noise, and its own error changes from shot to shot
    foreshortened    grain that looks like smoothed noise is finer along columns than along rows (`FORESHORTENED`):
                     noise of a camera has no direction but for row noise; the grain of a road or floor that is seen at
                     a slant is compressed vertically, whether the frame was coded or not
    at edges only    more than `FILTERED_DN` of mostly white noise is estimated while flat areas are correlated
                     (`FILTERED`), as behind a bilateral filter, which leaves noise at edges; smaller answers there are
                     too low and given
    beyond           the interval begins above `LARGEST_DN`: neither network has seen as much
    streaked         neighbours are equal as behind a median filter (`pipeline.noise.traces.streaks`); no codec shows
    alternating      the patch alternates from pixel to pixel (`pipeline.noise.traces.alternation`), as a mosaic does

The reason given is ``"compressed"`` where a codec shows or removed the noise, else ``"uncertain"``; the last three have
names of their own, of which the last two come before those.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.noise.base import ALTERNATING, BEYOND, COMPRESSED, STREAKED, UNCERTAIN
from pipeline.noise.traces.codec import Traces

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

WEAK_DN = 2.5  # where the interval ends below, noise is certainly weak
UNDETECTED_DN, UNDETECTED_LOW_DN = 0.5, 0.05  # an answer and lower end below these are an answer of zero
LEAST_GRAIN_CORRELATION = 0.24  # of grain that may belong to a ground plane
FORESHORTENED = 0.2
"""Lag-1 correlation along rows less that along columns, in flat windows, beyond which correlated grain belongs to a
ground plane. Chosen on tiles of simulated cameras with noise, 99 % of which lie below, and on rendered roads, three
quarters of whose wrong answers lie above."""

FILTERED, FILTERED_DN = 0.2, 2.0
"""Lag-1 correlation of flat windows, and answer with w < 1/2, beyond which there is none: of noise of 10 DN a bilateral
filter leaves 4 to 5 DN, of which 1 to 2.5 are estimated. With smaller answers frames with 2 DN of white noise over
texture would be lost."""

LARGEST_DN = 60.0  # the networks were trained on noise up to 45 DN; more is no camera's, but a pattern


@dataclass(frozen=True)
class Evidence:
    """What is known of N patches when it is decided whether to answer.

    Attributes:
        sigma_dn, low_dn, high_dn: (N,) the joint answer of both networks and its interval, DN.
        weight: (N,) of the network for correlated noise; 0 where it was not asked.
        reaches_too_far: (N,) whether the interval is wider than is of use.
        correlation: (N,) of adjacent pixels by the network for correlated noise; 0 where it was not asked.
        anisotropy: (N,) `pipeline.noise.networks.correlated_features.anisotropy`; 0 where that network was not asked.
        traces: of a codec; none where that network was not asked.
        flat_correlation: (N,) of adjacent pixels in flat windows.
        streaks, alternates: (N,) see the module.
    """

    sigma_dn: Floats
    low_dn: Floats
    high_dn: Floats
    weight: Floats
    reaches_too_far: Flags
    correlation: Floats
    anisotropy: Floats
    traces: Traces
    flat_correlation: Floats
    streaks: Flags
    alternates: Flags

    @property
    def too_wide(self) -> Flags:
        """(N,) see the module, as for the others."""
        flickers = self.traces.quantised & self.traces.detail
        return self.reaches_too_far & ((self.high_dn >= WEAK_DN) | flickers)

    @property
    def removed(self) -> Flags:
        """(N,)."""
        may_hide = (self.traces.quantised | self.traces.suspected) & self.traces.detail
        return may_hide & (self.sigma_dn < UNDETECTED_DN) & (self.low_dn < UNDETECTED_LOW_DN)

    @property
    def foreshortened(self) -> Flags:
        """(N,)."""
        is_grain = (self.weight >= 0.5) & (self.correlation > LEAST_GRAIN_CORRELATION)
        return is_grain & (self.anisotropy > FORESHORTENED) & (self.high_dn >= WEAK_DN)

    @property
    def at_edges_only(self) -> Flags:
        """(N,)."""
        return (self.sigma_dn > FILTERED_DN) & (self.flat_correlation > FILTERED) & (self.weight < 0.5)

    @property
    def beyond(self) -> Flags:
        """(N,)."""
        return self.low_dn > LARGEST_DN


def reasons(evidence: Evidence, known: NDArray[np.object_]) -> NDArray[np.object_]:
    """Why patches are abstained from.

    Args:
        evidence: of N patches.
        known: (N,) reasons that stand already, as ``"flat"``; empty where there is none.

    Returns:
        (N,) with the reasons of the module beside those; empty where there is an answer.
    """
    open_still, coded, removed = known == "", evidence.traces.coded, evidence.removed
    unsure = open_still & (evidence.too_wide | removed | evidence.foreshortened | evidence.at_edges_only)
    beyond = open_still & ~unsure & evidence.beyond
    reason = known.copy()
    reason[unsure] = np.where((coded | removed)[unsure], COMPRESSED, UNCERTAIN)
    reason[beyond] = BEYOND
    reason[open_still & evidence.streaks & ~coded] = STREAKED
    reason[open_still & evidence.alternates] = ALTERNATING
    return reason
