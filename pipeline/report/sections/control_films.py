"""Film strip of a scenario: light, speed, settings, true and estimated condition and AP over time, pictures beneath."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pandas as pd

from pipeline.control.scenario_result import ScenarioResult
from pipeline.report import style
from pipeline.report.control_results import POLICIES, policy_word, scenario_word
from pipeline.report.display_names import in_order, listing
from pipeline.report.figures import add_legend
from pipeline.report.sections.control_tables import CONTROL
from pipeline.report.spec import Figure
from pipeline.report.style import Drawing, Look
from pipeline.report.tables import format_number, records

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LOOKS: dict[str, Look] = {
    "mean_intensity": {"color": style.PALETTE[1], "marker": "s"},
    "iopc_continuous": {"color": style.PALETTE[0], "marker": "o"},
    "iopc_lamp": {"color": style.PALETTE[3], "marker": "D"},
    "oracle": {"color": style.MUTED, "marker": ""},
}
"""Policies drawn over time; the tables hold all."""

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

ESTIMATED: Look = {"linestyle": "none", "markersize": 3.4, "markerfacecolor": "none", "markeredgewidth": 0.7}
PICTURE_PX = (120, 168)
COLUMNS = 4


def over_time(result: ScenarioResult) -> pd.DataFrame:
    """Steps of the policies drawn: the state is that of the first fold, AP the mean of the folds."""
    steps = result.steps[result.steps["policy"].isin(list(LOOKS))]
    precision = steps.groupby(["policy", "step"])["ap_percent"].mean()
    first = steps[steps["fold"] == steps["fold"].min()].sort_values(["policy", "step"], kind="stable")
    index = [(policy, step) for policy, step in zip(first["policy"], first["step"], strict=True)]
    shown = ["policy", "step", *(name for column, other, _, _ in PANELS for name in (column, other) if name), "action"]
    return first.assign(ap_percent=precision.loc[index].to_numpy())[shown].reset_index(drop=True)


@style.styled
def strip(result: ScenarioResult) -> Drawing:
    """One scenario: eight panels over the frame number, and pictures of the leading viewpoint.

    Args:
        result: of the scenario.
    """
    rows = over_time(result)
    policies = in_order(rows["policy"], LOOKS)
    films = {name: result.films[name] for name in PICTURED if result.films.get(name)}
    panel_rows = len(PANELS) // COLUMNS
    heights = [1.25] * panel_rows + [1.28] * len(films)
    figure = style.new_figure(style.TWO_COLUMNS_IN, sum(heights) + 0.35)
    grid = figure.add_gridspec(len(heights), COLUMNS, height_ratios=heights)
    for number, panel in enumerate(PANELS):
        axes = figure.add_subplot(grid[number // COLUMNS, number % COLUMNS])
        _panel(axes, rows, policies, panel)
        if number >= len(PANELS) - COLUMNS:
            axes.set_xlabel("frame", fontsize=6.2)
    for down, (name, film) in enumerate(films.items()):
        chosen = sorted(film)[:COLUMNS]
        states = {row["step"]: row for row in records(rows[rows["policy"] == name])}
        for across, step in enumerate(chosen):
            axes = figure.add_subplot(grid[panel_rows + down, across])
            style.picture(axes, style.middle(film[step], *PICTURE_PX))
            here = states[step]
            axes.set_xlabel(
                f"frame {step}: {format_number(here['exposure_ms'], 1)} ms, ISO {here['iso']:.0f}, "
                f"AP {here['ap_percent']:.0f} %",
                fontsize=5.6, labelpad=2,
            )  # fmt: skip
            if across == 0:
                axes.set_ylabel(policy_word(name), fontsize=6.4)
    estimated = ESTIMATED | {"color": style.MUTED, "marker": "o"}
    add_legend(figure, [*((policy_word(name), LOOKS[name]) for name in policies), ("estimated", estimated)])
    return Drawing(figure, _alt(result, rows, policies), rows)


def _panel(axes: Axes, rows: pd.DataFrame, policies: list[str], panel: tuple[str, str, str, bool]) -> None:
    from matplotlib.ticker import FixedLocator, FuncFormatter, MaxNLocator, NullFormatter, NullLocator

    column, estimated, label, logarithmic = panel
    scene = bool((rows.groupby("step")[column].nunique() <= 1).all()) and column in ("light", "speed_px_s")
    for name in policies[:1] if scene else policies:
        selected = rows[rows["policy"] == name]
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
        if high < 2 * low:  # a constant still shows ticks
            axes.set_ylim(low / 1.5, high * 1.5)
    elif column == "ap_percent":
        axes.set_ylim(0, 103)
    else:
        is_flat = column == "mean_level" or not rows[column].any()  # a zero everywhere still shows its axis
        axes.set_ylim(0, 1.0 if is_flat else 1.15 * axes.get_ylim()[1])
    axes.set_title(label, fontsize=6.4, pad=3)
    axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))
    axes.set_xlim(-0.3, float(rows["step"].max()) + 0.3)


def _alt(result: ScenarioResult, rows: pd.DataFrame, policies: list[str]) -> str:
    """Light, speed, settings at the first and the last frame, and the mean AP over the frames."""
    first, last = rows["step"].min(), rows["step"].max()

    def at(name: str, step: int) -> str:
        row = rows[(rows["policy"] == name) & (rows["step"] == step)].iloc[0]
        return f"{format_number(float(row['exposure_ms']), 1)} ms at ISO {row['iso']:.0f}"

    words = [
        f"{policy_word(name)} from {at(name, first)} to {at(name, last)}, AP per frame "
        f"{rows.loc[rows['policy'] == name, 'ap_percent'].mean():.0f} % on average"
        for name in in_order(policies, POLICIES)
    ]
    light, speed = (rows[name] for name in ("light", "speed_px_s"))
    return (
        f"Scenario {scenario_word(result.name).lower()} over {last - first + 1} frames, light "
        f"{format_number(light.min())} to {format_number(light.max())} of daylight, speed {speed.min():.0f} to "
        f"{speed.max():.0f} px/s. {listing(words)}."
    )


def figures(results: list[ScenarioResult]) -> list[Figure]:
    """The film strips of all scenarios."""
    return [
        CONTROL.figure("control_film", strip(one), file=one.name, scenario=scenario_word(one.name)) for one in results
    ]
