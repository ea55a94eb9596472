"""A policy's answer: settings for the next frame, what kind of action that is, and why."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from pipeline.control.state import CameraState


class Action(StrEnum):
    """Kinds of decisions; all are logged.

    ``MOVE`` new settings, ``HOLD`` none needed, ``PROBE`` settings tried during a search, ``ABSTAINED`` the estimator
    abstained: brightness only, or hold, ``REFUSED`` the surface has no answer there: a step to the measured region.
    """

    MOVE = "move"
    HOLD = "hold"
    PROBE = "probe"
    ABSTAINED = "abstained"
    REFUSED = "refused"


@dataclass(frozen=True)
class Decision:
    """Settings for the next frame.

    Attributes:
        state: the settings, inside the camera's limits and on its steps, or those of the frame kept.
        action: what kind of decision it is.
        reason: one sentence.
        ap_percent: average precision expected with these settings; NaN where the policy has no surface, the frame no
            estimate, or the surface no answer.
    """

    state: CameraState
    action: Action
    reason: str
    ap_percent: float = float("nan")
