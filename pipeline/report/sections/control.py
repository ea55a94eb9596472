"""Control: the paper's worked examples, the surface that controllers ask, the closed loop, and the order study."""

from __future__ import annotations

from dataclasses import replace

import pandas as pd

from pipeline.control.simulation.scenario_result import rises
from pipeline.control.simulation.tables import KNOTS
from pipeline.report import style
from pipeline.report.display_names import listing
from pipeline.report.figures import cell_map
from pipeline.report.inputs import ReportInputs
from pipeline.report.ledger.items import beside_ours
from pipeline.report.scenario_results import scenario_results
from pipeline.report.sections import closed_loop, control_examples, order_study
from pipeline.report.sections.closed_loop import CONTROL, scenario_word
from pipeline.report.spec import Block, Run, Section, single
from pipeline.report.tables import Table, where

SURFACE_STAGE = "control_surface"
ALL_VIEWPOINTS = -1


def section(inputs: ReportInputs) -> Section:
    """Everything on control that has run, and the commands for the rest."""
    (examples, of_examples), surface = control_examples.blocks(inputs), surface_blocks(inputs)
    results, (study, of_study) = scenario_results(inputs), order_study.blocks(inputs)
    runs = [
        single("Worked examples of control", control_examples.STAGE, bool(examples), inputs),
        single("Surface for control", SURFACE_STAGE, bool(surface), inputs),
        *_scenario_runs(inputs, {one.name for one in results}),
        single("Order of photon noise and blur", order_study.STAGE, bool(study), inputs),
    ]
    beside, published_runs = beside_ours(("worked_examples", "controller_ap", "controller_response"), inputs)
    blocks = [*examples, *surface, *closed_loop.blocks(results, inputs), *study, *beside]
    findings = [*of_examples, *closed_loop.findings(results), *of_study]
    return CONTROL.section(blocks, [*runs, *published_runs], findings)


def _scenario_runs(inputs: ReportInputs, ran: set[str]) -> list[Run]:
    """One line of the overview for all scenarios, and one for each that did not run where others did."""
    scenarios = inputs.folders("closed_loop")
    missing = [name for name in scenarios if name not in ran] if ran else []
    every = single("Closed loop", "closed_loop", bool(ran), inputs)
    partly = f"{len(ran)} of {len(scenarios)} scenarios" if missing else every.why
    return [replace(every, why=partly)] + [
        single(f"Closed loop: {scenario_word(name)}", f"closed_loop@{name}", False, inputs) for name in missing
    ]


def heat_map(knots: pd.DataFrame) -> style.Drawing:
    """AP at every noise and motion measured (`pipeline.control.simulation.tables.KNOTS`), a panel for each level."""
    levels = sorted(set(knots["level"]), reverse=True)
    grids = [
        where(knots, level=level).pivot(index="target_sigma_dn", columns="motion_px", values="ap_percent").sort_index()
        for level in levels
    ]
    figure = style.new_figure(style.TWO_COLUMNS_IN if len(levels) > 1 else style.ONE_COLUMN_IN * 1.45, 3.1)
    panels = figure.subplots(1, len(levels), squeeze=False, width_ratios=[len(grid.columns) for grid in grids])[0]
    image, words = None, []
    for axes, level, grid in zip(panels, levels, grids, strict=True):
        estimated, ap = where(knots, level=level).groupby("target_sigma_dn")["sigma_dn"].median(), grid.to_numpy(float)
        rows = [f"{sigma:g} ({estimated[sigma]:.1f})" for sigma in grid.index]
        image = cell_map(axes, ap, [f"{motion:g}" for motion in grid.columns], rows)
        axes.set_xlabel("motion blur [px]")
        axes.set_title(f"mean level {level:g}", fontsize=6.8)
        ends = {"clean": ap[0, 0], "moved": ap[0, -1], "noisy": ap[-1, 0], "both": ap[-1, -1]}
        words.append({"level": level, "px": grid.columns[-1], "dn": grid.index[-1], **ends})
    panels[0].set_ylabel("noise σ, target (estimated) [DN]")
    style.colour_bar(figure, image, list(panels), "AP [%]", shrink=0.9, pad=0.02)
    return style.Drawing(figure, CONTROL.alt("control_surface", words), knots.drop(columns="fold"))


def knot_table(knots: pd.DataFrame) -> Table:
    """AP with its interval at every knot."""
    groups = knots.groupby(["level", "target_sigma_dn"])
    median, abstained = groups["sigma_dn"].transform("median"), groups["estimates_abstained"].transform("sum")
    raised = [f"{level:g} DN and {motion:g} px" for level, motion in rises(knots)]
    return CONTROL.table(
        "control_surface", knots.assign(estimated=median, abstained=abstained),
        also=["rises" if raised else "falls", "method"], raised=listing(raised), objects=int(knots["objects"].max()),
    )  # fmt: skip


def surface_blocks(inputs: ReportInputs) -> list[Block]:
    """Heat map and table; empty where the stage has not run."""
    knots = inputs.read(f"{SURFACE_STAGE}/knots.parquet", KNOTS)
    if knots is None:
        return []
    every = where(knots, fold=ALL_VIEWPOINTS).reset_index(drop=True)
    return [CONTROL.figure("control_surface", heat_map(every)), knot_table(every)]
