"""One answer for a frame: how blurred and how noisy it is, where, how sure that is, and where it abstains.

>>> from pipeline.condition import ConditionMonitor
>>> state = ConditionMonitor().frame(image)     # (H, W) float in [0, 1]
>>> state.mtf.value, state.sigma_dn.value, state.noise.map_dn
"""

from __future__ import annotations

from pipeline.condition.estimate import BlurState, Condition, ConditionMonitor, NoiseState, noise_of_frame
from pipeline.condition.summary import Summary

__all__ = ["BlurState", "Condition", "ConditionMonitor", "NoiseState", "Summary", "noise_of_frame"]
