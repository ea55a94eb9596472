"""The surface that controllers ask: AP over noise and motion, as a heat map and a table of the knots."""

from __future__ import annotations

from typing import Any

import pandas as pd
from matplotlib.axes import Axes

from pipeline.control.scenario_result import rises
from pipeline.control.tables import KNOTS
from pipeline.report import style
from pipeline.report.display_names import listing
from pipeline.report.figures import cell_map
from pipeline.report.inputs import ReportInputs
from pipeline.report.sections.closed_loop import CONTROL
from pipeline.report.spec import Block
from pipeline.report.style import Drawing
from pipeline.report.tables import Table, where

STAGE = "control_surface"
ALL_VIEWPOINTS = -1


@style.styled
def heat_map(knots: pd.DataFrame) -> Drawing:
    """AP at every measured noise and motion (`pipeline.control.tables.KNOTS`); one panel for each mean level."""
    levels = sorted(set(knots["level"]), reverse=True)
    grids = [
        where(knots, level=level).pivot(index="target_sigma_dn", columns="motion_px", values="ap_percent").sort_index()
        for level in levels
    ]
    figure = style.new_figure(style.TWO_COLUMNS_IN if len(levels) > 1 else style.ONE_COLUMN_IN * 1.45, 3.1)
    panels = figure.subplots(1, len(levels), squeeze=False, width_ratios=[len(grid.columns) for grid in grids])[0]
    image, words = None, []
    for axes, level, grid in zip(panels, levels, grids, strict=True):
        estimated = where(knots, level=level).groupby("target_sigma_dn")["sigma_dn"].median()
        image = _panel(axes, grid, estimated)
        axes.set_title(f"mean level {level:g}", fontsize=6.8)
        ap = grid.to_numpy(float)
        ends = {"clean": ap[0, 0], "moved": ap[0, -1], "noisy": ap[-1, 0], "both": ap[-1, -1]}
        words.append({"level": level, "px": grid.columns[-1], "dn": grid.index[-1], **ends})
    panels[0].set_ylabel("noise σ, target (estimated) [DN]")
    style.colour_bar(figure, image, list(panels), "AP [%]", shrink=0.9, pad=0.02)
    return Drawing(figure, CONTROL.alt("control_surface", words), knots.drop(columns="fold"))


def _panel(axes: Axes, grid: pd.DataFrame, estimated: pd.Series) -> Any:
    """One heat map; returns what the colour bar is of."""
    rows = [f"{level:g} ({estimated[level]:.1f})" for level in grid.index]
    axes.set_xlabel("motion blur [px]")
    return cell_map(axes, grid.to_numpy(float), [f"{motion:g}" for motion in grid.columns], rows)


def knot_table(knots: pd.DataFrame) -> Table:
    """AP with its interval at every knot."""
    groups = knots.groupby(["level", "target_sigma_dn"])
    median, abstained = groups["sigma_dn"].transform("median"), groups["estimates_abstained"].transform("sum")
    raised = [f"{level:g} DN and {motion:g} px" for level, motion in rises(knots)]
    return CONTROL.table(
        "control_surface", knots.assign(estimated=median, abstained=abstained),
        also=["rises" if raised else "falls", "method"], raised=listing(raised), objects=int(knots["objects"].max()),
    )  # fmt: skip


def blocks(inputs: ReportInputs) -> list[Block]:
    """Heat map and table; empty where the stage has not run."""
    knots = inputs.read(f"{STAGE}/knots.parquet", KNOTS)
    if knots is None:
        return []
    every = where(knots, fold=ALL_VIEWPOINTS).reset_index(drop=True)
    return [CONTROL.figure("control_surface", heat_map(every)), knot_table(every)]
