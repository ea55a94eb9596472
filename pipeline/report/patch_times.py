"""Processor times of the estimators a patch, as a benchmark recorded them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

from pipeline.report.inputs import Benchmark, ReportInputs

TIMED = Benchmark("estimators", "python benchmarks/estimators.py", ("machine", "results", "frame_px", "patch_px"))
TASKS = {"blur": "Blur", "noise": "Noise"}
PUBLISHED = {
    ("blur", "cnn"): "cnn_mtf", ("blur", "pmp"): "pmp", ("blur", "gbb"): "gbb", ("blur", "pmp_exact"): "pmp",
    ("blur", "gbb_exact"): "gbb", ("noise", "cnn"): "cnn_sigma", ("noise", "pca"): "pca", ("noise", "bf"): "bf",
}  # fmt: skip
"""The paper's names of its estimators. Its blur network counts a batch of four patches."""

TIMES = [
    "task", "estimator", "name", "patch_px", "one_ms", "batched_ms", "preprocessing_ms", "untrained", "clock_fps",
    "processor_fps",
]  # fmt: skip
"""Columns of `patch_times`."""


def patch_times(inputs: ReportInputs) -> pd.DataFrame:
    """Processor times of every estimator of the record, one thread; empty without a record.

    Errors of `ReportInputs.benchmark`.

    Returns:
        task, estimator, name (the paper's), patch_px, one_ms and batched_ms (medians per patch, alone and among many),
        preprocessing_ms (per patch, of a network that was timed apart; None else), untrained, clock_fps and
        processor_fps (whole frames per second of two processes; None where not timed).
    """
    times = inputs.benchmark(TIMED, times_of)
    return pd.DataFrame(columns=TIMES, dtype=object) if times is None else times


def times_of(record: Mapping[str, Any]) -> pd.DataFrame:
    """Those of one record; see `patch_times`."""
    rows: list[tuple[Any, ...]] = []
    for task in TASKS:
        for name, entry in record["results"].get(task, {}).items():
            one, batched = (entry[key]["processor_median_ms"] for key in ("one_patch", "batched"))
            frame = entry.get("frame") or {}
            before = entry.get("preprocessing", {}).get("processor_median_ms")
            head = (task, name, PUBLISHED.get((task, name), ""), record["patch_px"][task], one, batched, before)
            untrained = entry.get("weights") == "untrained"
            rows.append((*head, untrained, frame.get("clock_fps"), frame.get("processor_fps")))
    return pd.DataFrame(rows, columns=TIMES, dtype=object)
