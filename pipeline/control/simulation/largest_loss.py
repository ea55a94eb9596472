"""The frame of a drive in which a policy loses most average precision against another, and what went before it.

Policies see the same frames at the same settings, so that the settings of both in that frame, and the change of light
or speed before it, are the cause of the difference.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.control.decision import Action
from pipeline.control.state import CameraState

if TYPE_CHECKING:
    import pandas as pd

LIGHT_FACTOR, SPEED_FACTOR = 2.0, 1.5
"""Changes from one frame to the next that are named."""

LOOK_BACK_FRAMES = 3


@dataclass(frozen=True)
class LargestLoss:
    """Where a policy loses most.

    Attributes:
        step: of the drive, from 0.
        loss_percent: points in that frame, mean over the folds, above 0.
        state, other_state: settings of both policies there, in the fold with the larger loss.
        change: what happened last, at most three frames before; empty if nothing did.
        frames_after: how many frames before that was.
    """

    step: int
    loss_percent: float
    state: CameraState
    other_state: CameraState
    change: str
    frames_after: int


def largest_loss(steps: pd.DataFrame, policy: str, other: str) -> LargestLoss | None:
    """The frame in which a policy loses most against another; None where it loses in none.

    Args:
        steps: `pipeline.control.simulation.tables.STEPS` of one scenario.
        policy: name of the policy.
        other: name of the policy it is compared with.
    """
    ours, theirs = ({(row["fold"], row["step"]): row for row in _rows(steps, name)} for name in (policy, other))
    losses = {
        key: theirs[key]["ap_percent"] - row["ap_percent"]
        for key, row in ours.items()
        if key in theirs and np.isfinite(theirs[key]["ap_percent"] - row["ap_percent"])
    }
    by_step: dict[int, list[float]] = {}
    for (_, step), loss in losses.items():
        by_step.setdefault(step, []).append(loss)
    means = {step: float(np.mean(values)) for step, values in by_step.items()}
    if not means or max(means.values()) <= 0:
        return None
    worst = max(means, key=lambda step: means[step])
    fold, _ = max((key for key in losses if key[1] == worst), key=lambda key: losses[key])
    state, other_state = (
        CameraState.of(float(table[fold, worst]["exposure_ms"]), float(table[fold, worst]["iso"]))
        for table in (ours, theirs)
    )
    change, frames = _last_change({step: row for (part, step), row in ours.items() if part == fold}, int(worst))
    return LargestLoss(int(worst), means[worst], state, other_state, change, frames)


def _rows(steps: pd.DataFrame, policy: str) -> list[dict[str, Any]]:
    return [
        {str(name): value for name, value in row.items()} for row in steps.to_dict("records") if row["policy"] == policy
    ]


def _last_change(drive: Mapping[int, Mapping[str, Any]], step: int) -> tuple[str, int]:
    """The last change of light or speed, or silence of the estimator, and how many frames before a step it was."""
    for before in range(min(LOOK_BACK_FRAMES, step) + 1):
        at = step - before
        if at == 0:
            return "start", before
        now, last = drive[at], drive[at - 1]
        for column, factor in (("light", LIGHT_FACTOR), ("speed_px_s", SPEED_FACTOR)):
            small, large = sorted((float(now[column]), float(last[column])))
            if large > factor * small:
                word = "light" if column == "light" else "speed"
                return f"{'fall' if now[column] < last[column] else 'rise'} of {word}", before
        if last["action"] == Action.ABSTAINED.value:
            return "abstention", before
    return "", 0
