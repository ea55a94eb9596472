"""The table of docs/reproduce.md on emulated processors holds what was recorded, stage by stage."""

from __future__ import annotations

import json
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def test_the_table_is_the_record() -> None:
    record = json.loads((ROOT / "benchmarks/results/processors.json").read_text(encoding="utf-8"))
    page = (ROOT / "docs/reproduce.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `([\w@-]+)` \| (\w+) \| (\w+) \|$", page, flags=re.MULTILINE)
    shown = {name: {"EPYC-Rome": first, "Haswell": second} for name, first, second in rows}
    stages = record["stages"].items()
    assert shown == {name: {processor: one["result"] for processor, one in results.items()} for name, results in stages}


def test_a_stage_is_run_or_named_as_not_run() -> None:
    record = json.loads((ROOT / "benchmarks/results/processors.json").read_text(encoding="utf-8"))
    assert record["not_run"] and not set(record["not_run"]) & set(record["stages"])
