"""Blur on recorded pictures in the report: figures, tables and sources, and what the ledger takes from the records."""

from __future__ import annotations

import dataclasses
import math
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from blur_makers import add_blur
from report_makers import ABSENT, REPO

from pipeline import store
from pipeline.camera.mtf import CAMERA, GENERIC_LENS
from pipeline.experiments.recorded import blur as blur_records
from pipeline.experiments.sharp_curves import sharp_curves
from pipeline.experiments.tables import BLUR_SUMMARY
from pipeline.report.build import build
from pipeline.report.inputs import ReportInputs, published, published_table, relative_mtf
from pipeline.report.ledger import sources as ledger_sources
from pipeline.report.ledger.items import ITEMS, rows_of
from pipeline.report.sections import blur, detection
from pipeline.report.spec import Figure
from pipeline.report.tables import Estimate, Table

BY_NAME = {item.name: item for item in ITEMS}
SIZES = (3, 21)
FOUND = ("kitti", "sim_authors")
ESTIMATORS = ("spectral", "pmp")


def write(folder: Path, made: ReportInputs, dataset: str) -> None:
    """A record as `pipeline.recording.blur` writes it, of made-up stage outputs."""
    selected = made.noiseless("blur_summary")
    estimates = made.noiseless("blur_estimates")
    curves = sharp_curves(estimates[estimates["dataset"] == dataset])
    for name, table in (("summary", selected[selected["dataset"] == dataset]), ("sharp", curves)):
        store.write_text(folder / f"{name}.csv", table.to_csv(index=False))
    store.write_text(folder / "patches.csv", "frame,patch\n" + "a,0\n" * 8)
    provenance = {"source": f"{dataset} by hand (CC0)", "dataset": dataset, "frames": {"a": "0", "b": "1"}}
    provenance |= {"kernels": {"k": "2"}, "blur": {"estimators": {name: {} for name in ESTIMATORS}}}
    store.write_json(folder / "provenance.json", provenance)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> ReportInputs:
    root = tmp_path_factory.mktemp("made")
    nothing = ReportInputs(paper=REPO / "data/paper", absent={"udacity": ABSENT["udacity"]})
    return add_blur(nothing, root, FOUND, ESTIMATORS, SIZES)


@pytest.fixture(scope="module")
def inputs(made: ReportInputs, tmp_path_factory: pytest.TempPathFactory) -> ReportInputs:
    """Records of KITTI and of the authors' Sim, no stage."""
    position = tmp_path_factory.mktemp("recorded")
    for dataset in FOUND:
        write(position / f"{dataset}-blur", made, dataset)
    return dataclasses.replace(made, data=None, recorded=position)


@pytest.fixture(scope="module")
def blocks(inputs: ReportInputs) -> dict[str, Figure | Table]:
    section = blur.recorded(inputs)
    assert section is not None and section.key == "blur_recorded" and not section.runs
    return {block.name: block for block in section.blocks if isinstance(block, (Figure, Table))}


def test_every_dataset_has_figures_and_both_tables(blocks: dict[str, Figure | Table]) -> None:
    assert list(blocks) == [
        "recorded_blur_sources", "recorded_uncorrupted_mtf", "recorded_blur_amae", "recorded_blur_amae_calibrated",
        "recorded_blur_amae_kitti", "recorded_blur_amae_kitti_calibrated", "recorded_blur_amae_sim_authors",
        "recorded_blur_amae_sim_authors_calibrated", "recorded_blur_beside_the_best",
    ]  # fmt: skip


def test_sources_frames_and_patches_are_said(blocks: dict[str, Figure | Table]) -> None:
    table = blocks["recorded_blur_sources"]
    assert isinstance(table, Table)
    assert [row["dataset"] for row in table.rows] == ["KITTI", "Sim (authors’)"]
    assert table.rows[0] | {"source": ""} == {
        "dataset": "KITTI", "frames": 2, "patches": 8, "kernels": 1, "estimators": "PMP; Spectral", "source": ""
    }  # fmt: skip
    assert table.rows[1]["source"] == "sim_authors by hand (CC0)"


def test_tables_hold_the_record_and_the_papers_own_values(
    blocks: dict[str, Figure | Table], made: ReportInputs
) -> None:
    table = blocks["recorded_blur_amae_sim_authors"]
    assert isinstance(table, Table) and "Sim (authors’)" in table.caption and table.stage == ""
    row = next(row for row in table.rows if row["blur"] == "D 3")
    cell, absent = row["pmp"], row["cnn"]
    keys = ["dataset", "estimator", "blur_kind", "kernel_size_px", "calibrated"]
    summary = made.noiseless("blur_summary").set_index(keys)
    kept = summary.loc[("sim_authors", "pmp", "defocus", 3.0, False)]
    assert isinstance(cell, Estimate) and cell.value == pytest.approx(kept["amae_percent"], rel=1e-6)
    assert cell.reference == 13.9  # the paper's Sim
    assert isinstance(absent, Estimate) and math.isnan(absent.value) and absent.reference == 0.7
    assert not any("rendered here" in note for note in table.footnotes)
    beside = blocks["recorded_blur_beside_the_best"]
    assert isinstance(beside, Table) and {row["dataset"] for row in beside.rows} == {"KITTI", "Sim (authors’)"}


def test_figures_show_the_papers_curves_of_its_own_sim(blocks: dict[str, Figure | Table]) -> None:
    shown = blocks["recorded_uncorrupted_mtf"]
    assert isinstance(shown, Figure) and "Sim (authors’)" in shown.drawing.alt
    lines = shown.drawing.figure.findobj(lambda artist: str(artist.get_gid()).startswith("series--cnn--paper_sim"))
    assert len(lines) == 1
    paper = published_table(REPO / "data/paper/uncorrupted_mtf.csv")
    selected = paper[(paper["dataset"] == "sim") & (paper["estimator"] == "cnn") & (paper["statistic"] == "median")]
    assert np.asarray(lines[0].get_ydata()) == pytest.approx(selected.sort_values("frequency")["mtf"].to_numpy())
    assert shown.stages == ()


def test_what_was_recorded_is_a_state_of_the_overview(inputs: ReportInputs, made: ReportInputs) -> None:
    kitti = dataclasses.replace(made, members={"blur": ("kitti-pmp",)}, absent=inputs.absent)
    both = dataclasses.replace(kitti, recorded=inputs.recorded)
    states = {(run.experiment, run.dataset): run.state for run in blur.section(both).runs}
    assert states["Blur by PMP", "sim_authors"] == "recorded" and states["Blur by PMP", "udacity"] == "absent"
    assert states["Blur by PMP", "kitti"] == "ran"  # a stage's run comes before the record
    alone = {(run.experiment, run.dataset) for run in blur.section(kitti).runs}
    assert ("Blur by PMP", "sim_authors") not in alone


def test_without_records_there_is_no_section(made: ReportInputs, tmp_path: Path) -> None:
    assert blur.recorded(made) is None
    assert blur.recorded(dataclasses.replace(made, recorded=tmp_path)) is None


def test_a_record_of_one_kind_is_no_record_of_the_other(inputs: ReportInputs) -> None:
    """Those of detection in the repository are not taken for blur's; blur's not for detection's."""
    result = detection.section(inputs)
    assert not [block for block in result.blocks if isinstance(block, Figure)]
    both = blur.recorded(dataclasses.replace(inputs, recorded=REPO / "reports/recorded"))
    assert both is not None and not [block for block in both.blocks if "iopc" in getattr(block, "name", "")]


def test_the_ledger_counts_recorded_numbers(inputs: ReportInputs, made: ReportInputs) -> None:
    rows = [row for row in rows_of(BY_NAME["blur_amae"], inputs) if math.isfinite(row.ours)]
    assert len(rows) == 2 * 6  # PMP is the one of the paper's names; both datasets, six kernels
    assert all(row.comparable for row in rows)  # the paper's Sim are the authors' frames
    summary = made.noiseless("blur_summary")
    for name, dataset in (("Sim", "sim_authors"), ("KITTI", "kitti")):
        row = next(one for one in rows if one.quantity == f"{name}, PMP, Defocus, 21 px")
        selected = summary[(summary["dataset"] == dataset) & (summary["estimator"] == "pmp") & ~summary["calibrated"]]
        cell = selected[(selected["blur_kind"] == "defocus") & (selected["kernel_size_px"] == 21)].iloc[0]
        assert row.ours == pytest.approx(cell["amae_percent"], rel=1e-6)
    curves = [row for row in rows_of(BY_NAME["uncorrupted_mtf"], inputs) if math.isfinite(row.ours)]
    assert len(curves) == 2 * 24
    assert all(row.comparable == (", median, " in row.quantity) for row in curves)  # extremes widen with the patches


def test_own_runs_win_over_records_but_for_the_sim_rendered_here(inputs: ReportInputs, tmp_path: Path) -> None:
    """A stage's KITTI and Sim, made otherwise than the records: KITTI is the stage's, Sim the authors' frames."""
    ran = add_blur(inputs, tmp_path, ("kitti", "sim"), ("pmp", "gbb"), SIZES)
    for name in ("kitti-pmp", "sim-pmp", "sim-gbb", "kitti-gbb"):
        path = tmp_path / "blur" / name / "summary.parquet"
        table = store.read_table(path, BLUR_SUMMARY)
        store.write_table(path, table.assign(amae_percent=50.0), BLUR_SUMMARY)
    rows = {row.quantity: row for row in rows_of(BY_NAME["blur_amae"], ran)}
    assert rows["KITTI, PMP, Defocus, 3 px"].ours == 50.0
    assert rows["Sim, PMP, Defocus, 3 px"].ours < 50.0 and rows["Sim, PMP, Defocus, 3 px"].comparable
    assert rows["Sim, GBB, Defocus, 3 px"].ours == 50.0 and not rows["Sim, GBB, Defocus, 3 px"].comparable
    table = ledger_sources.blur_amae(ran)
    assert table is not None and not table.duplicated(["dataset", "estimator", "blur_kind", "kernel_size_px"]).any()


def test_runs_on_the_authors_frames_win_over_runs_on_the_sim_rendered_here(tmp_path: Path) -> None:
    nothing = ReportInputs(paper=REPO / "data/paper")
    ran = add_blur(nothing, tmp_path, ("sim_authors", "sim"), ("pmp",), SIZES)
    for dataset, percent in (("sim_authors", 30.0), ("sim", 50.0)):
        path = tmp_path / "blur" / f"{dataset}-pmp" / "summary.parquet"
        store.write_table(path, store.read_table(path, BLUR_SUMMARY).assign(amae_percent=percent), BLUR_SUMMARY)
    (row,) = [row for row in rows_of(BY_NAME["blur_amae"], ran) if row.quantity == "Sim, PMP, Defocus, 3 px"]
    assert (row.ours, row.dataset, row.comparable) == (30.0, "sim_authors", True)


def test_the_papers_numbers_stand_under_both_names() -> None:
    table = published(ReportInputs(paper=REPO / "data/paper"), "blur_amae.csv")
    assert table is not None and len(table) == 180
    selected = table.set_index(["dataset", "estimator", "blur_kind", "kernel_size_px"])["amae_percent"]
    assert selected["sim_authors", "pmp", "defocus", 3.0] == selected["sim", "pmp", "defocus", 3.0] == 13.9


def test_a_relative_mtf_is_no_curve_of_sharp_frames(made: ReportInputs, tmp_path: Path) -> None:
    """Estimators whose MTF is relative to sharp frames or to a generic lens are left out of their figure."""
    for relative, left in (("", set(ESTIMATORS)), ("pmp", {"spectral"})):
        folder = tmp_path / f"relative {relative}"
        shutil.copytree(made.data / "blur", folder / "blur")
        for path in folder.glob(f"blur/*-{relative}/estimates.parquet"):
            pd.read_parquet(path).assign(relative_to=CAMERA).to_parquet(path)
        shown = blur.section(dataclasses.replace(made, data=folder)).blocks
        figure = next(block for block in shown if getattr(block, "name", "") == "uncorrupted_mtf")
        assert isinstance(figure, Figure) and set(figure.drawing.values["estimator"]) == left


def test_what_an_mtf_is_relative_to_is_a_column_of_the_records_not_a_rule_of_names() -> None:
    for one in blur_records.read(REPO / "reports/recorded"):
        assert relative_mtf(one.summary) == {
            "camera_calibrated": CAMERA, "fused": CAMERA, "generic_lens": GENERIC_LENS
        }  # fmt: skip
        divided = one.summary[one.summary["calibrated"]]
        assert set(divided["relative_to"]) == {CAMERA} and len(divided) > 0


@pytest.mark.full("a page takes 5 s")
@pytest.mark.slow
def test_the_page_holds_the_section(inputs: ReportInputs, tmp_path: Path) -> None:
    build(inputs, tmp_path)
    text = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert 'href="#blur_recorded"' in text and 'id="figure-recorded_blur_amae"' in text
    assert "kitti by hand (CC0)" in text and (tmp_path / "tables/recorded_blur_amae_kitti.csv").exists()
    assert str(inputs.recorded) not in text
