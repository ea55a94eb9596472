"""The section of training: learning curves, budget, size and held-out error of every network that was trained."""

from __future__ import annotations

import math

from pipeline.report import ablation_table, learning_figure
from pipeline.report.inputs import ReportInputs
from pipeline.report.learning_curves import HELD_OUT, LearningCurve, read
from pipeline.report.sections.base import Block, NotRun, Run, Section, ShownFigure
from pipeline.report.tables import Cell, Column, Estimate, Table

TEXT = (
    "Networks are trained here from scratch, on pictures made by procedures: no photograph and no frame of any dataset "
    "of this report is among them. Held-out samples share no picture, kernel or draw of noise with those trained on."
)
STAGES = {"mtf": "train_mtf@{network}", "sigma": "train_sigma@{network}", "detector": "train_detector@{network}"}
EXPECTED = ("mtf_spectral", "sigma_cellwise", "detector_compact")
PAPER_PARAMETERS = {"mtf_cnn": 6_757_384, "sigma_cnn": 519_361}
"""Of the paper's two networks, counted in its program."""

PAPER_SQUARED_ERROR = {"mtf_cnn": 0.0083}
"""Best validation MSE in the log of the paper's training, 47 of 51 epochs of 160,500 samples less 15 % held out."""


def stage_of(name: str) -> str:
    """The stage that trains a network, e.g. ``train_mtf@spectral``."""
    task, _, network = name.partition("_")
    return STAGES.get(task, "train_{task}@{network}").format(task=task, network=network)


def _row(one: LearningCurve) -> dict[str, Cell]:
    steps = one.steps
    squared = one.at_release(f"{HELD_OUT}mean_squared_error")
    paper = PAPER_SQUARED_ERROR.get(one.name)
    parameters: Cell = one.parameters
    if one.parameters is not None and one.name in PAPER_PARAMETERS:
        parameters = Estimate(one.parameters, reference=PAPER_PARAMETERS[one.name])
    measure = f"{one.measure_title} [{one.unit}]" if one.unit else one.measure_title
    return {
        "network": one.title,
        "parameters": parameters,
        "steps": steps,
        "samples": None if one.samples is None else steps * one.samples,
        "released": one.chosen,
        "measure": measure,
        "held_out": one.at_release(HELD_OUT + one.measure),
        "training": None if one.training() is None else one.at_release(one.measure),
        "squared": Estimate(squared, reference=paper) if math.isfinite(squared) else None,
    }


def _table(curves: list[LearningCurve]) -> Table:
    columns = [
        Column("network", "Network"),
        Column("parameters", "Parameters"),
        Column("steps", "Steps"),
        Column("samples", "Samples seen"),
        Column("released", "Released step"),
        Column("measure", "Judged by"),
        Column("held_out", "Held out"),
        Column("training", "Training"),
        Column("squared", "Held out, mean squared error"),
    ]
    notes = [
        "Samples seen: a sample shown twice counts twice. Held out and training: at the released step; training is the "
        "mean since the row before. The paper's blur network reached a mean squared error of 0.0083 on its own "
        "held-out samples (photographs, without noise, on a GPU); ours are other pictures, so that the two numbers "
        "stand beside each other without being a contest."
    ]
    return Table(
        "training",
        "Networks trained.",
        columns,
        [_row(one) for one in curves],
        notes,
        "train_mtf, train_sigma, train_detector",
    )


def section(inputs: ReportInputs) -> Section:
    """Every network whose learning curve lies beside its weights."""
    curves = read(inputs.weights)
    there = [one.name for one in curves]
    blocks: list[Block] = []
    runs = [Run(f"Training, {one.title}", "", True, "", inputs.line(stage_of(one.name))) for one in curves]
    if curves:
        caption = (
            "Learning curves. Coloured: on samples held out; grey: on those trained on, mean since the row before. The "
            "point marks the weights released, which are those that did best on held-out samples."
        )
        stages = tuple(stage_of(name) for name in there)
        blocks += [ShownFigure("learning_curves", learning_figure.draw(curves), caption, stages), _table(curves)]
    compared = ablation_table.table(inputs.ablation, inputs.ablations)
    if compared is not None:
        blocks.append(compared)
        runs.append(Run("What matters in training", "", True, "", inputs.line("ablation")))
    for name in EXPECTED:
        if name not in there:
            line = inputs.line(stage_of(name))
            title = name.replace("_", " ")
            blocks.append(NotRun(f"Training of {title}", "stage absent", line))
            runs.append(Run(f"Training, {title}", "", False, "stage absent", line))
    return Section("training", "Training", (TEXT,), blocks, runs)
