"""How well estimates rank frames by blur and noise, beside the measures in common use, as a benchmark recorded it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pipeline.report.descriptions import Descriptions
from pipeline.report.inputs import Benchmark, ReportInputs
from pipeline.report.spec import Section
from pipeline.report.tables import Estimate, Table

PAGE = Descriptions("frame_ranking")
FLAGS = Benchmark("flags", "python benchmarks/flags.py", ("results",))
TITLE = "Ranking of frames by blur and noise"
QUANTITIES = {"blur": "mtf", "noise": "sigma_dn"}
"""What is ranked -> our measure of it."""


def ranking(record: Mapping[str, Any]) -> Table:
    """Spearman's rank correlation of every measure with the true blur and noise."""
    rows: list[dict[str, Any]] = []
    for quantity, ours in QUANTITIES.items():
        for pictures, result in record["results"].items():
            measures = result.get(quantity, {})
            cells = {"ours" if name == ours else name: _cell(entry) for name, entry in measures.items()}
            counts = {name: measures[ours][name] for name in ("pictures", "scenes")} if measures else {}
            rows += [{"quantity": quantity, "dataset": pictures, **counts, **cells}] if measures else []
    return PAGE.table("frame_ranking", rows)


def section(inputs: ReportInputs) -> Section | None:
    """The section (``benchmarks/results/flags.json``), or None without a record; errors of `ReportInputs.benchmark`."""
    return PAGE.of_benchmarks(inputs, [(TITLE, FLAGS, lambda record: [ranking(record)])])


def _cell(entry: dict[str, Any]) -> Estimate:
    return Estimate(entry["spearman"], entry["low"], entry["high"])
