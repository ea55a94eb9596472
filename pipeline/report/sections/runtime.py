"""Run times of the estimators on a named machine, the paper's beside them.

They are measured by an explicit call of a benchmark and committed, not by a stage: a time that changed with every run
would change every report. The report only reads the record (``benchmarks/results/estimators.json``).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pipeline.condition.frame_tiles import MOST_PATCHES, MOST_TILES
from pipeline.report.descriptions import Descriptions
from pipeline.report.display_names import ESTIMATORS, word
from pipeline.report.inputs import ReportInputs, published_table
from pipeline.report.patch_times import TASKS, TIMED, times_of
from pipeline.report.spec import STAGE_ABSENT, Run, Section, of_benchmark
from pipeline.report.tables import Table, ordered, records

PAGE = Descriptions("runtime")
TITLE = "Run times"
NAMES = {"fused": "Fused, not calibrated"}
"""Estimators that are timed in another way than they stand in the other tables."""

REQUIRED_FPS = {("blur", "spectral"): 5.0, ("noise", "adaptive"): 10.0}
"""Whole frames per second that this project requires of its own estimators on two cores."""


def _paper_ms(inputs: ReportInputs) -> dict[str, float]:
    """Published milliseconds per patch; the paper's blur network counts a batch of four."""
    last = {str(row["estimator"]): row for row in records(published_table(inputs.paper / "runtime.csv"))}
    return {
        name: 1e3 * float(row["seconds"]) / (4 if str(row["unit"]).startswith("batch of 4") else 1)
        for name, row in last.items()
    }


def _table(record: Mapping[str, Any], paper: Mapping[str, float]) -> Table:
    times = ordered(times_of(record), task=TASKS, estimator=ESTIMATORS)
    cells = {
        "task": lambda row: TASKS[row["task"]],
        "estimator": lambda row: (
            NAMES.get(row["estimator"], word(row["estimator"])) + (" (untrained)" if row["untrained"] else "")
        ),
        "paper_ms": lambda row: paper.get(row["name"]),
        "ratio": lambda row: paper[row["name"]] / row["one_ms"] if row["name"] in paper else None,
        "asked_fps": lambda row: REQUIRED_FPS.get((row["task"], row["estimator"])),
    }
    about, packages = record["machine"], record["machine"].get("packages", {})
    versions = ", ".join(f"{name} {version}" for name, version in sorted(packages.items()) if version)
    machine = (
        f"{about.get('processor')}, {about.get('cores')} cores, load {about.get('load')} at the end, Python "
        f"{about.get('python')}, {versions}"
    )
    width, height = record["frame_px"]
    notes = [
        f"Blur, noise and maps of a frame in one call ({name}), on an even selection of at most {MOST_TILES} tiles and "
        f"{MOST_PATCHES} patches: {entry['frame']['processor_fps']:g} frames a second on two free cores, "
        f"{entry['frame']['clock_fps']:g} on the clock."
        for name, entry in record["results"].get("joint", {}).items()
    ]
    if times["untrained"].any():
        notes.append("Untrained: with fresh weights, which take as long as trained ones.")
    return PAGE.table("runtime", times, cells=cells, notes=notes, machine=machine, width=width, height=height)


def section(inputs: ReportInputs) -> Section:
    """Run times as recorded; the ledger holds the paper's too, as not comparable across hardware."""
    paper = _paper_ms(inputs)
    table = inputs.benchmark(TIMED, lambda record: _table(record, paper))
    if table is None:
        return PAGE.section([], [Run(TITLE, "", False, STAGE_ABSENT, TIMED.command)], command=TIMED.command)
    tables, run = of_benchmark(TITLE, TIMED, [table])
    return PAGE.section(tables, [run], command=TIMED.command)
