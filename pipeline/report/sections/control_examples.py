"""The paper's worked examples: Example 1 step by step with pictures, Example 2 as response over time and AP."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from pipeline.control.simulation.tables import CONTROLLER_AP, EXAMPLE_STEPS, RESPONSE
from pipeline.report import style
from pipeline.report.figures import PAPER_DASH, add_legend
from pipeline.report.inputs import ReportInputs, published
from pipeline.report.sections.closed_loop import CONTROL
from pipeline.report.spec import Block
from pipeline.report.tables import Table, estimate, format_number, ordered, records, where
from pipeline.stage_files import described, optional

STAGE = "worked_examples"
FIRST, SECOND = "sim_yolov4_car", "robot"
STEP_WORDS = {
    "reference": "reference, nothing moves",
    "corrupted": "as taken",
    "gain_reduced": "gain reduced",
    "initial": "fixed settings",
    "final": "final",
}
CONTROLLERS = {"camera_default": "Built-in control", "fixed_parameters": "Fixed settings", "proposed": "Paper's rule"}
RESPONSES: dict[str, style.Look] = {
    "camera_default": {"color": style.PALETTE[1], "marker": ""},
    "proposed": {"color": style.PALETTE[0], "marker": ""},
}
PUBLISHED: style.Look = {"linestyle": PAPER_DASH, "linewidth": 1.6, "alpha": 0.55}
AGREE_MS = 0.05
BESIDE_THE_PAPER = ("exposure_ms", "iso", "sigma_dn", "mtf_at_0.1", "blur_px", "detection_score")
LAST_ON_GRID_MS = 4700.0
"""The last three published samples do not follow the law's integers; they were probably resampled."""


def step_word(step: str) -> str:
    """The word for a step of an example."""
    if step.startswith("built_in_"):
        return f"built-in control at {int(step.removeprefix('built_in_')) / 10:g} s"
    return STEP_WORDS.get(step, step.replace("_", " "))


def pictures(
    example: str, steps: pd.DataFrame, arrays: Mapping[str, np.ndarray], about: Mapping[str, Any]
) -> style.Drawing:
    """One object at every step of an example, with its true box (dashed) and the detector's box and score.

    ``steps`` is an `EXAMPLE_STEPS`; ``about`` describes ``arrays``, see
    `pipeline.control.simulation.example_pictures.gallery`.
    """
    shown = [entry for entry in about["steps"] if entry["example"] == example]
    built_in = [entry for entry in shown if entry["step"].startswith("built_in_")]
    shown = [entry for entry in shown if entry not in built_in[:-1]]
    known = {row["step"]: row for row in records(steps[steps["example"] == example])}
    height, width = arrays[shown[0]["array"]].shape
    figure, axes = style.sheet(len(shown), [height / width], top_in=0.34, bottom_in=0.42)
    rows, words = [], []
    for panel, entry in zip(axes[0], shown, strict=True):
        row = known[entry["step"]]
        style.picture(panel, arrays[entry["array"]])
        style.outline(panel, about["box"], edgecolor=style.PALETTE[4], linewidth=0.9, linestyle=(0, (3, 2)))
        if entry["box"] is not None:
            style.outline(panel, entry["box"], edgecolor=style.PALETTE[5], linewidth=1.1)
        settings = f"{format_number(row['exposure_ms'], 1)} ms, ISO {row['iso']:.0f}"
        settings = settings if np.isfinite(row["iso"]) else "as bright as taken"
        title = step_word(entry["step"])
        panel.set_title(f"{title[:1].upper()}{title[1:]}\n{settings}", fontsize=6.6, pad=3)
        score = "missed" if entry["box"] is None else f"score {entry['score']:.2f}"
        panel.set_xlabel(
            f"this {about['label']}: {score}\nall: {row['detection_score']:.2f}, AP {row['ap_percent']:.0f} %\n"
            f"σ {row['sigma_dn']:.1f} DN, motion {row['blur_px']:.1f} px",
            fontsize=5.8, labelpad=2,
        )  # fmt: skip
        rows.append({"step": entry["step"], "score_of_this_object": entry["score"], **row})
        words.append({"title": title, "settings": settings, "score": score})
    alt = CONTROL.alt("control_example", words, label=about["label"], number="1" if example == FIRST else "2")
    return style.Drawing(figure, alt, pd.DataFrame(rows).drop(columns="example"))


def step_table(steps: pd.DataFrame, paper: pd.DataFrame) -> Table:
    """Every setting of both examples, the paper's numbers beside ours."""
    beside = steps.merge(paper, how="left", on=["example", "step"], suffixes=("", "_paper"))
    cells = {name: estimate(name, "", "", "", f"{name}_paper") for name in BESIDE_THE_PAPER}
    return CONTROL.table("control_examples", beside, cells=cells | {"step": lambda row: step_word(row["step"])})


def response(ours: pd.DataFrame, paper: pd.DataFrame, precision: pd.DataFrame, theirs: pd.DataFrame) -> style.Drawing:
    """Exposure time and gain over time, published and replayed, and the AP of the three controllers.

    ``ours`` is a `RESPONSE`, as is ``paper``; ``precision`` a `CONTROLLER_AP`, ``theirs`` its published counterpart.
    """
    figure = style.new_figure(style.TWO_COLUMNS_IN, 2.35)
    panels = figure.subplots(1, 3, width_ratios=[1.5, 1.0, 0.9])
    for axes, quantity, label in ((panels[0], "exposure_ms", "exposure time [ms]"), (panels[1], "iso", "gain [ISO]")):
        for name, look in RESPONSES.items():
            for rows, change in ((paper, PUBLISHED), (ours, {})):
                selected = where(rows, controller=name, quantity=quantity).sort_values("time_ms")
                axes.plot(selected["time_ms"] / 1e3, selected["value"], **(look | change))
        axes.set(xlabel="time [s]", xlim=(0, 5))
        axes.set_ylim(0, None)
        axes.set_title(label, fontsize=6.8)
    both = precision.merge(theirs, how="left", on="controller", suffixes=("", "_paper"))
    shown = records(ordered(both[both["controller"].isin(list(CONTROLLERS))], controller=CONTROLLERS))
    for index, row in enumerate(shown):
        colour = RESPONSES.get(row["controller"], {"color": style.MUTED})["color"]
        ap, ends = row["car_ap_percent"], (row["low_percent"], row["high_percent"])
        span = np.maximum(np.nan_to_num([[ap - ends[0]], [ends[1] - ap]]), 0.0)
        panels[2].errorbar([index - 0.12], [ap], yerr=span, color=colour, marker="o", capsize=2)
        if np.isfinite(row["car_ap_percent_paper"]):
            paper_ap = row["car_ap_percent_paper"]
            panels[2].plot([index + 0.12], [paper_ap], marker="D", color=colour, markerfacecolor="none")
    panels[2].set_xticks(range(len(shown)), [CONTROLLERS[row["controller"]].replace(" ", "\n") for row in shown])
    panels[2].set(xlim=(-0.5, len(shown) - 0.5), ylim=(0, 103))
    panels[2].set_title("AP of cars [%]", fontsize=6.8)
    published = {"color": style.MUTED, "marker": "D", "markerfacecolor": "none"} | PUBLISHED
    legend = [(CONTROLLERS[name], look) for name, look in RESPONSES.items()]
    add_legend(figure, [*legend, ("published (dashed, diamond)", published)])
    words = [
        {"controller": CONTROLLERS[row["controller"]], "ours": row["car_ap_percent"], "paper": theirs_of}
        for row in shown if np.isfinite(theirs_of := row["car_ap_percent_paper"])
    ]  # fmt: skip
    alt = CONTROL.alt("control_response", words, **law_errors(ours, paper))
    keys = ["controller", "quantity", "time_ms"]
    merged = ours.merge(paper, on=keys, how="outer", suffixes=("", "_paper"))
    return style.Drawing(figure, alt, merged.sort_values(keys))


def law_errors(ours: pd.DataFrame, paper: pd.DataFrame) -> dict[str, float]:
    """How far the built-in controller's exposure time is from the published one.

    Returns:
        ``error``: root mean square difference until ``until_s``, ms; ``after``: largest difference after it, ms.
    """
    both = ours.merge(paper, on=["controller", "quantity", "time_ms"], suffixes=("", "_paper"))
    both = where(both, controller="camera_default", quantity="exposure_ms")
    difference, on_grid = both["value"] - both["value_paper"], both["time_ms"] <= LAST_ON_GRID_MS
    return {
        "error": float(np.sqrt((difference[on_grid] ** 2).mean())), "until_s": LAST_ON_GRID_MS / 1e3,
        "after": float(difference[~on_grid].abs().max()),
    }  # fmt: skip


def blocks(inputs: ReportInputs) -> tuple[list[Block], list[str]]:
    """Figures and table of the examples, and their sentences for the verdict; empty where the stage has not run."""
    folder = inputs.folder(STAGE)
    steps = optional(folder, "steps.parquet", EXAMPLE_STEPS)
    if steps is None:
        return [], []
    # As bright as the frame taken, the reference is of no settings: at those stored it would be a quarter as bright.
    steps = steps.assign(**steps[["exposure_ms", "iso"]].where(steps["step"] != "reference"))
    parts: list[Block] = []
    arrays, about = optional(folder, "pictures.npz"), described(folder, "pictures.json", ("label", "box", "steps"))
    if arrays is not None and about is not None:
        for number, example in (("1", FIRST), ("2", SECOND)):
            words = {"number": number, "rule": CONTROL.text(f"rule_{number}"), "label": about["label"]}
            parts.append(CONTROL.figure("control_example", pictures(example, steps, arrays, about), **words))
    parts.append(step_table(steps, published(inputs, "worked_examples.csv")))
    ours = optional(folder, "response.parquet", RESPONSE)
    precision = optional(folder, "precision.parquet", CONTROLLER_AP)
    paper, theirs = (published(inputs, f"controller_{name}.csv") for name in ("response", "ap"))
    parts.append(CONTROL.figure("control_response", response(ours, paper, precision, theirs)))
    return parts, _findings(ours, paper, precision)


def _findings(ours: pd.DataFrame, paper: pd.DataFrame, precision: pd.DataFrame) -> list[str]:
    values = [float(precision.loc[precision["controller"] == name, "car_ap_percent"].iloc[0]) for name in CONTROLLERS]
    holds = values[0] < values[1] < values[2]
    order = (" < " if holds else ", ").join(f"{value:.1f}" for value in values)
    errors = law_errors(ours, paper)
    return [
        CONTROL.text("order", order=order, are="are" if holds else "are not"),
        CONTROL.text("law", **errors, within="within" if errors["error"] <= AGREE_MS else "beyond", bound=AGREE_MS),
    ]
