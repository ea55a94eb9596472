"""The table of noise budgets comes from a committed record and shows every camera and case of it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from report_makers import REPO

from pipeline.errors import InputError
from pipeline.report.inputs import ReportInputs
from pipeline.report.sections import noise_budget
from pipeline.report.tables import Table

RECORD = REPO / "benchmarks/results/noise_budget.json"


def test_the_committed_record_is_shown_whole() -> None:
    section = noise_budget.section(ReportInputs(paper=REPO / "data/paper", benchmarks={"noise_budget": RECORD}))
    assert section is not None
    (table,) = section.blocks
    assert isinstance(table, Table) and [run.state for run in section.runs] == ["recorded"]
    record = json.loads(RECORD.read_text(encoding="utf-8"))
    assert len(table.rows) == sum(map(len, record["results"].values())) + len(record["raw"])
    row = next(row for row in table.rows if str(row["sensor"]).startswith("Automotive") and row["case"] == "gain × 2")
    counts = record["results"]["automotive_3um"]["gain x 2"]
    assert (row["more"], row["frames"]) == (counts["more"], counts["frames"])
    assert row["cause_stated"] == pytest.approx(100.0 * counts["cause_stated"])


def test_without_a_record_there_is_no_section_and_a_broken_one_is_named(tmp_path: Path) -> None:
    inputs = ReportInputs(paper=REPO / "data/paper", benchmarks={"noise_budget": tmp_path / "noise_budget.json"})
    assert noise_budget.section(inputs) is None
    (tmp_path / "noise_budget.json").write_text('{"results": {"a": 1}, "raw": {}}')
    with pytest.raises(InputError, match=r"noise_budget\.json: .*python benchmarks/noise_budget\.py"):
        noise_budget.section(inputs)
