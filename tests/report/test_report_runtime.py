"""Run times come from a committed record; the report reads it, sets the paper's beside it, and measures nothing."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest
from report_makers import REPO

from pipeline import blur, noise, store
from pipeline.errors import InputError
from pipeline.report.inputs import ReportInputs
from pipeline.report.ledger.items import ITEMS, rows_of
from pipeline.report.patch_times import TIMED, patch_times
from pipeline.report.sections import runtime
from pipeline.report.spec import NotRun
from pipeline.report.tables import Table

RECORD = REPO / "benchmarks/results/estimators.json"
INPUTS = ReportInputs(paper=REPO / "data/paper", benchmarks={"estimators": RECORD})


def test_the_committed_record_holds_every_estimator() -> None:
    results = {(time.task, time.estimator) for time in patch_times(INPUTS).itertuples()}
    timed = {name for task, name in results if task == "blur"}
    registered = set(blur.REGISTRY.names())
    exact = {f"{name}_exact" for name in ("pmp", "gbb")}  # as the paper ran them, beside their faster variants
    assert timed == registered | exact
    assert {name for task, name in results if task == "noise"} == set(noise.REGISTRY.names())
    for time in patch_times(INPUTS).itertuples():
        assert 0 < time.batched_ms < 1.5 * time.one_ms


def test_the_table_sets_the_papers_times_beside_ours() -> None:
    section = runtime.section(INPUTS)
    (table,) = section.blocks
    assert isinstance(table, Table) and table.stage == TIMED.command
    assert [run.state for run in section.runs] == ["recorded"]
    rows = {(row["task"], str(row["estimator"]).split(" (")[0]): row for row in table.rows}
    assert rows["Blur", "PMP"]["paper_ms"] == 12690
    assert rows["Blur", "CNN"]["paper_ms"] == 60  # a batch of four takes 0.24 s
    assert rows["Noise", "PCA"]["paper_ms"] == 2
    assert rows["Blur", "PMP"]["ratio"] == pytest.approx(12690 / rows["Blur", "PMP"]["one_ms"])
    assert "paper_ms" not in rows["Noise", "Cell-wise"]
    assert (rows["Blur", "Spectral"]["asked_fps"], rows["Noise", "Adaptive"]["asked_fps"]) == (5, 10)
    assert "cores" in table.footnotes[0]


def test_the_ledger_takes_them_as_not_comparable() -> None:
    rows = rows_of(next(item for item in ITEMS if item.name == "runtime"), INPUTS)
    assert len(rows) == 6 and {row.verdict for row in rows} == {"not comparable"}
    times = {(time.task, time.estimator): time for time in patch_times(INPUTS).itertuples()}
    four = next(row for row in rows if "batch of 4" in row.quantity)
    assert four.ours == pytest.approx(4e-3 * times["blur", "cnn"].batched_ms)


def test_without_a_record_the_line_that_makes_it_is_shown(tmp_path: Path) -> None:
    (block,) = runtime.section(dataclasses.replace(INPUTS, benchmarks={"estimators": tmp_path / "absent.json"})).blocks
    assert isinstance(block, NotRun) and block.line == TIMED.command
    script = REPO / TIMED.command.removeprefix("python ")
    assert script.is_file()


@pytest.mark.parametrize("content", [{"frame": 1}, [], {"machine": {}, "results": {"blur": {"pmp": {}}}}])
def test_another_file_is_refused_by_name(tmp_path: Path, content: object) -> None:
    if isinstance(content, dict) and "results" in content:
        content |= {"frame_px": [1, 1], "patch_px": {}}
    store.write_json(tmp_path / "times.json", content)
    with pytest.raises(InputError, match=r"times\.json.*benchmarks/estimators\.py"):
        runtime.section(dataclasses.replace(INPUTS, benchmarks={"estimators": tmp_path / "times.json"}))
