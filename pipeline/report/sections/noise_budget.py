"""Noise budgets of frames: how often noise departs from its sensor, and which cause is stated, from a record."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pipeline.report.descriptions import Descriptions
from pipeline.report.inputs import Benchmark, ReportInputs
from pipeline.report.spec import Section
from pipeline.report.tables import Table

PAGE = Descriptions("noise_budget")
BUDGETS = Benchmark("noise_budget", "python benchmarks/noise_budget.py --raw FOLDER", ("results", "raw"))
TITLE = "Noise budget of a frame"
RIGHT = "as "
"""How the names of cases begin in which the camera is as the budget assumes."""

FRACTIONS = ("cause_stated", "cause_first")


def departures(record: Mapping[str, Any]) -> Table:
    """A row per camera and case, that as the budget assumes first."""
    cases = {**record["results"], "raw": record["raw"]}
    rows = [
        {"sensor": sensor, "case": case, **{name: _cell(name, value) for name, value in counts.items()}}
        for sensor, of_sensor in cases.items()
        for case, counts in sorted(of_sensor.items(), key=lambda item: not item[0].startswith(RIGHT))
    ]
    return PAGE.table("noise_budget", rows)


def section(inputs: ReportInputs) -> Section | None:
    """The section, or None without a record; errors of `ReportInputs.benchmark`."""
    return PAGE.of_benchmarks(inputs, [(TITLE, BUDGETS, lambda record: [departures(record)])])


def _cell(name: str, value: float | None) -> float | None:
    return None if value is None else 100.0 * value if name in FRACTIONS else value
