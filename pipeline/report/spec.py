"""How to describe a part of the report: a section is a list of figures, tables and notes on what did not run.

To add a table, a figure and a section, describe their captions, columns and notes in a YAML file beside the section
(`pipeline.report.descriptions`), write one module in `pipeline.report.sections` that makes their numbers, and name its
function in `pipeline.report.build.SECTIONS`::

    PAGE = Descriptions("control")  # pipeline/report/texts/control.yaml

    def section(inputs: ReportInputs) -> Section:
        summary = inputs.read("closed_loop/summary.parquet", SUMMARY)  # None where the stage has not run
        runs = overview("Camera control", "closed_loop@{dataset}", [] if summary is None else ["sim"], inputs)
        if summary is None:
            return PAGE.section([], runs)  # shows what did not run, with its command
        drawing, table = figure(summary), PAGE.table("control_ap", summary)
        return PAGE.section([PAGE.figure("control_ap", drawing, ["closed_loop@sim"]), table], runs)

`pipeline.report.tables` defines cells (intervals, counts, the paper's values), `pipeline.report.figures` small
multiples (``figure`` above), ``ledger/ledger.yaml`` published numbers, ``claims/claims.yaml`` the paper's claims. Files
in ``tables/`` and ``figures/``, the page, alternative text, provenance and the overview of what ran follow from these
descriptions.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import pandas as pd

from pipeline.report.display_names import DATASETS, DETECTORS, ESTIMATORS, in_order, word
from pipeline.report.inputs import Benchmark, ReportInputs
from pipeline.report.style import Drawing
from pipeline.report.tables import Table


@dataclass(frozen=True)
class Figure:
    """A figure on the page: stem of its files and anchor, drawing, caption, the DVC stages whose outputs it shows."""

    name: str
    drawing: Drawing
    caption: str
    stages: tuple[str, ...] = ()


@dataclass(frozen=True)
class NotRun:
    """Something the page would show if it had been run; why it was not, e.g. ``"data absent"``, and the command."""

    title: str
    why: str
    line: str


@dataclass(frozen=True)
class Run:
    """One line of the overview: an experiment on a dataset, whether it ran, else why not, and the command that runs it.

    An experiment may belong to no dataset. ``recorded``: measured earlier, on pictures that are not kept or by a
    benchmark.
    """

    experiment: str
    dataset: str
    ran: bool
    why: str
    line: str
    recorded: bool = False

    @property
    def state(self) -> str:
        """``"ran"``, ``"recorded"`` or ``"absent"``."""
        return "ran" if self.ran else "recorded" if self.recorded else "absent"


Block = Figure | Table | NotRun
STAGE_ABSENT = "stage absent"


@dataclass(frozen=True)
class Section:
    """A section of the page: anchor, heading, paragraphs, and then figures, tables and notes of absence.

    ``runs`` are its lines of the overview, ``findings`` sentences of the verdict, built from its numbers.
    """

    key: str
    title: str
    text: Sequence[str] = ()
    blocks: Sequence[Block] = ()
    runs: Sequence[Run] = field(default=())
    findings: Sequence[str] = field(default=())


def as_recorded(shown: Figure | Table, *notes: str, prefix: str = "", count: str = "") -> Figure | Table:
    """A figure or table of pictures measured earlier that are not kept, marked so in its name and caption.

    ``notes`` are further ones of a table, ``prefix`` stands before its name, ``count`` is of the pictures in words.
    """
    name, caption = f"recorded_{prefix}{shown.name}", f"Recorded{count and f', {count}'}: {shown.caption}"
    if isinstance(shown, Table):
        return replace(shown, name=name, caption=caption, stage="", footnotes=(*shown.footnotes, *notes))
    return replace(shown, name=name, caption=caption, stages=())


def overview(
    experiment: str,
    stage: str,
    ran: Iterable[str],
    inputs: ReportInputs,
    datasets: Sequence[str] | None = None,
    recorded: Iterable[str] = (),
) -> list[Run]:
    """The overview's lines of one experiment, over every dataset of the report.

    ``stage`` names its stage, with ``{dataset}``; ``datasets`` are those that it could run on, all of the report by
    default; those that it was recorded on are listed in any case.
    """
    done, known = set(ran), set(recorded)
    names = inputs.datasets if datasets is None else list(datasets)
    runs = []
    for dataset in [*names, *in_order(known - set(names), DATASETS)]:
        absent = None if dataset in done else inputs.absent.get(dataset)
        why = "" if dataset in done else "data absent" if absent else STAGE_ABSENT
        line = absent or inputs.line(stage.format(dataset=dataset))
        runs.append(Run(experiment, dataset, dataset in done, why, line, dataset in known))
    return runs


def pairs_of(table: pd.DataFrame) -> set[tuple[str, str]]:
    """Pairs of dataset and estimator in a table."""
    return {(str(dataset), str(name)) for dataset, name in zip(table["dataset"], table["estimator"], strict=True)}


def runs_by_estimator(
    title: str,
    stage: str,
    ran: Iterable[tuple[str, str]],
    inputs: ReportInputs,
    *,
    recorded: Iterable[tuple[str, str]] = (),
    names: Iterable[str] = (),
    datasets: Sequence[str] | None = None,
) -> list[Run]:
    """The overview's lines of an experiment by estimator or detector, over every dataset of the report.

    ``stage`` names its group of stages; pairs are of dataset and estimator; ``names`` are those listed in any case,
    ``datasets`` as of `overview`.
    """
    done, known = list(ran), list(recorded)
    listed = in_order([*names, *(name for _, name in [*done, *known])], [*ESTIMATORS, *DETECTORS]) or ["<estimator>"]
    runs = []
    for listed_name in listed:
        of_name = [[dataset for dataset, name in pairs if name == listed_name] for pairs in (done, known)]
        experiment, member = f"{title} by {word(listed_name)}", f"{stage}@{{dataset}}-{listed_name}"
        runs += overview(experiment, member, of_name[0], inputs, datasets, of_name[1])
    return runs


def single(experiment: str, stage: str, ran: bool, inputs: ReportInputs) -> Run:
    """The overview's line of an experiment that belongs to no dataset."""
    return Run(experiment, "", ran, "" if ran else STAGE_ABSENT, inputs.line(stage))


def of_benchmark(experiment: str, benchmark: Benchmark, tables: Iterable[Table]) -> tuple[list[Table], Run]:
    """Tables of a benchmark's record, which no stage makes, with its command, and their line of the overview."""
    run = Run(experiment, "", False, "", benchmark.command, recorded=True)
    return [replace(table, stage=benchmark.command) for table in tables], run


def missing(title: str, runs: Sequence[Run]) -> list[NotRun]:
    """One note for each dataset and command of runs that are absent.

    ``title`` is of the section, which stands for every run where the data are absent.
    """
    notes: dict[tuple[str, str], NotRun] = {}
    for run in runs:
        if run.state == "absent":
            name = title if run.why == "data absent" else run.experiment
            on = f" on {word(run.dataset)}" if run.dataset else ""
            notes.setdefault((run.dataset, run.line), NotRun(f"{name}{on}", run.why, run.line))
    return list(notes.values())
