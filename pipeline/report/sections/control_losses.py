"""Table of the closed loop: where a rival is not beaten, the frame that costs most, and the settings of both there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pipeline.control.largest_loss import LargestLoss, largest_loss
from pipeline.control.scenario_result import BRIGHTNESS_ONLY, OURS, ScenarioResult
from pipeline.control.state import CameraState
from pipeline.report.control_results import policy_word, scenario_word
from pipeline.report.descriptions import Descriptions
from pipeline.report.tables import Estimate, Table

CONTROL = Descriptions("control")


def losses(results: Sequence[ScenarioResult]) -> Table:
    """Rivals whose paired difference does not lie above 0, in scenarios with motion in poor light."""
    rows: list[dict[str, Any]] = []
    for one in results:
        if not one.is_demanding:
            continue
        for other in BRIGHTNESS_ONLY:
            known = {policy: difference for policy in OURS if (difference := one.difference(policy, other)) is not None}
            if not known or any(difference[1] > 0 for difference in known.values()):
                continue
            policy = max(known, key=lambda name: known[name][0])
            oracle = one.difference("oracle", other)
            rows.append(
                {
                    "scenario": scenario_word(one.name),
                    "policy": policy_word(policy),
                    "other": policy_word(other),
                    "difference": Estimate(*known[policy]),
                    "oracle": None if oracle is None else Estimate(*oracle),
                    "where": _words(largest_loss(one.steps, policy, other)),
                }
            )
    return CONTROL.table("control_losses", rows)


def _words(loss: LargestLoss | None) -> str:
    if loss is None:
        return "behind in no frame"
    when = f"frame {loss.step}"
    if loss.change:
        when += f", {loss.frames_after} after {loss.change}" if loss.frames_after else f", at the {loss.change}"
    settings = f"{_settings(loss.state)} against {_settings(loss.other_state)}"
    return f"{loss.loss_percent:.1f} points in {when}: {settings}"


def _settings(state: CameraState) -> str:
    return f"{state.exposure_ms:.1f} ms, ISO {state.iso:.0f}"
