"""Run times of the estimators on a named machine, the paper's beside them.

They are measured by an explicit call of a benchmark and committed, not by a stage: a time that changed with every run
would change every report. The report only reads the record (``benchmarks/results/estimators.json``).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

from pipeline.errors import InputError
from pipeline.report.descriptions import Descriptions
from pipeline.report.display_names import ESTIMATORS, word
from pipeline.report.inputs import ReportInputs, published_table
from pipeline.report.spec import STAGE_ABSENT, Run, Section
from pipeline.report.tables import Table, ordered, records

PAGE = Descriptions("runtime")
COMMAND = "python benchmarks/estimators.py"
TITLE = "Run times"
TASKS = {"blur": "Blur", "noise": "Noise"}
PUBLISHED = {
    ("blur", "cnn"): "cnn_mtf", ("blur", "pmp"): "pmp", ("blur", "gbb"): "gbb", ("blur", "pmp_exact"): "pmp",
    ("blur", "gbb_exact"): "gbb", ("noise", "cnn"): "cnn_sigma", ("noise", "pca"): "pca", ("noise", "bf"): "bf",
}  # fmt: skip
"""The paper's names of its estimators. Its blur network counts a batch of four patches."""

REQUIRED_FPS = {("blur", "spectral"): 5.0, ("noise", "cellwise"): 10.0}
"""Whole frames per second that this project requires of its own estimators on two cores."""


TIMES = [
    "task", "estimator", "name", "patch_px", "one_ms", "batched_ms", "preprocessing_ms", "untrained", "clock_fps",
    "processor_fps",
]  # fmt: skip
"""Columns of `patch_times`."""


def record(inputs: ReportInputs) -> Mapping[str, Any] | None:
    """The benchmark's record, or None where it was not made.

    Raises:
        InputError: the file holds something else.
    """
    content: Mapping[str, Any] | None = inputs.benchmark(
        "estimators", ("machine", "results", "frame_px", "patch_px"), COMMAND
    )
    return content


def patch_times(inputs: ReportInputs) -> pd.DataFrame:
    """Processor times of every estimator of the record, one thread; empty without a record.

    Returns:
        task, estimator, name (the paper's), patch_px, one_ms and batched_ms (medians per patch, alone and among many),
        preprocessing_ms (per patch, of a network that was timed apart; None else), untrained, clock_fps and
        processor_fps (whole frames per second of two processes; None where not timed).

    Raises:
        InputError: the file holds something else.
    """
    content = record(inputs) or {"results": {}}
    rows: list[tuple[Any, ...]] = []
    for task in TASKS:
        for name, entry in content["results"].get(task, {}).items():
            try:
                one, batched = (entry[key]["processor_median_ms"] for key in ("one_patch", "batched"))
            except (KeyError, TypeError):
                where = inputs.benchmarks["estimators"]
                raise InputError(f"{where}: no times of '{name}'; make the record again: {COMMAND}") from None
            frame = entry.get("frame") or {}
            before = entry.get("preprocessing", {}).get("processor_median_ms")
            head = (task, name, PUBLISHED.get((task, name), ""), content["patch_px"][task], one, batched, before)
            untrained = entry.get("weights") == "untrained"
            rows.append((*head, untrained, frame.get("clock_fps"), frame.get("processor_fps")))
    return pd.DataFrame(rows, columns=TIMES, dtype=object)


def _paper_ms(inputs: ReportInputs) -> dict[str, float]:
    """Published milliseconds per patch; the paper's blur network counts a batch of four."""
    last = {str(row["estimator"]): row for row in records(published_table(inputs.paper / "runtime.csv"))}
    return {
        name: 1e3 * float(row["seconds"]) / (4 if str(row["unit"]).startswith("batch of 4") else 1)
        for name, row in last.items()
    }


def _table(content: Mapping[str, Any], inputs: ReportInputs) -> Table:
    paper = _paper_ms(inputs)
    times = ordered(patch_times(inputs), task=TASKS, estimator=ESTIMATORS)
    cells = {
        "task": lambda row: TASKS[row["task"]],
        "estimator": lambda row: word(row["estimator"]) + (" (untrained)" if row["untrained"] else ""),
        "paper_ms": lambda row: paper.get(row["name"]),
        "ratio": lambda row: paper[row["name"]] / row["one_ms"] if row["name"] in paper else None,
        "asked_fps": lambda row: REQUIRED_FPS.get((row["task"], row["estimator"])),
    }
    about, packages = content["machine"], content["machine"].get("packages", {})
    versions = ", ".join(f"{name} {version}" for name, version in sorted(packages.items()) if version)
    machine = (
        f"{about.get('processor')}, {about.get('cores')} cores, load {about.get('load')} at the end, Python "
        f"{about.get('python')}, {versions}"
    )
    width, height = content["frame_px"]
    notes = [
        f"Blur, noise and maps of a frame in one call ({name}): {entry['frame']['processor_fps']:g} frames a second on "
        f"two free cores, {entry['frame']['clock_fps']:g} on the clock."
        for name, entry in content["results"].get("joint", {}).items()
    ]
    if times["untrained"].any():
        notes.append("Untrained: with fresh weights, which take as long as trained ones.")
    return PAGE.table("runtime", times, cells=cells, notes=notes, machine=machine, width=width, height=height)


def section(inputs: ReportInputs) -> Section:
    """Run times as recorded; the ledger holds the paper's too, as not comparable across hardware."""
    content = record(inputs)
    run = Run(TITLE, "", content is not None, "" if content is not None else STAGE_ABSENT, COMMAND)
    return PAGE.section([_table(content, inputs)] if content else [], [run], command=COMMAND)
