"""Gradient-based exposure control by gamma emulation (Shim et al. 2014; 2018, arXiv 1708.07338).

The frame is seen through seven gamma curves; a polynomial of fifth order through their gradient information gives the
best one, gamma^. ``E' = (1 + a Kp R) E`` with ``R = d tan((1 - gamma^) atan(1 / d))``, a = 1 upwards and 1/2 downwards,
Kp = 0.2, d = 0.5. Motion is not considered: a longer exposure loses gradient only once blur shows in that very frame.
"""

from __future__ import annotations

import math

import numpy as np

from pipeline.control.decision import Decision
from pipeline.control.image.gradient import information, sobel_magnitude
from pipeline.control.observation import Observation
from pipeline.control.options import is_number
from pipeline.control.performance import Performance
from pipeline.control.policy import ControlledCamera, Policy
from pipeline.control.state import CameraState
from pipeline.control.temporal.asked_exposure import AskedExposure
from pipeline.errors import InputError

ANCHORS = (0.1, 0.5, 0.8, 1.0, 1.2, 1.5, 1.9)
WIDTH_PX = 320
_FINE = 181


class Shim(Policy):
    """Gamma emulation.

    Args:
        camera: see `Policy`.
        performance: not used.
        gain: Kp, above 0, and so small that no factor on the exposure falls to 0.
        nonlinearity: d, above 0.
        anchors: gammas tried, at least six, rising, above 0 and at most 2, beyond which the law turns.

    Raises:
        InputError: an option out of range.
    """

    def __init__(
        self,
        camera: ControlledCamera,
        performance: Performance | None = None,
        gain: float = 0.2,
        nonlinearity: float = 0.5,
        anchors: tuple[float, ...] = ANCHORS,
    ) -> None:
        super().__init__(camera, performance)
        for name, value in (("gain", gain), ("nonlinearity", nonlinearity)):
            self.check(name, value, "a number above 0", lambda number: 0 < number < math.inf)
        gammas = anchors if isinstance(anchors, (tuple, list)) else ()
        are_known = len(gammas) >= 6 and all(is_number(gamma) and 0 < gamma <= 2 for gamma in gammas)
        if not are_known or sorted(set(gammas)) != list(gammas):
            raise InputError(
                f"policy Shim: anchors are {anchors!r}; expected at least six rising gammas above 0 and at most 2"
            )
        self.gain, self.nonlinearity, self.anchors = gain, nonlinearity, tuple(anchors)
        least = self.factor(self.anchors[-1])
        self.check("gain", gain, f"less: for gamma {anchors[-1]:g} the factor is {least:.3g}", lambda _: least > 0)
        self.exposure = AskedExposure(self.limits)

    def best_gamma(self, observation: Observation) -> float:
        """Gamma with most gradient information; 1 where no curve shows any."""
        import cv2

        frame = observation.image
        height = max(8, round(frame.shape[0] * WIDTH_PX / frame.shape[1]))
        small = cv2.resize(frame, (WIDTH_PX, height), interpolation=cv2.INTER_AREA)
        sums = [float(information(sobel_magnitude(small ** np.float32(gamma))).sum()) for gamma in self.anchors]
        if max(sums) <= 0.0:
            return 1.0
        curve = np.polynomial.Polynomial.fit(self.anchors, sums, 5)
        fine = np.linspace(self.anchors[0], self.anchors[-1], _FINE)
        return float(fine[int(np.argmax(curve(fine)))])

    def factor(self, gamma: float) -> float:
        """Factor on total exposure for the best gamma."""
        strength = self.nonlinearity * math.tan((1.0 - gamma) * math.atan(1.0 / self.nonlinearity))
        return 1.0 + (1.0 if gamma < 1.0 else 0.5) * self.gain * strength

    def decide(self, observation: Observation, state: CameraState) -> Decision:
        """See `Policy.decide`; a frame without gradient (black, white, flat) is metered by its mean."""
        gamma = self.best_gamma(observation)
        if gamma == 1.0 and not 0.05 < observation.mean_level < 0.95:
            gamma = self.anchors[0] if observation.mean_level < 0.5 else self.anchors[-1]
        factor = self.factor(gamma)
        return self.exposure.decision(factor, state, f"best gamma {gamma:.2f}: total exposure times {factor:.3f}")
