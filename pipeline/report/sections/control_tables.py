"""Tables of the closed loop: scenarios by policies, every measure, and paired differences."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from pipeline.report.control_results import (
    BRIGHTNESS_ONLY,
    OURS,
    POLICIES,
    ScenarioResult,
    policy_word,
    scenario_word,
)
from pipeline.report.descriptions import Descriptions
from pipeline.report.display_names import in_order, listing
from pipeline.report.tables import Estimate, Table, estimate, format_number, ordered, records

CONTROL = Descriptions("control")
AP = estimate("ap_percent", "low_percent", "high_percent")


def overview(results: Sequence[ScenarioResult]) -> Table:
    """AP of every policy in every scenario."""
    policies = in_order({name for one in results for name in one.summary["policy"]}, POLICIES)
    rows = []
    for one in results:
        cells = {str(row["policy"]): AP(row) for row in records(one.summary)}
        rows.append({"scenario": scenario_word(one.name), "demanding": "yes" if one.is_demanding else "no", **cells})
    return CONTROL.table("control_ap", rows, across={name: policy_word(name) for name in policies})


def measures(results: Sequence[ScenarioResult], decision_ms: Mapping[str, float]) -> Table:
    """Every measure of every policy in every scenario."""
    rows = [
        {**row, "scenario": scenario_word(one.name), "decision_ms": decision_ms.get(_kind(str(row["policy"])))}
        for one in results
        for row in records(ordered(one.summary, policy=POLICIES))
    ]
    cells = {
        "policy": lambda row: policy_word(str(row["policy"])),
        "settling_frames": lambda row: _settling(row["settling_frames"]),
    }
    return CONTROL.table("control_measures", rows, cells=cells)


def _kind(policy: str) -> str:
    return "iopc_continuous" if policy == "iopc_lamp" else policy


def _settling(frames: float) -> str:
    return format_number(frames, 0) if math.isfinite(frames) else "not settled"


def beats_all(one: ScenarioResult, policy: str) -> bool:
    """Whether the interval of a policy's difference to each policy that knows no motion lies above 0."""
    return all(_exceeds(one, policy, other) for other in BRIGHTNESS_ONLY)


def _cause(one: ScenarioResult) -> str:
    """A scenario that is not won, and the policies whose difference does not exclude 0, beside the oracle's."""
    best = max(OURS, key=lambda policy: sum(_exceeds(one, policy, other) for other in BRIGHTNESS_ONLY))
    level = [other for other in BRIGHTNESS_ONLY if not _exceeds(one, best, other)]
    also = [other for other in level if not _exceeds(one, "oracle", other)]
    text = f"{scenario_word(one.name).lower()} (not above {listing(map(policy_word, level))}"
    if also:
        text += ", nor is the oracle" + ("" if also == level else f" above {listing(map(policy_word, also))}")
    return f"{text})"


def _exceeds(one: ScenarioResult, policy: str, other: str) -> bool:
    """Whether the interval of the difference of two policies lies above 0."""
    difference = one.difference(policy, other)
    return difference is not None and difference[1] > 0


def pairs(results: Sequence[ScenarioResult]) -> Table:
    """Paired differences of ours to the policies that know no motion."""
    rows: list[dict[str, Any]] = []
    others = (*BRIGHTNESS_ONLY, "prosilica")
    for one in results:
        for policy in OURS:
            differences = {name: one.difference(policy, name) for name in others}
            cells = {name: Estimate(*difference) for name, difference in differences.items() if difference is not None}
            if cells:
                head = {"scenario": scenario_word(one.name), "demanding": "yes" if one.is_demanding else "no"}
                rows.append({**head, "policy": policy_word(policy), **cells, "better": _better(one, policy)})
    return CONTROL.table("control_pairs", rows, across={name: f"less {policy_word(name)}" for name in others})


def _better(one: ScenarioResult, policy: str) -> str:
    """Which policies the interval lies above 0 for, and which it lies below 0 for."""
    known = {other: difference for other in BRIGHTNESS_ONLY if (difference := one.difference(policy, other))}
    above = [policy_word(name) for name, difference in known.items() if difference[1] > 0]
    below = [policy_word(name) for name, difference in known.items() if difference[2] < 0]
    if len(above) == len(BRIGHTNESS_ONLY):
        return "than all four"
    text = f"than {listing(above)}" if above else "than none"
    return text + (f"; worse than {listing(below)}" if below else "")


def findings(results: Sequence[ScenarioResult]) -> list[str]:
    """Sentences of the verdict on the closed loop, from the tables' numbers."""
    demanding = [one for one in results if one.is_demanding]
    sentences = []
    if demanding:
        won = [one for one in demanding if any(beats_all(one, policy) for policy in OURS)]
        missed = [one for one in demanding if one not in won]
        text = (
            f"Closed loop: in {len(won)} of {len(demanding)} scenarios with motion in poor light a policy that "
            "estimates noise and blur has a higher AP than mean intensity, fixed settings, Shim and Shin 2019 (95 % "
            "interval of each paired difference above 0)."
        )
        if missed:
            text += f" Not in: {listing(_cause(one) for one in missed)}."
        sentences.append(text)
    for policy in OURS:
        regrets = [
            float(one.summary.loc[one.summary["policy"] == policy, "regret_percent"].iloc[0])
            for one in results
            if (one.summary["policy"] == policy).any()
        ]
        if regrets:
            text = f"{policy_word(policy)}: median regret to the oracle {np.median(regrets):.1f} AP points"
            losses = [
                -difference[0]
                for one in results
                if one.stands
                for other in BRIGHTNESS_ONLY
                if (difference := one.difference(policy, other)) is not None
            ]
            if losses:
                text += f"; where nothing moves, at most {max(max(losses), 0.0):.1f} points below any of them"
            sentences.append(f"{text}.")
    stepped = [one for one in results if one.has_light_step]
    if stepped:
        words = [
            f"{scenario_word(one.name).lower()} {_settling(frames)}"
            for one in stepped
            for frames in one.summary.loc[one.summary["policy"] == "iopc_continuous", "settling_frames"]
        ]
        sentences.append(f"Settling of IOPC continuous in drives with a step of light, frames: {listing(words)}.")
    return sentences
