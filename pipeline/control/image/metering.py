"""Brightness metering: the factor on total exposure that brings a frame's mean grey level to its target.

Encoded levels follow ``mean ~ (t g) ** (1 / gamma)`` while nothing clips, so the factor is
``(target / mean) ** gamma``. A clipped frame hides how bright it is: its factor is only a bound, and total exposure is
halved once more where most pixels are white.
"""

from __future__ import annotations

from dataclasses import dataclass

from pipeline.control.observation import Observation
from pipeline.control.options import check_number

_DARKEST_MEAN = 0.004  # one grey level of 8 bits
_MOSTLY_SATURATED = 0.5


@dataclass(frozen=True)
class Metering:
    """How brightness is kept.

    Attributes:
        target: mean encoded grey level, 0..1; built-in controllers have 0.5.
        tolerance: no reaction within this fraction of the target.
        largest_factor: of one step, up or down.
        damping: exponent of the factor, (0, 1]; 1 corrects at once.
    """

    target: float = 0.5
    tolerance: float = 0.1
    largest_factor: float = 8.0
    damping: float = 1.0

    def __post_init__(self) -> None:
        for name, expected, accepts in (
            ("target", "a fraction in (0, 1)", lambda value: 0 < value < 1),
            ("tolerance", "a fraction in [0, 1)", lambda value: 0 <= value < 1),
            ("largest_factor", "a number above 1", lambda value: value > 1),
            ("damping", "a fraction in (0, 1]", lambda value: 0 < value <= 1),
        ):
            check_number("metering", name, getattr(self, name), expected, accepts)

    def accepts(self, mean_level: float) -> bool:
        """Whether a mean level is within the tolerance of the target."""
        return abs(mean_level / self.target - 1.0) <= self.tolerance

    def factor(self, observation: Observation, gamma: float) -> float:
        """Factor on total exposure; 1 within the tolerance, unless most of the frame is white.

        Args:
            observation: the frame.
            gamma: of the camera's tone curve.
        """
        mean = max(observation.mean_level, _DARKEST_MEAN)
        hidden = _hidden(observation)
        if self.accepts(mean) and hidden == 1.0:  # half white, half black have the mean of a picture
            return 1.0
        factor = float((self.target / mean) ** (gamma * self.damping)) / hidden
        return min(max(factor, 1.0 / self.largest_factor), self.largest_factor)

    def to_target(self, observation: Observation, gamma: float) -> float:
        """Factor on total exposure that brings a frame's mean level to the target at once, without limit or damping.

        Args:
            observation: the frame.
            gamma: of the camera's tone curve.
        """
        mean = max(observation.mean_level, _DARKEST_MEAN)
        return float((self.target / mean) ** gamma) / _hidden(observation)


def _hidden(observation: Observation) -> float:
    """How many times brighter than its mean level says a frame is taken to be."""
    return 2.0 if observation.saturated_fraction > _MOSTLY_SATURATED else 1.0
