"""The table model and its four writers."""

from __future__ import annotations

import csv
import io
import math
from html.parser import HTMLParser
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.errors import InputError
from pipeline.report import table_formats
from pipeline.report.tables import Column, Estimate, Table, format_cell, format_interval, format_number

TABLES = Path(__file__).resolve().parents[2] / "reports/tables"


def table(**changes: object) -> Table:
    content: dict = {
        "name": "small",
        "caption": "Noise & blur at 5 %",
        "columns": [Column("who", "Who"), Column("sigma", "σ", "DN", 2), Column("count")],
        "rows": [
            {"who": "a_b|c", "sigma": Estimate(5.25, 5.1, 5.4, 72, 5.2), "count": 3},
            {"who": "<b>", "sigma": Estimate(math.nan), "count": None},
        ],
        "footnotes": ["a note"],
        "stage": "noise@sim-pca",
    }
    return Table(**{**content, **changes})


def test_columns_must_be_unique_and_rows_must_not_hold_unknown_ones() -> None:
    with pytest.raises(InputError, match="share a name"):
        table(columns=[Column("who"), Column("who")], rows=[])
    with pytest.raises(InputError, match="'sigm'.*did you mean 'sigma'"):
        table(rows=[{"sigm": 1.0}])


@pytest.mark.parametrize(
    ("value", "decimals", "text"),
    [
        (5.0, None, "5"), (5.25, 1, "5.2"), (-0.0001, 2, "0.00"), (-1.5, 1, "−1.5"), (math.nan, None, "–"),
        (None, 2, "–"), (12345.0, None, "12,345"), (1234.56, None, "1,235"), (0.00012345, None, "0.0001234"),
    ],
)  # fmt: skip
def test_numbers_for_readers(value: float | None, decimals: int | None, text: str) -> None:
    assert format_number(value, decimals) == text


@given(st.floats(-1e6, 1e6), st.integers(0, 6))
def test_a_formatted_number_reads_back_within_half_a_unit(value: float, decimals: int) -> None:
    read = float(format_number(value, decimals).replace("−", "-"))
    assert abs(read - value) <= 0.5 * 10.0**-decimals * (1 + 1e-6) + 1e-9
    assert format_number(value, decimals) != "−0"


def test_an_estimate_shows_interval_count_and_reference() -> None:
    shown = format_cell(Estimate(5.25, 5.1, 5.4, 72, 5.2), Column("x", decimals=2), "paper")
    assert shown == "5.25 [5.10 to 5.40; n 72; paper 5.20]"
    assert format_cell(Estimate(5.25), Column("x", decimals=2)) == "5.25"


@pytest.mark.parametrize(
    ("low", "high", "shown"),
    [
        (-0.029, 1.6, "−0.03 to 1.6"),
        (0.002, 1.04, "0.002 to 1.0"),
        (-0.06, 0.049, "−0.1 to 0.05"),
        (0.0, 1.0, "0.0 to 1.0"),
        (-1e-15, 1.0, "0.0 to 1.0"),
    ],
)
def test_a_deciding_end_shows_its_sign_where_it_would_round_to_zero(low: float, high: float, shown: str) -> None:
    made = Table("t", "", [Column("x", decimals=1, signed=True)], [{"x": Estimate(0.6, low, high)}])
    assert format_interval(Estimate(0.6, low, high), 1, signed=True) == shown
    assert f"[{shown}]" in table_formats.to_markdown(made) and shown in table_formats.to_html(made)
    assert f"[{table_formats.tex(shown)}]" in table_formats.to_latex(made)
    assert format_interval(Estimate(0.6, -0.029, 1.6), 1) == "0.0 to 1.6"  # where the sign decides nothing


def test_csv_keeps_every_part_of_an_estimate_and_full_precision() -> None:
    rows = list(csv.DictReader(io.StringIO(table_formats.to_csv(table()))))
    assert list(rows[0]) == ["who", "sigma", "sigma_low", "sigma_high", "sigma_count", "sigma_reference", "count"]
    assert rows[0] | {} == {
        "who": "a_b|c", "sigma": "5.25", "sigma_low": "5.1", "sigma_high": "5.4", "sigma_count": "72",
        "sigma_reference": "5.2", "count": "3",
    }  # fmt: skip
    assert rows[1]["sigma"] == "" and rows[1]["count"] == ""


@given(st.lists(st.floats(-1e9, 1e9), min_size=1, max_size=5))
def test_csv_reads_back(values: list[float]) -> None:
    made = Table("t", "", [Column("x")], [{"x": value} for value in values])
    read = [float(row["x"]) for row in csv.DictReader(io.StringIO(table_formats.to_csv(made)))]
    assert read == pytest.approx(values, rel=1e-7, abs=1e-12)


def test_a_mark_stands_behind_its_number_and_in_a_column_of_its_own() -> None:
    columns = [Column("ap", unit="%", decimals=1), Column("other")]
    marked, plain = Estimate(98.14, 97.0, 99.0, mark="↑"), Estimate(95.3, 94.0, 96.0)
    table = Table("marks", "A table.", columns, [{"ap": marked, "other": plain}, {"ap": plain, "other": plain}])
    assert format_cell(marked, columns[0]) == "98.1 ↑ [97.0 to 99.0]"
    rows = list(csv.DictReader(io.StringIO(table_formats.to_csv(table))))
    assert [row["ap_mark"] for row in rows] == ["↑", ""] and "other_mark" not in rows[0]
    assert r"98.1 $\uparrow$ {\footnotesize [97.0 to 99.0]}" in table_formats.to_latex(table)
    assert '<span class="value">98.1 ↑</span>' in table_formats.to_html(table)


def test_the_reports_latex_has_no_sign_that_latex_does_not_set() -> None:
    # Of signs beyond ASCII pdfLaTeX sets letters with accents, ligatures and typographic quotes by itself.
    signs = {sign for path in TABLES.glob("*.tex") for sign in path.read_text(encoding="utf-8") if not sign.isascii()}
    assert {sign for sign in table_formats.tex("".join(signs)) if not sign.isascii()} <= set("’æ")


def test_markdown_has_one_cell_per_column_and_escapes_bars() -> None:
    lines = table_formats.to_markdown(table()).splitlines()
    body = [line for line in lines if line.startswith("|")]
    assert [line.replace("\\|", "").count("|") for line in body] == [4, 4, 4, 4]
    assert body[1] == "|---|---:|---:|"
    assert "a_b\\|c" in body[2] and "σ [DN]" in body[0]
    assert "a note" in lines and "Made by `noise@sim-pca`." in lines


def test_latex_is_booktabs_with_special_characters_escaped() -> None:
    text = table_formats.to_latex(table())
    for part in (r"\toprule", r"\midrule", r"\bottomrule", r"\begin{tabular}{lrr}", r"Noise \& blur at 5 \%", r"a\_b"):
        assert part in text
    assert text.count(r"\\") == 3  # heading and two rows
    assert table_formats.tex(r"50% \x {y} ~^") == r"50\% \textbackslash{}x \{y\} \textasciitilde{}\textasciicircum{}"


class _Cells(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.texts: list[str] = []
        self.sort: list[str | None] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.open.append(tag)
        if tag == "td":
            self.texts.append("")
            self.sort.append(dict(attrs).get("data-sort"))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if "td" in self.open:
            self.texts[-1] += data


def test_html_is_well_formed_escaped_and_sortable() -> None:
    parsed = _Cells()
    parsed.feed(table_formats.to_html(table()))
    assert parsed.open == []
    assert parsed.texts[0] == "a_b|c" and parsed.texts[3] == "<b>"
    assert parsed.texts[1].startswith("5.25") and "5.10 to 5.40 · n 72" in parsed.texts[1]
    assert parsed.sort == [None, "5.25", "3", None, "", None]  # text is its own key


def test_folded_rows_open_by_a_click_on_their_number() -> None:
    parsed, open_rows = _Cells(), table_formats.to_html(table())
    folded = table_formats.to_html(table(), folded=True)
    parsed.feed(folded)
    assert parsed.open == []
    assert f'<details class="long"><summary>{len(table().rows)} rows</summary>' in folded
    assert "<details" not in open_rows and folded.count("<td") == open_rows.count("<td")


def test_saving_writes_three_files(tmp_path: object) -> None:
    written = table_formats.save(table(), str(tmp_path))
    assert [path.name for path in written] == ["small.csv", "small.md", "small.tex"]
    assert all(path.read_text(encoding="utf-8").endswith("\n") for path in written)
