"""The surface that controllers ask: AP over noise and motion, as a heat map and a table of the knots."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pandas as pd

from pipeline.control.scenario_result import rises
from pipeline.control.tables import KNOTS
from pipeline.report import style
from pipeline.report.display_names import listing
from pipeline.report.figures import cell_map
from pipeline.report.inputs import ReportInputs
from pipeline.report.sections.control_tables import CONTROL
from pipeline.report.spec import Block
from pipeline.report.style import Drawing
from pipeline.report.tables import Table, estimate, pivot

if TYPE_CHECKING:
    from matplotlib.axes import Axes

STAGE = "control_surface"
ALL_VIEWPOINTS = -1


@style.styled
def heat_map(knots: pd.DataFrame) -> Drawing:
    """AP at every measured noise and motion; one panel for each brightness of the frames.

    Args:
        knots: `pipeline.control.tables.KNOTS` of all viewpoints.
    """
    levels = sorted(set(knots["level"]), reverse=True)
    widths = [len(set(knots.loc[knots["level"] == level, "motion_px"])) for level in levels]
    figure = style.new_figure(style.TWO_COLUMNS_IN if len(levels) > 1 else style.ONE_COLUMN_IN * 1.45, 3.1)
    panels = figure.subplots(1, len(levels), squeeze=False, width_ratios=widths)[0]
    image, words = None, []
    for axes, level in zip(panels, levels, strict=True):
        own = knots[knots["level"] == level]
        image = _panel(axes, own)
        axes.set_title(f"mean level {level:g}", fontsize=6.8)
        words.append(f"at a mean level of {level:g} {_corners(own)}")
    panels[0].set_ylabel("noise σ, target (estimated) [DN]")
    style.colour_bar(figure, image, list(panels), "AP [%]", shrink=0.9, pad=0.02)
    alt = f"AP of the controlled camera's detector over noise and motion: {'; '.join(words)}."
    return Drawing(figure, alt, knots.drop(columns="fold"))


def _grid(knots: pd.DataFrame) -> pd.DataFrame:
    return knots.pivot(index="target_sigma_dn", columns="motion_px", values="ap_percent").sort_index()


def _panel(axes: Axes, knots: pd.DataFrame) -> Any:
    """One heat map; returns what the colour bar is of."""
    grid, estimated = _grid(knots), knots.groupby("target_sigma_dn")["sigma_dn"].median()
    rows = [f"{level:g} ({estimated[level]:.1f})" for level in grid.index]
    image = cell_map(axes, grid.to_numpy(float), [f"{motion:g}" for motion in grid.columns], rows)
    axes.set_xlabel("motion blur [px]")
    return image


def _corners(knots: pd.DataFrame) -> str:
    grid = _grid(knots)
    values = grid.to_numpy(float)
    return (
        f"{values[0, 0]:.0f} % for a sharp frame with least noise, {values[0, -1]:.0f} % at {grid.columns[-1]:g} px of "
        f"motion, {values[-1, 0]:.0f} % at {grid.index[-1]:g} DN, {values[-1, -1]:.0f} % at both"
    )


def knot_table(knots: pd.DataFrame) -> Table:
    """AP with its interval at every knot."""
    rows = pivot(
        knots, ["level", "target_sigma_dn"], "motion_px", estimate("ap_percent", "low_percent", "high_percent"),
        lambda motion: f"motion_{motion:g}",
    )  # fmt: skip
    groups = knots.groupby(["level", "target_sigma_dn"])
    estimated, abstained = groups["sigma_dn"].median(), groups["estimates_abstained"].sum()
    for row in rows:
        key = row["level"], row["target_sigma_dn"]
        row |= {"estimated": float(estimated[key]), "abstained": int(abstained[key])}
    raised = [f"{level:g} DN and {motion:g} px" for level, motion in rises(knots)]
    return CONTROL.table(
        "control_surface", rows, across={f"motion_{px:g}": f"{px:g} px" for px in sorted(set(knots["motion_px"]))},
        also=["rises" if raised else "falls", "method"], raised=listing(raised), objects=int(knots["objects"].max()),
    )  # fmt: skip


def blocks(inputs: ReportInputs) -> tuple[list[Block], list[str]]:
    """Heat map and table, and the sentence for the verdict; empty where the stage has not run."""
    knots = inputs.read(f"{STAGE}/knots.parquet", KNOTS)
    if knots is None:
        return [], []
    every = knots[knots["fold"] == ALL_VIEWPOINTS].reset_index(drop=True)
    return [CONTROL.figure("control_surface", heat_map(every)), knot_table(every)], []
