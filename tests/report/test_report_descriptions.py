"""Descriptions of tables, captions and paragraphs as data."""

from __future__ import annotations

import re
from pathlib import Path

import pandas as pd
import pytest
import yaml

import pipeline.report
from pipeline.errors import InputError
from pipeline.report.descriptions import Descriptions
from pipeline.report.style import Drawing
from pipeline.report.tables import Estimate

FOLDER = Path(pipeline.report.__file__).parent / "sections"
FILES = sorted(FOLDER.glob("*.yaml"))
CODE = "\n".join(path.read_text(encoding="utf-8") for path in sorted(FOLDER.glob("*.py")))

CONTENT = """
texts: {one: "{name:word} and {name}, {name:lower}, {number:.1f}"}
figures: {shown: "On {dataset:word}."}
tables:
  plain:
    name: plain_{dataset}
    caption: Of {dataset:word}.
    stage: noise@{dataset}
    columns:
      dataset: {title: Dataset, word: dataset}
      error: {title: "Error, {dataset:word}", unit: DN, decimals: 2, estimate: [value, low, high, count, paper]}
      share: {title: Share, unit: "%", percent: fraction}
      twice: {title: Twice}
      "*": {unit: px}
    notes: [Always.]
    further_notes: {late: "Late on {dataset:word}."}
"""
ROW = {"dataset": "sim", "value": 2.0, "low": 1.0, "high": 3.0, "count": 4, "paper": 2.5, "fraction": 0.25, "a": 7}


@pytest.fixture
def page(monkeypatch: pytest.MonkeyPatch) -> Descriptions:
    made = Descriptions("made")
    monkeypatch.setitem(made.__dict__, "_content", yaml.safe_load(CONTENT))
    return made


def test_a_table_follows_its_description(page: Descriptions) -> None:
    table = page.table(
        "plain", pd.DataFrame([ROW]), cells={"twice": lambda row: 2 * row["a"]}, across={"a": "First"}, also=["late"],
        notes=["Last."], dataset="sim",
    )  # fmt: skip
    assert (table.name, table.caption, table.stage) == ("plain_sim", "Of Sim.", "noise@sim")
    assert list(table.footnotes) == ["Always.", "Late on Sim.", "Last."]
    assert [column.heading for column in table.columns] == [
        "Dataset", "Error, Sim [DN]", "Share [%]", "Twice", "First [px]"
    ]  # fmt: skip
    assert table.columns[1].decimals == 2 and table.columns[4].decimals is None
    assert table.rows == [
        {"dataset": "Sim", "error": Estimate(2.0, 1.0, 3.0, 4, 2.5), "share": 25.0, "twice": 14, "a": 7}
    ]


def test_a_fraction_that_is_not_known_gives_an_empty_cell(page: Descriptions) -> None:
    (row,) = page.table("plain", [ROW | {"fraction": float("nan")}], dataset="sim").rows
    assert "share" not in row


def test_words_are_filled_in(page: Descriptions) -> None:
    assert page.text("one", name="pca", number=2.04) == "PCA and pca, pca, 2.0"
    figure = page.figure("shown", Drawing(None, "alt"), ["s"], name="f_{dataset}", after="More.", dataset="kitti")  # type: ignore[arg-type]
    assert (figure.name, figure.caption, figure.stages) == ("f_kitti", "On KITTI. More.", ("s",))


def test_what_is_not_described_is_refused_by_name(page: Descriptions) -> None:
    with pytest.raises(InputError, match=r"made\.yaml: no texts\.on; did you mean 'one'"):
        page.text("on")
    with pytest.raises(InputError, match=r"tables\.plain has no column 'thrice'"):
        page.table("plain", [ROW], cells={"thrice": lambda row: 3}, dataset="sim")


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_description_is_used_and_complete(path: Path) -> None:
    content = yaml.safe_load(path.read_text(encoding="utf-8"))
    assert set(content) <= {"texts", "figures", "tables"}
    for part, entries in content.items():
        for key, entry in entries.items():
            prefix = key.rsplit("_", 1)[0]  # some keys are put together: rule_1, paper_elsewhere
            assert re.search(rf'"{key}"|"{prefix}_\{{|"{prefix}"', CODE), (part, key)
            if part == "tables":
                assert {"caption", "columns"} <= set(entry), key
                assert set(entry) <= {"name", "caption", "stage", "columns", "notes", "further_notes", "reference_word"}
                allowed = {"title", "unit", "decimals", "word", "percent", "estimate", "source", "wide"}
                assert all(set(column) <= allowed for column in entry["columns"].values()), key
                assert all(column.get("title") for name, column in entry["columns"].items() if name != "*"), key
