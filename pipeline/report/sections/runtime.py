"""The section of run times: estimators per patch and per frame on a named machine, the paper's beside them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pipeline.report.inputs import ReportInputs, any_table, existing, records
from pipeline.report.run_times import LINE, TASKS, PatchTime, patch_times, record
from pipeline.report.sections.base import Block, NotRun, Run, Section
from pipeline.report.tables import Cell, Column, Table
from pipeline.report.wording import ESTIMATORS, in_order, word

# The paper's names for its estimators.
PUBLISHED = {
    ("blur", "cnn"): "cnn_mtf", ("blur", "pmp"): "pmp", ("blur", "gbb"): "gbb", ("noise", "cnn"): "cnn_sigma",
    ("noise", "pca"): "pca", ("noise", "bf"): "bf",
}  # fmt: skip
ASKED_FPS = {("blur", "spectral"): 5.0, ("noise", "cellwise"): 10.0}
"""Whole frames per second that this project asks of its own estimators on two cores."""


def _paper(inputs: ReportInputs) -> dict[str, float]:
    """Published milliseconds per patch; the paper's blur network counts a batch of four."""
    path = existing(inputs.paper / "runtime.csv")
    found = {} if path is None else {str(row["estimator"]): row for row in records(any_table(path))}
    return {
        name: 1e3 * float(row["seconds"]) / (4 if str(row["unit"]).startswith("batch of 4") else 1)
        for name, row in found.items()
    }


def _machine(content: Mapping[str, Any]) -> str:
    """One sentence on what was measured where."""
    machine, packages = content["machine"], content["machine"].get("packages", {})
    versions = ", ".join(f"{name} {version}" for name, version in sorted(packages.items()) if version)
    return (
        f"{machine.get('processor')}, {machine.get('cores')} cores, load {machine.get('load')} at the end, "
        f"Python {machine.get('python')}, {versions}."
    )


def _ordered(times: list[PatchTime]) -> list[PatchTime]:
    order = in_order((time.estimator for time in times), ESTIMATORS)
    return sorted(times, key=lambda time: (TASKS.index(time.task), order.index(time.estimator)))


def _table(times: list[PatchTime], content: Mapping[str, Any], inputs: ReportInputs) -> Table:
    paper, sides = _paper(inputs), content["patch_px"]
    rows: list[dict[str, Cell]] = []
    for time in _ordered(times):
        published = paper.get(PUBLISHED.get((time.task, time.estimator), ""))
        rows.append(
            {
                "task": "Blur" if time.task == "blur" else "Noise",
                "estimator": word(time.estimator) + (" (untrained)" if time.untrained else ""),
                "patch_px": sides[time.task],
                "one_ms": time.one_ms,
                "batched_ms": time.batched_ms,
                "paper_ms": published,
                "ratio": None if published is None else published / time.one_ms,
                "processor_fps": time.processor_fps,
                "clock_fps": time.clock_fps,
                "asked_fps": ASKED_FPS.get((time.task, time.estimator)),
            }
        )
    columns = [
        Column("task", "Of"),
        Column("estimator", "Estimator"),
        Column("patch_px", "Patch", "px"),
        Column("one_ms", "One patch", "ms"),
        Column("batched_ms", "Batched, per patch", "ms"),
        Column("paper_ms", "Paper, per patch", "ms"),
        Column("ratio", "Paper over ours"),
        Column("processor_fps", "Frames a second, two free cores"),
        Column("clock_fps", "The same on the clock"),
        Column("asked_fps", "Asked of ours"),
    ]
    width, height = content["frame_px"]
    joint = content["results"].get("joint", {})
    notes = [
        f"Measured on: {_machine(content)} One thread a process; median processor times, which other programs on the "
        "machine hardly enter.",
        f"A frame is {width} x {height} px with its whole grid of patches, by two processes at a time. Free cores: two "
        "over the processor time of a frame. On the clock: beside all else that ran at the time.",
        "The paper's times are of a Xeon W-2145 with a Quadro RTX 6000; a batch of its blur network is four patches.",
    ]
    notes += [
        f"Blur, noise and maps of a frame in one call ({name}): {entry['frame']['processor_fps']:g} frames a second on "
        f"two free cores, {entry['frame']['clock_fps']:g} on the clock."
        for name, entry in joint.items()
    ]
    if any(time.untrained for time in times):
        notes.append("Untrained: with fresh weights, which cost what trained ones do.")
    return Table("runtime", "Run times of the estimators.", columns, rows, notes)


def section(inputs: ReportInputs) -> Section:
    """Run times as recorded; the ledger holds the paper's too, as not comparable across hardware."""
    title = "Run times"
    content = record(inputs.runtime)
    if content is None:
        run = Run(title, "", False, "stage absent", LINE)
        return Section("runtime", title, (), [NotRun(title, "stage absent", LINE)], [run])
    text = f"Recorded by {LINE}, not by a stage, so that a report is the same bytes on a slow and on a fast day."
    blocks: list[Block] = [_table(patch_times(inputs.runtime), content, inputs)]
    return Section("runtime", title, (text,), blocks, [Run(title, "", True, "", LINE)])
