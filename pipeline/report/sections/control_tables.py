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
from pipeline.report.display_names import in_order, listing
from pipeline.report.tables import Cell, Column, Estimate, Table, estimate, format_number, ordered, records, table

STAGE = "closed_loop@{scenario}"
ANY_STAGE = "closed_loop@<scenario>"
AP = estimate("ap_percent", "low_percent", "high_percent")
REGRET = estimate("regret_percent", "regret_low_percent", "regret_high_percent")


def overview(results: Sequence[ScenarioResult]) -> Table:
    """AP of every policy in every scenario."""
    policies = in_order({name for one in results for name in one.summary["policy"]}, POLICIES)
    rows = []
    for one in results:
        cells = {str(row["policy"]): AP(row) for row in records(one.summary)}
        rows.append({"scenario": scenario_word(one.name), "demanding": "yes" if one.is_demanding else "no", **cells})
    columns = [
        Column("scenario", "Scenario"),
        Column("demanding", "Motion in poor light"),
        *(Column(name, policy_word(name), "%", 1) for name in policies),
    ]
    notes = [
        "Average precision over all frames of a drive, mean over the classes, with a bootstrap 95 % interval over "
        "viewpoints. Every policy sees the same viewpoints, light, motion and random numbers. All IOPC policies act on "
        "estimated noise and blur; the oracle knows the truth and has no delay. Motion in poor light: at some step the "
        "light is at most a quarter of daylight and the image moves at 100 px/s or more.",
    ]
    return table(
        "control_ap", "Closed loop: average precision by scenario and policy.", rows, columns, notes, ANY_STAGE
    )


def measures(results: Sequence[ScenarioResult], decision_ms: Mapping[str, float]) -> Table:
    """Every measure of every policy in every scenario."""
    rows = [
        {**row, "scenario": scenario_word(one.name), "decision_ms": decision_ms.get(_kind(str(row["policy"])))}
        for one in results
        for row in records(ordered(one.summary, policy=POLICIES))
    ]
    columns = [
        Column("scenario", "Scenario"),
        Column("policy", "Policy", source=lambda row: policy_word(str(row["policy"]))),
        Column("ap_percent", "AP", "%", 1, AP),
        Column("regret_percent", "Regret to the oracle", "points", 1, REGRET),
        Column("settling_frames", "Settling", "frames", source=lambda row: _settling(row["settling_frames"])),
        Column("overshoot_stops", "Overshoot", "stops", 2),
        Column("ripple_stops", "Ripple", "stops", 2),
        Column("frames_lost_percent", "Frames lost", "%", 0),
        Column("abstained_percent", "Abstained", "%", 0),
        Column("refused_percent", "Refused", "%", 0),
        Column("decision_ms", "Decision", "ms", 2),
    ]
    notes = [
        "Regret: AP of the oracle less that of the policy on the same frames. Settling: frames after a disturbance "
        "until the brightness stays within a quarter stop of its last value, worst disturbance and fold; not settled: "
        "not within the scenario. Ripple: standard deviation of log2 of the exposure time after settling. Frames lost: "
        "more than a quarter of the pixels saturated, or a mean below 5 % of full scale. Abstained: decisions without "
        "an estimate. Refused: decisions for which the surface has no measured point. Decision: processor time of the "
        "policy alone (record of benchmarks/control.py), estimates not included.",
    ]
    caption = "Closed loop: average precision, regret, transients, frames lost and decisions by scenario and policy."
    return table("control_measures", caption, rows, columns, notes, ANY_STAGE)


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
    for one in results:
        for policy in OURS:
            cells: dict[str, Cell] = {}
            for other in (*BRIGHTNESS_ONLY, "prosilica"):
                difference = one.difference(policy, other)
                if difference is not None:
                    cells[other] = Estimate(*difference)
            if cells:
                head = {"scenario": scenario_word(one.name), "demanding": "yes" if one.is_demanding else "no"}
                rows.append({**head, "policy": policy_word(policy), **cells, "better": _better(one, policy)})
    columns = [
        Column("scenario", "Scenario"),
        Column("demanding", "Motion in poor light"),
        Column("policy", "Policy"),
        *(Column(name, f"less {policy_word(name)}", "points", 1) for name in (*BRIGHTNESS_ONLY, "prosilica")),
        Column("better", "Better, interval above 0", wide=True),
    ]
    notes = [
        "AP of the policy less that of the policy in the column's heading, on the same viewpoints and random numbers, "
        "with the bootstrap 95 % interval of the difference over viewpoints.",
    ]
    caption = "Closed loop: paired differences of the policies that estimate the condition to those that do not."
    return table("control_pairs", caption, rows, columns, notes, ANY_STAGE)


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
