"""Rank correlations come from a committed record; every measure of it is shown with its interval."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from report_makers import REPO

from pipeline.errors import InputError
from pipeline.report.inputs import ReportInputs
from pipeline.report.sections import frame_ranking
from pipeline.report.tables import Estimate, Table

RECORD = REPO / "benchmarks/results/flags.json"


def test_the_committed_record_is_shown_whole() -> None:
    section = frame_ranking.section(ReportInputs(paper=REPO / "data/paper", benchmarks={"flags": RECORD}))
    assert section is not None
    (table,) = section.blocks
    assert isinstance(table, Table) and table.stage == frame_ranking.FLAGS.command
    assert [run.state for run in section.runs] == ["recorded"]  # no stage measures it
    results = json.loads(RECORD.read_text(encoding="utf-8"))["results"]
    assert len(table.rows) == sum(len({"blur", "noise"} & set(result)) for result in results.values())
    row = next(row for row in table.rows if (row["quantity"], row["dataset"]) == ("noise", "CC, real cameras"))
    for name, ours in (("ours", "sigma_dn"), ("brisque", "brisque")):
        cell, entry = row[name], results["cc"]["noise"][ours]
        assert isinstance(cell, Estimate) and (cell.value, cell.low) == (entry["spearman"], entry["low"])
    assert {column.name for column in table.columns} >= {"ours", "laplacian_variance", "brisque"}


def test_without_a_record_there_is_no_section_and_a_broken_one_is_named(tmp_path: Path) -> None:
    inputs = ReportInputs(paper=REPO / "data/paper", benchmarks={"flags": tmp_path / "flags.json"})
    assert frame_ranking.section(inputs) is None
    assert frame_ranking.section(ReportInputs(paper=REPO / "data/paper")) is None
    (tmp_path / "flags.json").write_text('{"results": {"sim": {"blur": {"mtf": {"spearman": 1}}}}}')
    with pytest.raises(InputError, match=r"flags\.json: .*python benchmarks/flags\.py"):
        frame_ranking.section(inputs)
