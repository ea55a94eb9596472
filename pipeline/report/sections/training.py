"""Training: learning curves, budget, size and held-out error of every network, and trainings with one thing changed."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from pipeline.learning.learning_curve import HELD_OUT, LearningCurve, read
from pipeline.report import style, training_budget
from pipeline.report.descriptions import Descriptions
from pipeline.report.display_names import ESTIMATORS, word
from pipeline.report.inputs import ReportInputs
from pipeline.report.spec import Block, Section, single
from pipeline.report.tables import Estimate, Table
from pipeline.stage_files import existing, optional

PAGE = Descriptions("training")
EXPECTED = ("mtf_spectral", "sigma_cellwise", "detector_compact")
PAPER_PARAMETERS = {"mtf_cnn": 6_757_384, "sigma_cnn": 519_361}
"""Of the paper's two networks, counted in its program."""

PAPER_SQUARED_ERROR = {"mtf_cnn": 0.0083}
"""Best validation MSE in the log of the paper's training, 47 of 51 epochs of 160,500 samples less 15 % held out."""

ACROSS = 3  # panels in a row
TITLE_CHARACTERS = 34  # in a line of a panel's title
SEEDS = ("base", "seed_2", "seed_3")
CHANGED = "mtf_spectral"
"""Network whose training the ablation changes."""


TASKS = {"mtf": "Blur", "sigma": "Noise", "detector": "Detector"}
MEASURES = {"sigma_error_dn": "σ error", "ap_percent": "average precision", "ap": "average precision"}
MEASURES |= {"mtf_error_percent": "MTF error", "missed_percent": "mean AP missed"}


def network_title(one: LearningCurve) -> str:
    """``"Blur: Spectral"``; of the paper's networks with their own share of its training, where names carry it."""
    task, _, network = one.name.partition("_")
    name, percent = word(network), training_budget.percent_of(one)
    if percent is not None and name != ESTIMATORS[network]:
        name = ESTIMATORS[network] if percent >= 100 else f"{ESTIMATORS[network]} ({training_budget.in_words(percent)})"
    return f"{TASKS.get(task, word(task))}: {name}"


def measure_title(one: LearningCurve) -> str:
    """The measure of a curve in words."""
    return MEASURES.get(one.measure, one.measure.removesuffix("_percent").removesuffix("_dn").replace("_", " "))


def measure_heading(one: LearningCurve) -> str:
    """The measure with its unit in brackets."""
    return f"{measure_title(one)} [{one.unit}]" if one.unit else measure_title(one)


def stage_of(name: str) -> str:
    """The stage that trains a network, e.g. ``train_mtf@spectral``."""
    task, _, network = name.partition("_")
    return f"train_{task}@{network}"


def _panel(axes: Axes, one: LearningCurve) -> None:
    training, held_out = one.training(), one.held_out()
    if training is not None and len(training):
        axes.plot(training.index, training.to_numpy(), color=style.MUTED, linewidth=0.7, label="training samples")
    colour = style.series_look(one.name.partition("_")[2])["color"]
    axes.plot(held_out.index, held_out.to_numpy(), color=colour, linewidth=1.2, label="held out")
    if one.chosen is not None and one.chosen in held_out.index:
        point = {"marker": "o", "markersize": 4, "linestyle": "none", "color": colour}
        axes.plot([one.chosen], [held_out[one.chosen]], label="released", **point)
    values = np.concatenate([held_out.to_numpy(), training.to_numpy() if training is not None else np.empty(0)])
    if values.size and values.min() > 0 and values.max() > 8 * values.min():
        axes.set_yscale("log")
        axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.yaxis.set_minor_formatter(NullFormatter())
    title = textwrap.fill(network_title(one), TITLE_CHARACTERS)
    axes.set(title=title, xlabel="step", ylabel=measure_heading(one), xlim=(0, 1.03 * one.steps))
    axes.legend(loc="best", fontsize=5.4)


def curves_figure(curves: Sequence[LearningCurve]) -> style.Drawing:
    """One panel per network: held-out samples over training samples."""
    across = min(ACROSS, len(curves))
    down = -(-len(curves) // across)
    width = max(style.TWO_COLUMNS_IN * across / ACROSS, style.ONE_COLUMN_IN)
    figure = style.new_figure(width, 1.75 * down + 0.1)
    panels = np.ravel(figure.subplots(down, across, squeeze=False))
    for axes in panels[len(curves) :]:
        axes.set_axis_off()
    tables, words = [], []
    for axes, one in zip(panels, curves, strict=False):
        _panel(axes, one)
        for samples, values in (("held out", one.held_out()), ("training", one.training())):
            if values is not None:
                head = {"network": one.name, "measure": one.measure, "samples": samples}
                tables.append(pd.DataFrame({"step": values.index, "value": values.to_numpy()}).assign(**head))
        value = f"{one.at_release(HELD_OUT + one.measure):.3g} {one.unit}".strip()
        words.append(
            {
                "title": network_title(one),
                "measure": measure_title(one),
                "value": value,
                "steps": one.chosen or one.steps,
            }
        )
    alt = PAGE.alt("learning_curves", words)
    return style.Drawing(figure, alt, pd.concat(tables)[["network", "measure", "samples", "step", "value"]])


def _networks(curves: Sequence[LearningCurve]) -> Table:
    def squared(one: LearningCurve) -> Estimate | None:
        error = one.at_release(f"{HELD_OUT}mean_squared_error")
        return None if math.isnan(error) else Estimate(error, reference=PAPER_SQUARED_ERROR.get(one.name))

    def parameters(one: LearningCurve) -> Estimate | int | None:
        paper = PAPER_PARAMETERS.get(one.name)
        return Estimate(one.parameters, reference=paper) if paper and one.parameters else one.parameters

    rows = [
        {
            "network": network_title(one), "parameters": parameters(one), "steps": one.steps, "released": one.chosen,
            "samples": None if one.samples is None else one.steps * one.samples, "measure": measure_heading(one),
            "released_samples": training_budget.released_samples(one),
            "held_out": one.at_release(HELD_OUT + one.measure), "squared": squared(one),
            "training": None if one.training() is None else one.at_release(one.measure),
            "device": None if one.device is None else "processor" if one.device == "cpu" else "GPU",
        }
        for one in curves
    ]  # fmt: skip
    return PAGE.table("training", rows)


def ablation(inputs: ReportInputs, curves: Sequence[LearningCurve]) -> Table | None:
    """Shorter trainings of the blur network with one thing changed, and with other seeds; None where none was run.

    Args:
        inputs: of the report.
        curves: of all networks; that of the released training of the blur network stands first.
    """
    folder = existing(inputs.ablation)
    names = list(inputs.ablations) or sorted(path.stem for path in (folder.glob("*.json") if folder else ()))
    measures = {name: optional(folder, f"{name}.json") for name in names}
    rows = [{"variant": name, **group} for name, group in measures.items() if group is not None]
    if not rows:
        return None
    seeds = [row["mtf_error_percent"] for row in rows if row["variant"] in SEEDS]
    spread = max(seeds) - min(seeds) if seeds else 0.0
    released = next((one for one in curves if one.name == CHANGED), None)
    if released is not None:
        columns = [column for column in map(str, released.curve) if column.startswith(HELD_OUT)]
        full = {column.removeprefix(HELD_OUT): released.at_release(column) for column in columns}
        rows.insert(0, {"variant": "released", **full})
    return PAGE.table("ablation", rows, also=["seeds"] if len(seeds) > 1 else [], spread=spread)


def section(inputs: ReportInputs) -> Section:
    """Every network with a learning curve beside its weights."""
    curves = read(inputs.weights)
    compared = ablation(inputs, curves)
    names, blocks = [one.name for one in curves], list[Block | None]()
    runs = [single(f"Training, {network_title(one)}", stage_of(one.name), True, inputs) for one in curves]
    if curves:
        stages = [stage_of(name) for name in names]
        blocks += [PAGE.figure("learning_curves", curves_figure(curves), stages), _networks(curves)]
    if compared is not None:
        runs.append(single("Ablation of the training", "ablation", True, inputs))
    absent = [
        single(f"Training of {name.replace('_', ' ')}", stage_of(name), False, inputs)
        for name in EXPECTED if name not in names
    ]  # fmt: skip
    return PAGE.section([*blocks, compared], [*runs, *absent])
