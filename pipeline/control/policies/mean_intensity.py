"""Generic automatic exposure: the mean grey level is driven to a target, exposure time first, then gain.

``E' = E (target / mean) ** (gamma damping)`` outside of a dead band, the multiplicative law of open camera drivers with
the defaults of built-in controllers: target 50 %, tolerance 5 %.
"""

from __future__ import annotations

from pipeline.control.decision import Decision
from pipeline.control.image.metering import Metering
from pipeline.control.observation import Observation
from pipeline.control.performance import Performance
from pipeline.control.policy import ControlledCamera, Policy
from pipeline.control.state import CameraState
from pipeline.control.temporal.asked_exposure import AskedExposure


class MeanIntensity(Policy):
    """Mean grey level to target.

    Args:
        camera: see `Policy`.
        performance: not used.
        target: mean encoded grey level.
        tolerance: dead band, fraction of the target.
        damping: exponent of a step, (0, 1]; 1 corrects at once, which oscillates with a delay.
        exposure_max_ms: hard cap of the exposure time below the camera's, at least its shortest exposure time; kept
            whatever the brightness.

    Raises:
        InputError: an option out of range.
    """

    def __init__(
        self,
        camera: ControlledCamera,
        performance: Performance | None = None,
        target: float = 0.5,
        tolerance: float = 0.05,
        damping: float = 0.5,
        exposure_max_ms: float | None = None,
    ) -> None:
        super().__init__(camera, performance)
        self.metering = Metering(target, tolerance, largest_factor=8.0, damping=damping)
        self.exposure_max_s = None
        if exposure_max_ms is not None:
            self.check("exposure_max_ms", exposure_max_ms, "a number of ms, or None", lambda _: True)
            self.exposure_max_s = self.limits.longest_up_to(exposure_max_ms / 1e3)
        self.exposure = AskedExposure(self.limits, self.exposure_max_s)

    def decide(self, observation: Observation, state: CameraState) -> Decision:
        """See `Policy.decide`."""
        gamma, mean = self.camera.formation.gamma, observation.mean_level
        factor = self.metering.factor(observation, gamma)
        too_long = self.exposure_max_s is not None and state.exposure_s > self.exposure_max_s * (1 + 1e-9)
        if factor == 1.0 and not too_long:
            return self.exposure.hold(
                state,
                f"mean {mean:.2f} is within tolerance",
                lambda ratio: self.metering.accepts(mean * ratio ** (1.0 / gamma)),
            )
        reason = f"mean {mean:.2f}: total exposure times {factor:.2f}"
        return self.exposure.decision(factor, state, reason, self.metering.to_target(observation, gamma))
