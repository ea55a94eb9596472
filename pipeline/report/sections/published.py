"""Sections that follow the paper's remaining tables and figures: ours where a result exists, else what would run it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pipeline.report.inputs import ReportInputs
from pipeline.report.ledger import NOT_RUN, LedgerRow, to_table
from pipeline.report.ledger_items import ITEMS
from pipeline.report.sections.base import Block, NotRun, Run, Section
from pipeline.report.wording import counted


@dataclass(frozen=True)
class Chapter:
    """A part of the paper whose numbers the ledger holds.

    Attributes:
        key: anchor of the section.
        title: heading.
        items: names of ledger items, in order.
        pictures: what the paper prints there as pictures only -> the stage that makes ours.
    """

    key: str
    title: str
    items: tuple[str, ...]
    pictures: tuple[tuple[str, str], ...] = ()


AFTER_NOISE = (
    Chapter(
        "combined",
        "Blur and noise at once",
        ("photon_defocus_amae", "photon_linear_motion_mtf", "improved_blur"),
    ),
    Chapter(
        "detection",
        "Object detection under blur and noise",
        ("yolov7_direction_ap", "regression_coefficients", "fitted_ap_grid"),
    ),
    Chapter("control", "Camera control", ("worked_examples", "controller_ap", "controller_response")),
)


def section(chapter: Chapter, rows: Sequence[LedgerRow], inputs: ReportInputs) -> Section:
    """One chapter: a table of ours beside the paper's for each item that ran, a note for each that did not.

    Args:
        chapter: which part of the paper.
        rows: the whole ledger.
        inputs: of the report.
    """
    titles = {item.name: item for item in ITEMS}
    blocks: list[Block] = []
    runs: list[Run] = []
    for name in chapter.items:
        item = titles[name]
        own = [row for row in rows if row.item == name]
        done = [row for row in own if row.verdict != NOT_RUN]
        missing = [row for row in own if row.verdict == NOT_RUN]
        line = inputs.line(item.stage.replace("{", "<").replace("}", ">"))
        why = "stage absent"
        if missing and missing[0].why:  # of all, the first stands for the item
            why, line = missing[0].why, missing[0].line or line
        if done:
            blocks.append(to_table(done, f"published_{name}", f"{item.title}: the paper's numbers beside ours."))
        if missing:
            what = f"{item.title} ({counted(len(missing), 'published number')})"
            blocks.append(NotRun(what, why, line))
        partly = f"{len(done):,} of {len(own):,} numbers" if done and missing else ""
        runs.append(Run(item.title, "", bool(done), partly or ("" if done else why), line))
    for what, stage in chapter.pictures:
        blocks.append(NotRun(f"{what} (printed as pictures only)", "stage absent", inputs.line(stage)))
        runs.append(Run(what, "", False, "stage absent", inputs.line(stage)))
    return Section(chapter.key, chapter.title, (), blocks, runs)
