"""Fifty random rows of the ledger agree with an independent recomputation from committed tables."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path

import pytest
from independent_ledger import can_recompute, recomputed, rows_of
from report_makers import ABSENT, REPO

from pipeline.report.inputs import ReportInputs
from pipeline.report.ledger.items import all_rows
from pipeline.report.ledger.rows import to_table
from pipeline.report.table_formats import to_csv
from pipeline.streams import stream

ROWS = 50
INTERVAL_SLACK = 0.01  # of an interval that follows from a range: constants of the recomputation have four digits


def fifty(rows: list[dict[str, str]], purpose: str) -> list[dict[str, str]]:
    """Fifty rows that committed files suffice for."""
    known = [row for row in rows if can_recompute(row)]
    assert len(known) >= 4 * ROWS
    return [known[number] for number in stream(1, "ledger rows", purpose).choice(len(known), ROWS, replace=False)]


def check(row: dict[str, str], root: Path) -> None:
    again = recomputed(row, root)
    assert float(row["paper"]) == again["paper"]
    assert float(row["ours"]) == pytest.approx(again["ours"], rel=1e-5, abs=1e-6)
    low, high = (float(row[name] or "nan") for name in ("low", "high"))
    if row["verdict"] != "not comparable":
        width = high - low if math.isfinite(high - low) else 0.0
        assert low == pytest.approx(again["low"], abs=INTERVAL_SLACK * width + 1e-5, nan_ok=True)
        assert high == pytest.approx(again["high"], abs=INTERVAL_SLACK * width + 1e-5, nan_ok=True)
    assert row["verdict"] == again["verdict"], row


def test_fifty_rows_of_a_ledger_made_from_the_committed_records() -> None:
    inputs = ReportInputs(paper=REPO / "data/paper", absent=ABSENT, recorded=REPO / "reports/recorded")
    text = to_csv(to_table(all_rows(inputs)))
    for row in fifty([row for row in csv.DictReader(io.StringIO(text)) if row["item"] != "fitted_ap_grid"], "made"):
        check(row, REPO)


def test_fifty_rows_of_the_committed_ledger() -> None:
    path = REPO / "reports/tables/ledger.csv"
    if not path.exists():
        pytest.skip("no committed ledger (reports/tables/ledger.csv)")
    rows = rows_of(path)
    assert {"kind", "low", "high", "dataset"} <= set(rows[0])
    for row in fifty(rows, "committed"):
        check(row, REPO)
