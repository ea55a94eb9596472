"""The built-in controller of the paper's camera (Prosilica GC1380H), as recovered from its published response.

With m the mean grey level in 1/64 of full scale, rounded down::

    m <= 28:   t' = t (1 + (30.4 / m - 1) / 4)       a quarter step towards 47.5 %
    29..31:    t' = t
    m >= 32:   t' = 0.75 t

Gain, gain step 1/4, target, hold band and cut are identified by the data (28 upward steps to 0.004 ms, all downward
steps 0.75); full scale 64 and rounding down are an interpretation that agrees with the maker's documented defaults
(target 50 %, tolerance 5 %, exposure before gain).
"""

from __future__ import annotations

import math

from pipeline.control.decision import Decision
from pipeline.control.observation import Observation
from pipeline.control.options import is_count
from pipeline.control.performance import Performance
from pipeline.control.policy import ControlledCamera, Policy
from pipeline.control.state import CameraState
from pipeline.control.temporal.asked_exposure import AskedExposure
from pipeline.errors import InputError


class Prosilica(Policy):
    """The integer law.

    Args:
        camera: see `Policy`.
        performance: not used.
        gain: fraction of the way taken per frame upwards.
        target: mean as a fraction of full scale.
        hold: lowest and highest integer mean without reaction.
        cut: factor downwards.
        levels: integer levels of full scale.

    Raises:
        InputError: an option out of range.
    """

    def __init__(
        self,
        camera: ControlledCamera,
        performance: Performance | None = None,
        gain: float = 0.25,
        target: float = 0.475,
        hold: tuple[int, int] = (29, 31),
        cut: float = 0.75,
        levels: int = 64,
    ) -> None:
        super().__init__(camera, performance)
        self.check("gain", gain, "a fraction in (0, 1]", lambda value: 0 < value <= 1)
        for name, value in (("target", target), ("cut", cut)):
            self.check(name, value, "a fraction in (0, 1)", lambda number: 0 < number < 1)
        is_pair = isinstance(hold, (tuple, list)) and len(hold) == 2 and all(map(is_count, (*hold, levels)))
        if not (is_pair and 1 <= hold[0] <= hold[1] < levels):
            raise InputError(
                f"policy Prosilica: hold is {hold!r} with levels {levels!r}; expected two whole numbers from 1, not "
                "falling, and more levels"
            )
        self.gain, self.target, self.cut, self.levels = gain, target, cut, levels
        self.hold = (int(hold[0]), int(hold[1]))
        self.exposure = AskedExposure(self.limits)

    def factor(self, mean_level: float) -> float:
        """Factor on the exposure for a mean level in 0..1."""
        mean = max(math.floor(mean_level * self.levels), 1)
        if mean < self.hold[0]:
            return 1.0 + self.gain * (self.target * self.levels / mean - 1.0)
        return self.cut if mean > self.hold[1] else 1.0

    def decide(self, observation: Observation, state: CameraState) -> Decision:
        """See `Policy.decide`."""
        gamma, mean = self.camera.formation.gamma, observation.mean_level
        factor = self.factor(mean)
        if factor == 1.0:
            return self.exposure.hold(
                state,
                f"mean {mean:.2f} is within the hold band",
                lambda ratio: self.factor(mean * ratio ** (1.0 / gamma)) == 1.0,
            )
        reason = f"mean {mean:.2f}: total exposure times {factor:.3f}"
        return self.exposure.decision(factor, state, reason, (self.target / max(mean, 1.0 / self.levels)) ** gamma)
