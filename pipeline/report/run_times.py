"""Run times as a benchmark recorded them on a named machine (``benchmarks/results/estimators.json``).

They are measured by an explicit call and committed, not by a stage: a time that changed with every run would make every
report another one. The report only reads the record.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.errors import InputError
from pipeline.report.inputs import benchmark_record

LINE = "python benchmarks/estimators.py"
TASKS = ("blur", "noise")


@dataclass(frozen=True)
class PatchTime:
    """One estimator on single patches, one thread.

    Attributes:
        task: ``"blur"`` or ``"noise"``.
        estimator: its name.
        one_ms, batched_ms: median processor time per patch, alone and among many.
        untrained: its weights are fresh ones.
        clock_fps, processor_fps: whole frames per second of two processes, on the clock and by processor time; None
            where no whole frame was timed.
        patches: of a whole frame.
    """

    task: str
    estimator: str
    one_ms: float
    batched_ms: float
    untrained: bool
    clock_fps: float | None
    processor_fps: float | None
    patches: int


def record(path: Path | None) -> Mapping[str, Any] | None:
    """The benchmark's record, or None where it was not made.

    Raises:
        InputError: the file holds something else.
    """
    return benchmark_record(path, {"machine", "results", "frame_px", "patch_px"}, LINE)


def patch_times(path: Path | None) -> list[PatchTime]:
    """Every estimator of the record, blur first; empty without a record.

    Raises:
        InputError: the file holds something else.
    """
    content = record(path)
    found = []
    for task in TASKS if content is not None else ():
        for name, entry in (content or {})["results"].get(task, {}).items():
            try:
                one, batched = (entry[key]["processor_median_ms"] for key in ("one_patch", "batched"))
            except (KeyError, TypeError):
                raise InputError(f"{path}: no times of '{name}'; make the record again: {LINE}") from None
            frame = entry.get("frame") or {}
            fps = (frame.get("clock_fps"), frame.get("processor_fps"), int(frame.get("patches", 0)))
            found.append(PatchTime(task, name, one, batched, entry.get("weights") == "untrained", *fps))
    return found
