"""Replay of the published response of the built-in controller from the scene brightness it implies.

The published curve (51 samples, 100 ms apart, from 1 ms) takes only ratios of an integer law, so that one brightness
per frame can be read off it: s = m / t in 1/64 of full scale per millisecond. Replaying it through the policy
`prosilica` tests the law's consistency, not its prediction; the out-of-sample evidence is that integers fit at all.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pipeline.control.observation import Observation
from pipeline.control.policies.prosilica import Prosilica
from pipeline.control.policy import ControlledCamera
from pipeline.control.state import CameraState, Limits

BRIGHTNESS_LEVELS_PER_MS = (
    4.12, 4.27, 4.05, 3.65, 3.57, 3.16, 2.11, 1.68, 1.69, 1.84, 1.94, 2.04, 2.25, 2.32, 2.46, 2.53, 2.53, 2.53, 2.41,
    1.78, 1.68, 1.73, 1.93, 1.71, 1.85, 1.70, 1.71, 1.76, 1.76, 1.76, 1.76, 1.76, 1.76, 1.68, 1.90, 1.80, 1.67, 1.74,
    1.80, 1.76, 1.72, 1.77, 1.77, 1.77, 1.77, 1.69, 1.91, 2.36, 1.80, 1.87,
)  # fmt: skip
"""Scene brightness per published sample, 1/64 of full scale per millisecond."""

PERIOD_MS, START_MS = 100.0, 1.0
_LONGEST_S = 0.5  # documented default of the camera


def replay(brightness: Sequence[float]) -> NDArray[np.float64]:
    """Exposure times of the built-in controller.

    Args:
        brightness: N scene brightnesses, 1/64 of full scale per ms.

    Returns:
        (N + 1,) exposure times, ms, from `START_MS`.
    """
    policy = Prosilica(ControlledCamera(Limits(exposure_min_s=10e-6, exposure_max_s=_LONGEST_S)))
    state, times = CameraState.of(START_MS, 100.0), [START_MS]
    blank = np.zeros((1, 1), np.float32)
    for level in brightness:
        mean = min(level * state.exposure_ms / policy.levels, 1.0)
        state = policy.decide(Observation(blank, mean, 0.0), state).state
        times.append(state.exposure_ms)
    return np.array(times)
