"""The closed loop: results of its scenarios, tables of policies, measures, paired differences and losses, films."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, FuncFormatter, MaxNLocator, NullFormatter, NullLocator

from pipeline.cluster_intervals import cluster_mean
from pipeline.control.simulation.course import COURSE, course
from pipeline.control.simulation.largest_loss import LargestLoss, largest_loss
from pipeline.control.simulation.scenario_result import BRIGHTNESS_ONLY, OURS, ScenarioResult
from pipeline.report import style
from pipeline.report.descriptions import Descriptions
from pipeline.report.display_names import POLICIES, in_order, listing, word
from pipeline.report.figures import add_legend
from pipeline.report.inputs import Benchmark, ReportInputs
from pipeline.report.spec import Block
from pipeline.report.tables import Estimate, Table, format_number, ordered, records, where
from pipeline.streams import stream

CONTROL = Descriptions("control")
LOOKS: dict[str, style.Look] = {
    "mean_intensity": {"color": style.PALETTE[1], "marker": "s"},
    "iopc_continuous": {"color": style.PALETTE[0], "marker": "o"},
    "iopc_lamp": {"color": style.PALETTE[3], "marker": "D"},
    "oracle": {"color": style.MUTED, "marker": ""},
}
"""Policies drawn over time; the tables hold all."""

TIMED = Benchmark("control", "python benchmarks/control.py", ("machine", "decision"))
PICTURED = ("mean_intensity", "iopc_continuous")
PANELS: tuple[tuple[str, str, str, bool], ...] = (
    ("light", "", "light [daylight = 1]", True),
    ("exposure_ms", "", "exposure time [ms]", True),
    ("iso", "", "gain [ISO]", True),
    ("mean_level", "", "mean level", False),
    ("speed_px_s", "", "speed [px/s]", False),
    ("motion_px", "estimated_motion_px", "motion blur [px]", False),
    ("sigma_dn", "estimated_sigma_dn", "noise σ [DN]", False),
    ("ap_percent", "", "AP [%]", False),
)
"""Column, column of its estimate, label, whether the axis is logarithmic; four in a row."""

ESTIMATED: style.Look = {"linestyle": "none", "markersize": 3.4, "markerfacecolor": "none", "markeredgewidth": 0.7}
PICTURE_PX = (120, 168)
COLUMNS = 4


def scenario_word(name: str) -> str:
    """The word for a scenario."""
    return name.replace("_", " ").capitalize()


def decision_ms(inputs: ReportInputs) -> dict[str, float]:
    """Processor time of one decision by registry name of the policy, ms; empty without a record.

    Errors of `ReportInputs.benchmark`.
    """

    def times(record: Mapping[str, Any]) -> dict[str, float]:
        return {name: float(policy["processor_median_ms"]) for name, policy in record["decision"].items()}

    return inputs.benchmark(TIMED, times) or {}


def _policies(names: Sequence[str]) -> str:
    return listing(map(word, names))


def _head(one: ScenarioResult) -> dict[str, str]:
    return {"scenario": scenario_word(one.name), "demanding": "yes" if one.is_demanding else "no"}


def _summary(results: Sequence[ScenarioResult]) -> pd.DataFrame:
    """Every policy in every scenario."""
    rows = pd.concat([one.summary.assign(**_head(one)) for one in results], ignore_index=True)
    return ordered(rows, scenario=[scenario_word(one.name) for one in results], policy=POLICIES)


def overview(results: Sequence[ScenarioResult]) -> Table:
    """AP of every policy in every scenario."""
    return CONTROL.table("control_ap", _summary(results))


def measures(results: Sequence[ScenarioResult], decision_ms: Mapping[str, float]) -> Table:
    """Every measure of every policy in every scenario."""
    cells = {
        "settling_frames": lambda row: None if row["policy"] == "oracle" else _settling(row),
        "overshoot_stops": lambda row: row["overshoot_stops"] if math.isfinite(row["overshoot_stops"]) else None,
        "ripple_stops": lambda row: (
            row["ripple_stops"] if math.isfinite(row["settling_frames"] + row["ripple_stops"]) else None
        ),
        "decision_ms": lambda row: decision_ms.get(row["policy"].replace("iopc_lamp", "iopc_continuous")),
    }
    return CONTROL.table("control_measures", _summary(results), cells=cells)


def courses(results: Sequence[ScenarioResult]) -> pd.DataFrame:
    """`course` of every drive; the share of frames without an estimate only of policies that ask for estimates."""
    drives = pd.concat([course(result.steps).assign(**_head(result)) for result in results], ignore_index=True)
    asks = drives.groupby("policy")["unestimated_percent"].transform("min") < 100.0
    return drives.assign(unestimated_percent=drives["unestimated_percent"].where(asks))


def course_by_policy(drives: pd.DataFrame) -> Table:
    """Course of the drives of each policy: mean over all, with intervals over the scenarios."""
    rows: list[dict[str, Any]] = []
    for policy, table in drives.groupby("policy", sort=False):
        row: dict[str, Any] = {"policy": policy, "scenarios": table["scenario"].nunique()}
        for name in COURSE:
            highest = 100.0 if name.endswith("_percent") else math.inf
            generator = stream(0, "course of the closed loop", name)
            row[name] = Estimate(*cluster_mean(table[name], table["scenario"], generator, bounds=(0.0, highest))[:3])
        rows.append(row)
    return CONTROL.table("control_course", ordered(pd.DataFrame(rows), policy=POLICIES))


def course_by_scenario(drives: pd.DataFrame) -> Table:
    """Course of the drives of each policy in each scenario: mean over the folds."""
    means = drives.groupby(["scenario", "policy"], sort=False, as_index=False)[list(COURSE)].mean()
    rows = ordered(means, scenario=list(drives["scenario"].unique()), policy=POLICIES)
    return CONTROL.table("control_course_scenarios", rows)


def _settling(row: Mapping[str, Any]) -> str | None:
    """Settling of a policy, in words; None where the scenario has no part long enough to measure it.

    Args:
        row: of schema `SUMMARY`.
    """
    if not math.isfinite(row["overshoot_stops"]):
        return None
    return format_number(row["settling_frames"], 0) if math.isfinite(row["settling_frames"]) else "not settled"


def _cause(result: ScenarioResult) -> str:
    """A scenario that is not won, and the policies whose difference does not exclude 0, beside the oracle's."""
    best = max(filter(result.compared, OURS), key=lambda policy: len(result.exceeded(policy)))
    level, oracle = result.not_exceeded(best), result.not_exceeded("oracle")
    also = [other for other in level if other in oracle]
    text = f"{scenario_word(result.name).lower()} (not above {_policies(level)}"
    if also:
        text += ", nor is the oracle" + ("" if also == level else f" above {_policies(also)}")
    return f"{text})"


def _won(demanding: Sequence[ScenarioResult]) -> str:
    """In how many demanding scenarios ours beats all rivals that ran, where it does not, and which did not run."""
    compared = [result for result in demanding if any(map(result.compared, OURS))]
    missed = [result for result in compared if not any(map(result.beats_all, OURS))]
    parts = [CONTROL.text("won", won=len(compared) - len(missed), demanding=len(compared))] if compared else []
    parts += [f"Not in: {listing(map(_cause, missed))}."] if missed else []
    partial = [result for result in demanding if result.not_run]
    absent = [f"{_policies(result.not_run)} in {scenario_word(result.name).lower()}" for result in partial]
    parts += [CONTROL.text("not_run", policies="; ".join(absent))] if absent else []
    return " ".join(parts)


def pairs(results: Sequence[ScenarioResult]) -> Table:
    """Paired differences of ours to the policies that know no motion."""
    others = (*BRIGHTNESS_ONLY, "prosilica")
    rows: list[dict[str, Any]] = []
    for one, policy in itertools.product(results, OURS):
        cells = {name: Estimate(*known) for name in others if (known := one.difference(policy, name)) is not None}
        above, below = one.exceeded(policy), one.exceeding(policy)
        better = f"than {_policies(above)}" if above else "than none"
        better += f"; worse than {_policies(below)}" if below else ""
        rows += [{**_head(one), "policy": policy, **cells, "better": better}] if cells else []
    return CONTROL.table("control_pairs", rows, across={name: f"less {word(name)}" for name in others})


def losses(results: Sequence[ScenarioResult]) -> Table:
    """Rivals whose paired difference does not lie above 0, in scenarios with motion in poor light."""
    rows: list[dict[str, Any]] = []
    for one, other in itertools.product((one for one in results if one.is_demanding), BRIGHTNESS_ONLY):
        known = {policy: difference for policy in OURS if (difference := one.difference(policy, other)) is not None}
        if known and not any(difference[1] > 0 for difference in known.values()):
            policy, oracle = max(known, key=lambda name: known[name][0]), one.difference("oracle", other)
            differences = {"difference": Estimate(*known[policy]), "oracle": oracle and Estimate(*oracle)}
            frame = _words(largest_loss(one.steps, policy, other))
            rows.append({**_head(one), "policy": policy, "other": other, **differences, "where": frame})
    return CONTROL.table("control_losses", rows)


def _words(loss: LargestLoss | None) -> str:
    if loss is None:
        return "behind in no frame"
    when = f"frame {loss.step}"
    if loss.change:
        when += f", {loss.frames_after} after {loss.change}" if loss.frames_after else f", at the {loss.change}"
    ours, theirs = (f"{state.exposure_ms:.1f} ms, ISO {state.iso:.0f}" for state in (loss.state, loss.other_state))
    return f"{loss.loss_percent:.1f} points in {when}: {ours} against {theirs}"


def findings(results: Sequence[ScenarioResult]) -> list[str]:
    """Sentences of the verdict on the closed loop, from the tables' numbers."""
    demanding = [one for one in results if one.is_demanding]
    sentences = []
    if demanding:
        sentences.append(_won(demanding))
    for policy in OURS:
        each = [one.measure(policy, "regret_percent") for one in results]
        regrets = [regret for regret in each if regret is not None and math.isfinite(regret)]  # NaN without the oracle
        losses = [one.largest_loss_percent(policy) for one in results if one.stands]
        known = [loss for loss in losses if loss is not None]
        if regrets:
            still = f"; where nothing moves, at most {max(*known, 0.0):.1f} points below any of them" if known else ""
            text = f"{word(policy)}: median regret to the oracle {np.median(regrets):.1f} AP points"
            sentences.append(f"{text}{still}.")
    stepped = [
        f"{settling} in {scenario_word(result.name).lower()}"
        for result in results
        if result.has_light_step
        for row in records(where(result.summary, policy="iopc_continuous"))
        if (settling := _settling(row)) is not None
    ]
    if stepped:
        sentences.append(CONTROL.text("settling", drives=listing(stepped)))
    return sentences


def over_time(result: ScenarioResult) -> pd.DataFrame:
    """Steps of the policies drawn: the state is that of the first fold, AP the mean of the folds."""
    steps = where(result.steps, policy=list(LOOKS))
    steps = steps.assign(ap_percent=steps.groupby(["policy", "step"])["ap_percent"].transform("mean"))
    first = where(steps, fold=steps["fold"].min()).sort_values(["policy", "step"], kind="stable")
    shown = ["policy", "step", *(name for column, other, _, _ in PANELS for name in (column, other) if name), "action"]
    return first[shown].reset_index(drop=True)


def strip(result: ScenarioResult) -> style.Drawing:
    """One scenario: eight panels over the frame number, and pictures of the leading viewpoint."""
    rows = over_time(result)
    policies = in_order(rows["policy"], LOOKS)
    films = {name: result.films[name] for name in PICTURED if result.films.get(name)}
    heights = [1.25] * (len(PANELS) // COLUMNS) + [1.28] * len(films)
    figure = style.new_figure(style.TWO_COLUMNS_IN, sum(heights) + 0.35)
    grid = figure.subplots(len(heights), COLUMNS, height_ratios=heights)
    for axes, panel in zip(grid.flat, PANELS, strict=False):
        _panel(axes, rows, policies, panel)
    for axes in grid[len(PANELS) // COLUMNS - 1]:
        axes.set_xlabel("frame", fontsize=6.2)
    for spots, (name, film) in zip(grid[len(PANELS) // COLUMNS :], films.items(), strict=True):
        states = {row["step"]: row for row in records(where(rows, policy=name))}
        for axes in spots[len(film) :]:
            axes.set_axis_off()
        for axes, step in zip(spots, sorted(film), strict=False):
            style.picture(axes, style.middle(film[step], *PICTURE_PX))
            settings = f"{format_number(states[step]['exposure_ms'], 1)} ms, ISO {states[step]['iso']:.0f}"
            label = f"frame {step}: {settings}, AP {states[step]['ap_percent']:.0f} %"
            axes.set_xlabel(label, fontsize=5.6, labelpad=2)
        spots[0].set_ylabel(word(name), fontsize=6.4)
    estimated = ESTIMATED | {"color": style.MUTED, "marker": "o"}
    add_legend(figure, [*((word(name), LOOKS[name]) for name in policies), ("estimated", estimated)])
    return style.Drawing(figure, _alt(result, rows, policies), rows)


def _panel(axes: Axes, rows: pd.DataFrame, policies: list[str], panel: tuple[str, str, str, bool]) -> None:
    column, estimated, label, logarithmic = panel
    scene = bool((rows.groupby("step")[column].nunique() <= 1).all()) and column in ("light", "speed_px_s")
    for name in policies[:1] if scene else policies:
        selected = where(rows, policy=name)
        look = {"color": style.INK, "marker": ""} if scene else LOOKS[name]
        axes.plot(selected["step"], selected[column], **(look | {"markersize": 2.0}))
        if estimated and selected[estimated].notna().any():
            axes.plot(selected["step"], selected[estimated], **(look | ESTIMATED))
    if logarithmic:
        axes.set_yscale("log", base=2)
        if column == "iso":
            axes.yaxis.set_major_locator(FixedLocator([100.0 * 2.0**stop for stop in range(-2, 9)]))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: format_number(value)))
        axes.yaxis.set_minor_locator(NullLocator())
        axes.yaxis.set_minor_formatter(NullFormatter())
        low, high = axes.get_ylim()
        if high < 2 * low:  # a constant, or what hardly varies, still shows two ticks
            axes.set_ylim(low / 2, high * 2)
    elif column == "ap_percent":
        axes.set_ylim(0, 103)
    else:
        shown = rows[[column, estimated]] if estimated else rows[[column]]
        is_flat = column == "mean_level" or not shown.fillna(0).any(axis=None)  # a zero everywhere still shows its axis
        axes.set_ylim(0, 1.0 if is_flat else 1.15 * axes.get_ylim()[1])
    axes.set_title(label, fontsize=6.4, pad=3)
    axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))
    axes.set_xlim(-0.3, float(rows["step"].max()) + 0.3)


def _alt(result: ScenarioResult, rows: pd.DataFrame, policies: list[str]) -> str:
    """Light, speed, settings at the first and the last frame, and the mean AP over the frames."""
    words = []
    for name in in_order(policies, POLICIES):
        drive = records(where(rows, policy=name))
        first, last = (
            f"{format_number(row['exposure_ms'], 1)} ms at ISO {row['iso']:.0f}" for row in (drive[0], drive[-1])
        )
        ap = sum(row["ap_percent"] for row in drive) / len(drive)
        words.append({"policy": name, "first": first, "last": last, "ap": ap})
    light, speed, steps = (rows[name] for name in ("light", "speed_px_s", "step"))
    lights = {"least_light": format_number(light.min()), "most_light": format_number(light.max())}
    frames = {"frames": steps.max() - steps.min() + 1, "least_speed": speed.min(), "most_speed": speed.max()}
    scenario = scenario_word(result.name).lower()
    return CONTROL.alt("control_film", words, scenario=scenario, **lights, **frames)


def blocks(results: Sequence[ScenarioResult], inputs: ReportInputs) -> list[Block]:
    """Tables of the policies and the film strips of all scenarios; empty where none has run."""
    if not results:
        return []
    lost, times = losses(results), decision_ms(inputs)
    films = [
        CONTROL.figure("control_film", strip(one), file=one.name, scenario=scenario_word(one.name)) for one in results
    ]
    drives = courses(results)
    tables = [overview(results), pairs(results), *([lost] if lost.rows else []), measures(results, times)]
    return [*tables, course_by_policy(drives), course_by_scenario(drives), *films]
