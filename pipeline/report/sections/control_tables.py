"""Tables of the closed loop: policies by scenario, measures, paired differences, and where a rival is not beaten."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pipeline.control.largest_loss import LargestLoss, largest_loss
from pipeline.control.scenario_result import BRIGHTNESS_ONLY, OURS, ScenarioResult
from pipeline.control.state import CameraState
from pipeline.report.control_results import POLICIES, policy_word, scenario_word
from pipeline.report.descriptions import Descriptions
from pipeline.report.display_names import in_order, listing
from pipeline.report.tables import Estimate, Table, estimate, format_number, ordered, records

CONTROL = Descriptions("control")
AP = estimate("ap_percent", "low_percent", "high_percent")


def _policies(names: Sequence[str]) -> str:
    return listing(map(policy_word, names))


def _head(one: ScenarioResult) -> dict[str, str]:
    return {"scenario": scenario_word(one.name), "demanding": "yes" if one.is_demanding else "no"}


def overview(results: Sequence[ScenarioResult]) -> Table:
    """AP of every policy in every scenario."""
    policies = in_order({name for one in results for name in one.summary["policy"]}, POLICIES)
    rows = [{**_head(one), **{str(row["policy"]): AP(row) for row in records(one.summary)}} for one in results]
    return CONTROL.table("control_ap", rows, across={name: policy_word(name) for name in policies})


def measures(results: Sequence[ScenarioResult], decision_ms: Mapping[str, float]) -> Table:
    """Every measure of every policy in every scenario."""
    kinds = {"iopc_lamp": "iopc_continuous"}
    rows = [
        {**row, **_head(one), "decision_ms": decision_ms.get(kinds.get(row["policy"], row["policy"]))}
        for one in results
        for row in records(ordered(one.summary, policy=POLICIES))
    ]
    cells = {
        "policy": lambda row: policy_word(str(row["policy"])),
        "settling_frames": lambda row: _settling(row["settling_frames"]),
    }
    return CONTROL.table("control_measures", rows, cells=cells)


def _settling(frames: float) -> str:
    return format_number(frames, 0) if math.isfinite(frames) else "not settled"


def _cause(one: ScenarioResult) -> str:
    """A scenario that is not won, and the policies whose difference does not exclude 0, beside the oracle's."""
    best = max(OURS, key=lambda policy: len(one.exceeded(policy)))
    level, oracle = ([other for other in BRIGHTNESS_ONLY if other not in one.exceeded(p)] for p in (best, "oracle"))
    also = [other for other in level if other in oracle]
    text = f"{scenario_word(one.name).lower()} (not above {_policies(level)}"
    if also:
        text += ", nor is the oracle" + ("" if also == level else f" above {_policies(also)}")
    return f"{text})"


def pairs(results: Sequence[ScenarioResult]) -> Table:
    """Paired differences of ours to the policies that know no motion."""
    rows: list[dict[str, Any]] = []
    others = (*BRIGHTNESS_ONLY, "prosilica")
    for one in results:
        for policy in OURS:
            differences = {name: one.difference(policy, name) for name in others}
            cells = {name: Estimate(*difference) for name, difference in differences.items() if difference is not None}
            if cells:
                rows.append({**_head(one), "policy": policy_word(policy), **cells, "better": _better(one, policy)})
    return CONTROL.table("control_pairs", rows, across={name: f"less {policy_word(name)}" for name in others})


def _better(one: ScenarioResult, policy: str) -> str:
    """Which policies the interval lies above 0 for, and which it lies below 0 for."""
    if one.beats_all(policy):
        return "than all four"
    above, below = one.exceeded(policy), one.exceeding(policy)
    text = f"than {_policies(above)}" if above else "than none"
    return text + (f"; worse than {_policies(below)}" if below else "")


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


def findings(results: Sequence[ScenarioResult]) -> list[str]:
    """Sentences of the verdict on the closed loop, from the tables' numbers."""
    demanding = [one for one in results if one.is_demanding]
    sentences = []
    if demanding:
        missed = [one for one in demanding if not any(map(one.beats_all, OURS))]
        won = len(demanding) - len(missed)
        text = CONTROL.text("won", won=won, demanding=len(demanding))
        sentences.append(text + (f" Not in: {listing(map(_cause, missed))}." if missed else ""))
    for policy in OURS:
        regrets = [regret for one in results if (regret := one.measure(policy, "regret_percent")) is not None]
        if regrets:
            text = f"{policy_word(policy)}: median regret to the oracle {np.median(regrets):.1f} AP points"
            losses = [one.largest_loss_percent(policy) for one in results if one.stands]
            known = [loss for loss in losses if loss is not None]
            if known:
                text += f"; where nothing moves, at most {max(*known, 0.0):.1f} points below any of them"
            sentences.append(f"{text}.")
    settled = {one.name: one.measure("iopc_continuous", "settling_frames") for one in results if one.has_light_step}
    if settled:
        words = [
            f"{scenario_word(n).lower()} {_settling(frames)}" for n, frames in settled.items() if frames is not None
        ]
        sentences.append(f"Settling of IOPC continuous in drives with a step of light, frames: {listing(words)}.")
    return sentences
