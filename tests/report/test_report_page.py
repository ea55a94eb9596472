"""The built report: self-contained, honest about absences, valid, and the same bytes each time."""

from __future__ import annotations

import dataclasses
import re
import shutil
import subprocess
from collections import Counter
from html.parser import HTMLParser
from pathlib import Path

import pytest
from report_makers import ABSENT, REPO, make_all

from pipeline.errors import InputError
from pipeline.report import page, templates
from pipeline.report.build import build
from pipeline.report.inputs import ReportInputs
from pipeline.report.spec import Section
from pipeline.report.tables import Column, Table

VOID = {"meta", "br", "img", "link", "input", "hr"}


class Document(HTMLParser):
    """Tags, ids and links of a page; fails on tags that do not nest."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: Counter[str] = Counter()
        self.ids: list[str] = []
        self.links: list[str] = []
        self.labels: list[str] = []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags[tag] += 1
        if tag not in VOID:
            self.open.append(tag)
        for name, value in attrs:
            if name == "id":
                self.ids.append(value or "")
            if name in ("href", "src", "xlink:href"):
                self.links.append(value or "")
            if tag == "svg" and name == "aria-label":
                self.labels.append(value or "")

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def text(report_folder: Path) -> str:
    return (report_folder / "index.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def document(text: str) -> Document:
    return Document(text)


def test_the_page_nests_and_its_ids_are_unique_and_its_links_lead_somewhere(document: Document) -> None:
    repeated = [name for name, count in Counter(document.ids).items() if count > 1]
    assert repeated == []
    inner = {link[1:] for link in document.links if link.startswith("#")}
    assert inner <= set(document.ids)


def test_the_page_loads_nothing_from_elsewhere(text: str, document: Document) -> None:
    assert all(link.startswith(("#", "data:image/png;base64,", "data:image/jpeg;base64,")) for link in document.links)
    assert document.tags["link"] == document.tags["img"] == document.tags["iframe"] == 0
    assert "@import" not in text
    assert not re.search(r"url\((?!#)", text)


def test_every_figure_is_described_with_numbers(document: Document) -> None:
    assert len(document.labels) == document.tags["svg"] - 1 == 7  # beside the figures stands what they share
    assert all(re.search(r"\d", label) for label in document.labels)


def test_nothing_of_this_machine_or_of_the_time_is_in_the_report(
    report_folder: Path, report_inputs: ReportInputs
) -> None:
    import datetime

    for path in report_folder.rglob("*"):
        if path.is_file() and path.suffix != ".png":
            content = re.sub(r"base64,[^\"]*", "", path.read_text(encoding="utf-8"))  # any word may occur in there
            for secret in (str(report_inputs.paper), "/tmp", "/home", "/somewhere", str(Path.cwd())):
                assert secret not in content, (path.name, secret)
            assert datetime.datetime.now().strftime("%Y-%m-%d") not in content


def test_what_did_not_run_is_shown_with_the_line_that_would_run_it(text: str) -> None:
    for line in (*ABSENT.values(), "dvc repro worked_examples", "dvc repro blur@&lt;dataset&gt;-&lt;estimator&gt;"):
        assert line in text
    assert "not run: data absent" in text and "not run: stage absent" in text


def test_provenance_names_stage_inputs_parameters_and_line(text: str) -> None:
    assert "noise@sim-pca" in text and "dvc repro noise@sim-pca" in text
    assert "0123456789" in text and "0123456789abc" not in text  # hashes are shortened
    assert "noise.tile_px = 128" in text
    assert "…/kitti" in text


def test_figures_and_tables_lie_beside_the_page(report_folder: Path) -> None:
    figures = {path.name for path in (report_folder / "figures").iterdir()}
    assert {"noise.svg", "noise.png", "noise.csv", "kernels_generated.svg", "datasets.png"} <= figures
    tables = {path.name for path in (report_folder / "tables").iterdir()}
    assert {"ledger.csv", "noise_sim.tex", "noise_sim.md", "quarantine.csv"} <= tables


def test_every_file_that_the_page_names_lies_beside_it(text: str, report_folder: Path) -> None:
    names = re.findall(r'class="files">([^<]+)<', text)
    assert "tables/ledger.csv, .md, .tex" in names and len(names) > 10
    for name in names:
        first, *suffixes = name.split(", ")
        stem = first.removesuffix(Path(first).suffix)
        for file in (first, *(stem + suffix for suffix in suffixes)):
            assert (report_folder / file).is_file(), file


def test_an_empty_run_still_gives_a_report_that_says_so(tmp_path: Path) -> None:
    result = build(ReportInputs(paper=REPO / "data/paper", absent=ABSENT), tmp_path)
    text = (tmp_path / "index.html").read_text(encoding="utf-8")
    Document(text)
    assert result.compared == 0 and result.counts["not run"] == result.total
    assert "None of" in text and "Nothing has run yet" in text


def test_a_broken_stage_output_is_refused_by_name(tmp_path: Path, report_inputs: ReportInputs) -> None:
    (tmp_path / "noise/sim-pca").mkdir(parents=True)
    (tmp_path / "noise/sim-pca/summary.parquet").write_bytes(b"not parquet")
    with pytest.raises(InputError, match=r"summary\.parquet: not a Parquet table"):
        build(dataclasses.replace(report_inputs, data=tmp_path), tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.mark.full("two pages take 10 s")
@pytest.mark.slow
def test_two_builds_in_two_places_by_one_and_two_workers_are_the_same_bytes_and_leave_nothing_stale(
    tmp_path: Path, report_folder: Path
) -> None:
    again = tmp_path / "again"
    (again / "figures").mkdir(parents=True)
    (again / "figures" / "stale.svg").write_text("old")
    build(make_all(tmp_path / "stages", ("sim",), ("pca", "bf")), again, workers=2)
    first = {path.relative_to(report_folder): path.read_bytes() for path in report_folder.rglob("*") if path.is_file()}
    second = {path.relative_to(again): path.read_bytes() for path in again.rglob("*") if path.is_file()}
    assert first.keys() == second.keys()
    assert [name for name in first if first[name] != second[name]] == []


def test_figures_share_outlines_of_letters_and_follow_the_colours_of_the_page(text: str, document: Document) -> None:
    assert "var(--ink)" in text and "#1b1f24" not in text.partition("</style>")[2]
    assert document.tags["metadata"] == 0
    outlines = [name for name in document.ids if re.fullmatch(r"g\d+", name)]
    assert len(outlines) > 20 and max(Counter(outlines).values()) == 1


@pytest.mark.parametrize(("most", "folds"), [(1, True), (10**6, False)])
def test_long_tables_are_folded_where_they_stand(monkeypatch: pytest.MonkeyPatch, most: int, folds: bool) -> None:
    monkeypatch.setattr(page, "FOLDED_ROWS", most)
    rows = Table("long", "Two rows.", (Column("a"),), ({"a": 1}, {"a": 2}))
    shown = page.render([Section("noise", "Noise", (), (rows,))], [], [], {}, "default", "")
    Document(shown)
    assert ('<details class="long"><summary>2 rows</summary>' in shown) == folds


def test_script_is_short_and_the_page_reads_without_it(text: str) -> None:
    assert len(templates.text("script.js").splitlines()) <= 150
    assert '<div class="switches" hidden' in text  # switches appear only where the script runs
    assert "<noscript" not in text


def test_styles_cover_dark_print_and_narrow() -> None:
    css = templates.text("style.css")
    for query in ("prefers-color-scheme: dark", "@media print", "max-width: 40rem"):
        assert query in css
    used = set(re.findall(r"var\((--[a-z-]+)\)", css + page.themed(" ".join(page._COLOURS))))
    defined = set(re.findall(r"(--[a-z-]+):", css))
    assert used <= defined


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("chromium") is None, reason="no chromium to run the script in")
def test_the_script_runs_in_a_browser(report_folder: Path) -> None:
    flags = ["--headless", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=4000", "--dump-dom"]
    address = (report_folder / "index.html").as_uri()
    shown = subprocess.run(
        ["chromium", *flags, address], capture_output=True, text=True, timeout=120, check=True
    ).stdout
    assert '<th scope="col"><button type="button">Dataset</button></th>' in shown
    assert '<div class="switches" hidden' not in shown
