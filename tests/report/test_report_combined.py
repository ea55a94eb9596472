"""The chapter of blur and noise at once: what figures and tables show, what the ledger takes, what is refused."""

from __future__ import annotations

import dataclasses
import itertools
from pathlib import Path

import numpy as np
import pytest
from combined_makers import LEVELS, add_combined, amae, blur_cells
from report_makers import ABSENT, REPO

from pipeline import store
from pipeline.errors import InputError
from pipeline.report import style
from pipeline.report.build import build
from pipeline.report.inputs import ReportInputs, published_table
from pipeline.report.ledger.items import ITEMS, rows_of
from pipeline.report.ledger.rows import NOT_RUN
from pipeline.report.sections import combined
from pipeline.report.spec import Figure, NotRun
from pipeline.report.tables import Estimate, Table

BY_NAME = {item.name: item for item in ITEMS}
PUBLISHED = ("photon_defocus_amae", "photon_linear_motion_mtf", "improved_blur")


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> ReportInputs:
    root = tmp_path_factory.mktemp("combined")
    listed = {"index": ("sim", "udacity")}
    nothing = ReportInputs(paper=REPO / "data/paper", members=listed, absent={"kitti": ABSENT["kitti"]})
    return add_combined(nothing, root, ("sim", "udacity"))


def test_the_section_shows_every_dataset_and_says_what_did_not_run(inputs: ReportInputs) -> None:
    section = combined.section(inputs)
    figures = [block.name for block in section.blocks if isinstance(block, Figure)]
    assert figures == [
        "combined_order_sim", "combined_example_sim", "combined_example_udacity", "combined_noise_sim",
        "combined_noise_udacity", "combined_amae", "combined_amae_calibrated",
    ]  # fmt: skip
    tables = [block.name for block in section.blocks if isinstance(block, Table)]
    assert "combined_photon_linear_sim" in tables and "denoised_blur_udacity" in tables
    missing = [(block.title, block.line) for block in section.blocks if isinstance(block, NotRun)]
    assert missing[0] == ("Blur and noise at once on KITTI", ABSENT["kitti"])
    assert [line for _, line in missing].count(ABSENT["kitti"]) == 1  # one note for both experiments
    alt = next(block.drawing.alt for block in section.blocks if getattr(block, "name", "") == "combined_example_sim")
    assert "Defocus, then DCSN 0.25" in alt  # 1 % of 25 DN, by construction
    order = next(block.drawing for block in section.blocks if getattr(block, "name", "") == "combined_order_sim")
    titles = [axes.get_title() for axes in order.figure.axes if axes.get_title()]
    assert titles == ["light", "photon noise", "optics (blur)", "dark current", "8-bit frame"]
    assert sum(bool(axes.images) for axes in order.figure.axes) == 8  # two orders, each passing one step by


def test_nothing_run_is_said_with_its_line(inputs: ReportInputs, tmp_path: Path) -> None:
    nothing = dataclasses.replace(inputs, data=tmp_path, stages=frozenset({"combined", "denoised_blur"}))
    section = combined.section(nothing)
    assert all(isinstance(block, NotRun) for block in section.blocks)
    assert {"dvc repro combined@sim", "dvc repro denoised_blur@udacity"} <= {block.line for block in section.blocks}


def test_the_table_sets_the_papers_numbers_beside_raw_answers(inputs: ReportInputs) -> None:
    blur = inputs.result("combined_blur")
    paper = published_table(REPO / "data/paper/photon_defocus_amae.csv")
    table = combined.error_table("udacity", "photon_defocus", blur, paper)
    rows = {(row["variant"], row["size"]): row for row in table.rows}
    cell = rows["raw", "3"]["level_25"]
    assert isinstance(cell, Estimate) and cell.value == pytest.approx(amae(3, 25, 0, False)) and cell.reference == 5.6
    mean = rows["raw", "Mean"]["level_25"]
    assert mean.value == pytest.approx(np.mean([amae(size, 25, 0, False) for size in (3, 11)]))
    assert mean.reference == pytest.approx((5.6 + 0.5) / 2)
    assert rows["calibrated", "3"]["level_25"].reference is None
    assert not any("smoothed" in variant for variant, _ in rows)  # no patch was read as noisy
    behind = combined.error_table("udacity", "defocus_dcsn", blur)
    variants = [row["variant"] for row in behind.rows]
    assert variants == [variant for variant in ("raw", "calibrated", "raw, smoothed 7 px") for _ in range(3)]
    assert "level_0" not in behind.rows[-1]


def test_the_overview_is_the_mean_over_sizes(inputs: ReportInputs) -> None:
    table = combined.overview_table(inputs.result("combined_blur"))
    rows = {(row["dataset"], row["experiment"], row["variant"]): row for row in table.rows}
    assert len(table.rows) == 2 * (2 * 3 + 2 * 2)  # datasets x (behind the optics: three ways, before them: two)
    row = rows["Sim", "Linear motion, then DCSN", "raw, smoothed 7 px"]
    assert row["level_10"] == pytest.approx(np.mean([amae(size, 10, 7, False) for size in (3, 11)]))
    assert "level_0" not in row and row["sizes"] == "3, 11"


def test_a_level_without_an_estimate_of_a_size_has_no_mean(inputs: ReportInputs) -> None:
    cells = inputs.result("combined_blur")
    lost = (cells["experiment"] == "linear_dcsn") & (cells["kernel_size_px"] == 3) & (cells["target_sigma_dn"] == 10)
    assert lost.any()
    table = combined.overview_table(cells.assign(amae_percent=cells["amae_percent"].mask(lost)))
    rows = {(row["dataset"], row["experiment"], row["variant"]): row for row in table.rows}
    row = rows["Sim", "Linear motion, then DCSN", "raw"]
    assert np.isnan(row["level_10"]) and np.isfinite(row["level_25"])


def test_the_supplements_table_has_the_papers_twelve_rows(inputs: ReportInputs) -> None:
    cells = blur_cells("udacity", experiments=("linear_dcsn",), filters=(7.0, 11.0), sizes=(3.0, 7.0, 11.0))
    table = combined.denoised_table("udacity", cells, published_table(REPO / "data/paper/improved_blur.csv"))
    beside = [row for row in table.rows if row["amae"].reference is not None]
    assert len(beside) == 12
    row = next(row for row in beside if (row["filter"], row["size"], row["level"]) == ("11", "7", "25"))
    assert row["amae"].reference == 13.8 and row["expected"].reference == 10.8 and row["expected"].value == 5.0
    assert [row.get("expected") for row in table.rows if row["filter"] == "none"] == [None] * 12


def test_the_ledger_takes_udacity_raw_and_spectral(inputs: ReportInputs) -> None:
    rows = {name: rows_of(BY_NAME[name], inputs) for name in PUBLISHED}
    results = [row for row in rows["photon_defocus_amae"] if row.verdict != NOT_RUN]
    assert len(results) == 6  # two sizes and three levels of the paper's five and six
    wanted = sorted(amae(size, level, 0, False) for size in (3, 11) for level in LEVELS)
    assert sorted(row.ours for row in results) == pytest.approx(wanted)
    truth = [row for row in rows["photon_linear_motion_mtf"] if row.quantity.startswith("Ground truth")]
    assert len(truth) == 8 and all(row.verdict != NOT_RUN for row in truth)
    improved = [row for row in rows["improved_blur"] if row.verdict != NOT_RUN]
    assert len(improved) == 48 and {row.line for row in improved} == {"dvc repro denoised_blur@udacity"}
    expected = [row.ours for row in improved if "expected" in row.quantity]
    assert expected == [5.0] * 12


def test_without_the_dataset_the_ledger_says_so(inputs: ReportInputs) -> None:
    absent = dataclasses.replace(inputs, data=None, absent=ABSENT)
    for name in PUBLISHED:
        rows = rows_of(BY_NAME[name], absent)
        assert all((row.verdict, row.why, row.line) == (NOT_RUN, "data absent", ABSENT["udacity"]) for row in rows)


def test_sizes_are_told_apart_by_colour_and_marker(inputs: ReportInputs) -> None:
    looks = style.ordinal_looks([0.0, 3.0, 7.0, 11.0, 15.0, 21.0])
    assert (
        len({look["color"] for look in looks.values()}) == 6 and len({look["marker"] for look in looks.values()}) == 6
    )
    blur, noise = inputs.result("combined_blur"), inputs.result("combined_noise")
    raw = blur[~blur["calibrated"]]
    drawing = combined.amae_figure(raw, ["sim"], published_table(REPO / "data/paper/photon_defocus_amae.csv"))
    lines = [line for axes in drawing.figure.axes for line in axes.lines if len(line.get_xdata())]
    assert len(lines) == 4 * 2 + 2  # experiments x sizes, and the paper's two
    assert drawing.values is not None and len(drawing.values) == 2 * 4 * 2 * 3
    drawn = combined.noise_figure(noise, "sim")
    assert "Cell-wise estimates 23.8 to 23.8 DN of DCSN noise" in drawn.alt


def test_figures_of_errors_name_their_estimator_and_their_titles_keep_apart(inputs: ReportInputs) -> None:
    drawings = {block.name: block.drawing for block in combined.section(inputs).blocks if isinstance(block, Figure)}
    for name, title in (("combined_amae", "Spectral"), ("combined_amae_calibrated", "Spectral, calibrated")):
        figure = drawings[name].figure
        assert [legend.get_title().get_text() for legend in figure.legends] == [title]
        figure.draw_without_rendering()
        headings = [axes.title.get_window_extent() for axes in figure.axes if axes.get_title()]
        assert len(headings) == 4
        for left, right in itertools.pairwise(headings):
            assert right.x0 - left.x1 > 0.02 * figure.bbox.width


@pytest.mark.full("a page takes 5 s")
def test_the_page_holds_the_chapter_with_its_figures(inputs: ReportInputs, tmp_path: Path) -> None:
    one = dataclasses.replace(inputs, members={"combined": ("sim",), "denoised_blur": ()})
    build(one, tmp_path)
    page = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert "Blur and noise at once" in page and "combined_example_sim" in page
    assert {"combined_order_sim.png", "combined_amae.csv"} <= {path.name for path in (tmp_path / "figures").iterdir()}
    assert (tmp_path / "tables/combined_overview.tex").exists()


def test_a_broken_example_is_named(inputs: ReportInputs, tmp_path: Path) -> None:
    broken = add_combined(inputs, tmp_path, ("sim",))
    store.write_json(tmp_path / "combined/sim/example.json", ["nothing"])
    with pytest.raises(InputError, match="example.json: expected an object with dataset, kernel_size_px, experiments"):
        combined.section(broken)
