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
CODE = "\n".join(path.read_text(encoding="utf-8") for path in sorted(FOLDER.parent.rglob("*.py")))

CONTENT = """
texts: {one: "{name:word} and {name}, {name:lower}, {number:.1f}"}
figures:
  shown: "On {dataset:word}."
  many:
    caption: Many.
    alt: "Of {dataset:word}: {words}; {clauses}."
    words: "{dataset:word} {value:.1f}"
    grid:
      down: dataset
      across: kind
      headings: "kind {}"
      x: x
      y: y
      lines: {by: estimator, x: x, y: value, band: [low, high]}
      values: [x, value]
      sort: [x]
      axes: {ylim: [0, 5]}
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
  spread:
    caption: Spread.
    order: [dataset]
    columns:
      dataset: {title: Dataset, word: dataset}
      both: {title: Both, text: "{first}, {dataset:lower}"}
      kind: {title: Kind, source: first, choices: {one: The first}}
      total: {title: Total, sum: [a, b]}
      "*": {unit: "%", source: value, key: "level_{:g}", heading: "{:g} DN",
            spread: {across: level, index: [dataset, first, a, b]}}
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


def test_rows_are_ordered_spread_and_put_in_words(page: Descriptions) -> None:
    row = {"dataset": "photos", "first": "one", "a": 1, "b": 2.0}
    other = {"dataset": "sim", "first": "two", "a": 3, "b": 4.0}
    frame = pd.DataFrame([row | {"level": 5.0, "value": 0.5}, row | {"level": 0.0, "value": 0.1}])
    table = page.table("spread", pd.concat([frame, pd.DataFrame([other | {"level": 5.0, "value": 0.7}])]))
    assert table.rows == [
        {"dataset": "Sim", "both": "two, sim", "kind": "two", "total": 7, "level_5": 0.7},
        {"dataset": "Photos", "both": "one, photos", "kind": "The first", "total": 3, "level_5": 0.5, "level_0": 0.1},
    ]
    assert [column.heading for column in table.columns[4:]] == ["0 DN [%]", "5 DN [%]"]


def test_a_grid_of_panels_follows_its_description(page: Descriptions) -> None:
    keys = {"dataset": "sim", "estimator": "pca", "kind": 1}
    frame = pd.DataFrame([keys | {"x": x, "value": x + 1.0, "low": x, "high": x + 2.0} for x in (2.0, 1.0)])
    seen: list[str] = []
    looks = {"pca": {"color": "#000000"}}
    alt = page.alt("many", [{"dataset": "kitti", "value": 1}], dataset="sim")
    drawing = page.grid(
        "many", frame, alt, looks, down=["sim", "kitti"], under=lambda axes, rows, key: seen.append(key)
    )
    assert drawing.alt == "Of Sim: KITTI 1.0; KITTI 1.0."
    assert seen == ["sim 1", "kitti 1"]
    assert drawing.values is not None and drawing.values.to_dict("list") == {"x": [1.0, 2.0], "value": [2.0, 3.0]}
    upper, lower = drawing.figure.axes
    assert upper.get_title() == "kind 1" and upper.get_ylim() == (0, 5)
    assert list(upper.lines[0].get_ydata()) == [2.0, 3.0] and lower.texts[0].get_text() == "not run"


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
    assert set(content) <= {"sections", "texts", "figures", "tables"}
    for part, entries in content.items():
        for key, entry in entries.items():
            if part == "sections":
                assert key == path.stem or f'key="{key}"' in CODE
                assert "title" in entry and set(entry) <= {"title", "text"}
                continue
            prefix = key.rsplit("_", 1)[0]  # some keys are put together: rule_1, paper_elsewhere
            assert re.search(rf'"{key}"|"{prefix}_\{{|"{prefix}"', CODE), (part, key)
            if part == "tables":
                assert {"caption", "columns"} <= set(entry), key
                known = {"name", "caption", "stage", "order", "columns", "notes", "further_notes", "reference_word"}
                assert set(entry) <= known, key
                allowed = {"title", "unit", "decimals", "word", "percent", "estimate", "source", "wide"}
                allowed |= {"choices", "text", "sum", "spread", "key", "heading", "signed"}
                assert all(set(column) <= allowed for column in entry["columns"].values()), key
                spread = entry["columns"].get("*", {}).get("spread", {"across", "index"})
                assert set(spread) == {"across", "index"}, key
                assert all(column.get("title") for name, column in entry["columns"].items() if name != "*"), key
            if part == "figures" and isinstance(entry, dict):
                assert "caption" in entry and set(entry) <= {"name", "stage", "caption", "alt", "words", "grid"}, key
                assert ("words" in entry) <= ("alt" in entry), key
