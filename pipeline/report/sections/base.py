"""What a section of the page is made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from pipeline.report.inputs import ReportInputs
from pipeline.report.style import Drawing
from pipeline.report.tables import Table
from pipeline.report.wording import word


@dataclass(frozen=True)
class ShownFigure:
    """A figure with its place on the page.

    Attributes:
        name: stem of its files, and its anchor.
        drawing: the figure, its alternative text and values.
        caption: a short title and what to look for.
        stages: the DVC stages whose outputs it shows.
    """

    name: str
    drawing: Drawing
    caption: str
    stages: tuple[str, ...] = ()


@dataclass(frozen=True)
class NotRun:
    """Something the page would show if it had been run.

    Attributes:
        what: the figure, table or dataset.
        why: ``"data absent"`` or ``"stage absent"``.
        line: the command that would run it.
    """

    what: str
    why: str
    line: str


@dataclass(frozen=True)
class Run:
    """One line of the overview: an experiment on a dataset, and whether it ran."""

    experiment: str
    dataset: str
    ran: bool
    why: str
    line: str


Block = ShownFigure | Table | NotRun


@dataclass(frozen=True)
class Section:
    """A section of the page.

    Attributes:
        key: anchor.
        title: heading.
        text: paragraphs before the blocks.
        blocks: figures, tables and notes of absence, in order.
        runs: what the overview says about it.
    """

    key: str
    title: str
    text: Sequence[str] = ()
    blocks: Sequence[Block] = ()
    runs: Sequence[Run] = field(default=())


def overview(experiment: str, stage: str, ran: Sequence[str], inputs: ReportInputs) -> list[Run]:
    """The overview's lines of one experiment, over every dataset of the report.

    Args:
        experiment: in words.
        stage: name of its stage, with ``{dataset}``.
        ran: datasets it ran on.
        inputs: of the report.
    """
    lines = []
    for dataset in inputs.datasets:
        if dataset in ran:
            lines.append(Run(experiment, dataset, True, "", inputs.line(stage.format(dataset=dataset))))
        elif dataset in inputs.absent:
            lines.append(Run(experiment, dataset, False, "data absent", inputs.absent[dataset]))
        else:
            lines.append(Run(experiment, dataset, False, "stage absent", inputs.line(stage.format(dataset=dataset))))
    return lines


def missing(what: str, runs: Sequence[Run]) -> list[NotRun]:
    """Notes for the datasets of an experiment that did not run."""
    return [NotRun(f"{what} on {word(run.dataset)}", run.why, run.line) for run in runs if not run.ran]
