"""The paper's rule (Wischow et al. 2023, Sec. VI): change the exposure until the motion blur is the target.

``alpha = d / d_target``, ``t' = t / alpha``, ``ISO' = alpha ISO``: the gain keeps the brightness. The target is the
longest motion the detector bears, read off its curves: 12 px (MTF 0.7) in the paper's Example 1, 7 px (MTF 0.9) in
Example 2. Average precision is reported, not maximised.
"""

from __future__ import annotations

import math

import numpy as np

from pipeline.control.iopc import Choice, Frame, IopcPolicy
from pipeline.control.performance import Performance
from pipeline.control.policy import ControlledCamera

LARGEST_ALPHA = 16.0


def alpha(motion_px: float, target_px: float) -> float:
    """``d / d_target``, at most a factor of 16 either way."""
    return float(np.clip(motion_px / target_px, 1.0 / LARGEST_ALPHA, LARGEST_ALPHA))


class IopcTarget(IopcPolicy):
    """Motion blur to target.

    Args:
        camera: see `Policy`.
        performance: surface, for the reference MTF and the expected average precision.
        target_px: motion blur wanted, above 0.
        target: see `IopcPolicy`.
        tolerance: see `IopcPolicy`.
        slack: no reaction while alpha is within this fraction of 1; at least 0, below 1.

    Raises:
        InputError: an option out of range.
    """

    def __init__(
        self,
        camera: ControlledCamera,
        performance: Performance | None = None,
        target_px: float = 7.0,
        target: float | None = 0.5,
        tolerance: float = 0.1,
        slack: float = 0.15,
    ) -> None:
        super().__init__(camera, performance, target, tolerance)
        self.check("target_px", target_px, "a length above 0 px", lambda value: 0 < value < math.inf)
        self.check("slack", slack, "a fraction in [0, 1)", lambda value: 0 <= value < 1)
        self.target_px, self.slack = target_px, slack

    def choose(self, frame: Frame) -> Choice:
        """See `IopcPolicy.choose`."""
        motion = self.speed_px_s * frame.state.exposure_s
        ratio = alpha(motion, self.target_px)
        if abs(ratio - 1.0) <= self.slack:
            ratio = 1.0
        if ratio == 1.0 and frame.keeps_brightness:
            new = frame.written
        else:
            new = self.limits.at_time(frame.total_s, frame.state.exposure_s / ratio)
        return Choice(new, f"motion {motion:.1f} px, target {self.target_px:g} px: alpha {ratio:.3f}")
