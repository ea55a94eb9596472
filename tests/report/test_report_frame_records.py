"""Experiments recorded on frames in the report: figures, tables, the overview, and what the ledger takes from them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from combined_makers import blur_cells, curves, noise_cells
from report_makers import REPO, make_noise

from pipeline import store
from pipeline.experiments.factors import EFFECTS, FACTOR_CELLS, SETTINGS
from pipeline.experiments.recorded import frames as frame_records
from pipeline.experiments.recorded.blur import BlurRecord
from pipeline.experiments.recorded.frames import COMBINED_FILES, DENOISED_FILE, FACTOR_FILES, NOISE_FILE
from pipeline.experiments.tables import CHANGES
from pipeline.recording.provenance import write_csv
from pipeline.report.inputs import ReportInputs
from pipeline.report.ledger import causes as ledger_causes
from pipeline.report.ledger import sources as ledger_sources
from pipeline.report.ledger.items import ITEMS, beside_ours, rows_of
from pipeline.report.ledger.rows import NOT_RUN
from pipeline.report.sections import combined, factors, noise
from pipeline.report.spec import Figure
from pipeline.report.tables import Estimate, Table

BY_NAME = {item.name: item for item in ITEMS}
EFFECT = 20.9


def put(folder: Path, dataset: str, tables: dict[str, pd.DataFrame]) -> None:
    """A record with these tables."""
    folder.mkdir(parents=True)
    for name, table in tables.items():
        write_csv(folder / name, table)
    frames = pd.DataFrame(
        {"frame": ["a", "b"], "width_px": 1920, "height_px": 1200, "blur_patches": 2, "noise_tiles": 5}
    )
    write_csv(folder / "frames.csv", frames)
    about = {"source": f"{dataset} by hand (MIT)", "dataset": dataset, "frames": {"a": "0", "b": "1"}, "settings": {}}
    store.write_json(folder / "provenance.json", about)


def effects() -> pd.DataFrame:
    """JPEG costs PMP as much at 3 px of linear motion and nothing else is known."""
    first, second = SETTINGS["storage"]
    shared = {"dataset": "kitti", "estimator": "pmp", "factor": "storage", "first": first, "second": second}
    numbers = {"first_percent": 10.0, "second_percent": 10 + EFFECT, "effect_percent": EFFECT, "low_percent": 15.0,
               "high_percent": 25.0, "frames": 5, "patches": 5}  # fmt: skip
    blurs = [("all", 0.0), ("linear_motion", 0.0), ("linear_motion", 3.0)]
    return EFFECTS.conform(
        pd.DataFrame([{**shared, "blur_kind": kind, "kernel_size_px": size, **numbers} for kind, size in blurs])
    )


def test_curves_recorded_before_their_change_was_kept_have_none(tmp_path: Path) -> None:
    old = curves("udacity").drop(columns=list(CHANGES))
    put(tmp_path / "udacity-combined", "udacity", {COMBINED_FILES[2]: old})
    read = frame_records.joined(tmp_path, COMBINED_FILES[2])
    assert len(read) == len(old) and read[list(CHANGES)].isna().all(axis=None)


def test_what_a_killed_recording_left_is_no_record(tmp_path: Path) -> None:
    """It is beside the records, without the provenance that is written last, or whole and not in its place yet."""
    tables = {FACTOR_FILES[1]: effects()}
    put(tmp_path / "udacity-factors", "udacity", tables)
    put(tmp_path / ".writing-a", "udacity", tables)
    put(tmp_path / ".writing-b", "kitti", tables)
    (tmp_path / ".writing-b/provenance.json").unlink()
    assert frame_records.folders_with(tmp_path, FACTOR_FILES[1]) == {"udacity": tmp_path / "udacity-factors"}


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> ReportInputs:
    """Records of every experiment on Udacity, of noise on the authors' Sim too, and no stage."""
    root = tmp_path_factory.mktemp("recorded")
    made = tmp_path_factory.mktemp("noise")
    for dataset in ("udacity", "sim_authors"):
        make_noise(made, dataset, "pca")
        summary = pd.read_parquet(next(made.rglob(f"*{dataset}-pca/summary.parquet")))
        put(root / f"{dataset}-noise", dataset, {NOISE_FILE: summary})
    selected = pd.concat([blur_cells("udacity"), blur_cells("udacity").assign(estimator="cnn")], ignore_index=True)
    tables = dict(zip(COMBINED_FILES, (selected, noise_cells("udacity"), curves("udacity")), strict=True))
    put(root / "udacity-combined", "udacity", tables)
    improved = blur_cells("udacity", experiments=("linear_dcsn",), sizes=(3.0, 7.0, 11.0), filters=(7.0, 11.0))
    put(root / "udacity-denoised_blur", "udacity", {DENOISED_FILE: improved})
    empty = FACTOR_CELLS.conform(pd.DataFrame({name: [] for name in FACTOR_CELLS.columns}))
    put(root / "kitti-factors", "kitti", dict(zip(FACTOR_FILES, (empty, effects()), strict=True)))
    return ReportInputs(paper=REPO / "data/paper", recorded=root, absent={"udacity": "get it", "kitti": "get it"})


def blocks_of(section: object) -> dict[str, Figure | Table]:
    return {block.name: block for block in section.blocks if isinstance(block, (Figure, Table))}  # type: ignore[attr-defined]


def test_the_noise_figure_and_medians_of_every_recorded_dataset(inputs: ReportInputs) -> None:
    blocks = blocks_of(noise.recorded(inputs))
    assert list(blocks) == [
        "recorded_noise_sources", "recorded_noise", "recorded_noise_udacity", "recorded_noise_sim_authors"
    ]  # fmt: skip
    figure, table = blocks["recorded_noise"], blocks["recorded_noise_udacity"]
    assert isinstance(figure, Figure) and "Udacity: 2 frames, 10 tiles" in figure.caption and figure.stages == ()
    assert isinstance(table, Table) and table.stage == "" and table.caption.startswith("Recorded: ")
    beside = [cell for row in table.rows for cell in row.values() if isinstance(cell, Estimate)]
    assert any(cell.reference is not None for cell in beside)  # the authors' program


def test_blur_and_noise_tables_stand_beside_the_papers_numbers(inputs: ReportInputs) -> None:
    blocks = blocks_of(combined.recorded(inputs))
    for name in ("recorded_combined_curves_udacity", "recorded_combined_amae_udacity_cnn"):
        assert isinstance(blocks[name], Figure)
    shown = blocks["recorded_combined_photon_defocus_udacity"]
    assert isinstance(shown, Table)
    assert any(isinstance(cell, Estimate) and cell.reference for row in shown.rows for cell in row.values())
    assert "recorded_denoised_blur_udacity" in blocks


def test_the_overview_shows_them_as_recorded(inputs: ReportInputs) -> None:
    states = {(run.experiment, run.dataset): run.state for run in combined.section(inputs).runs}
    assert states[("Blur and noise at once", "udacity")] == "recorded"
    assert states[("Blur and noise at once", "kitti")] == "absent"
    assert "recorded" in {run.state for run in noise.section(inputs).runs}


def test_published_items_that_only_records_measured_are_recorded_not_ran(inputs: ReportInputs) -> None:
    names = ["photon_defocus_amae", "improved_blur", "yolov7_direction_ap"]
    states = [run.state for run in beside_ours(names, inputs)[1]]
    assert states == ["recorded", "recorded", "absent"]
    there = replace(inputs, absent={})  # Udacity is configured: its stages made the rows
    assert [run.state for run in beside_ours(names, there)[1]] == ["ran", "ran", "absent"]


@pytest.mark.parametrize("name", ["photon_defocus_amae", "improved_blur"])
def test_the_ledger_compares_the_papers_network_on_udacity(inputs: ReportInputs, name: str) -> None:
    rows = [row for row in rows_of(BY_NAME[name], inputs) if row.verdict != NOT_RUN]
    assert rows and all(row.dataset == "udacity" and np.isfinite(row.ours) for row in rows)
    assert ledger_sources.combined_estimator(inputs) == "cnn"
    assert any("4 patches of 2 frames" in row.why for row in rows)


def test_the_authors_frames_stand_for_the_papers_sim(inputs: ReportInputs) -> None:
    rows = [row for row in rows_of(BY_NAME["noise_reference"], inputs) if row.verdict != NOT_RUN]
    assert {row.dataset for row in rows} == {"udacity", "sim_authors"}
    assert all(row.comparable for row in rows)


def test_an_effect_is_the_cause_of_a_row_it_applies_to(inputs: ReportInputs) -> None:
    words = ledger_causes._effects(inputs)
    row = {"dataset": "udacity", "estimator": "pmp", "blur_kind": "linear_motion", "kernel_size_px": 3.0}
    assert words(row, None) == (
        "kernels stored as JPEG, as theirs of these frames: +20.9 points (+15.0 to +25.0), measured on KITTI"
    )
    assert words(row | {"dataset": "kitti"}, None) == ""  # its kernels are stored without loss
    assert words(row | {"kernel_size_px": 7.0}, None) == ""


def blur_record(**options: object) -> BlurRecord:
    """PMP recorded with options on KITTI; nothing else of the record is filled."""
    provenance = {"blur": {"estimators": {"pmp": {"kind": "pmp", "options": options}}}}
    return BlurRecord("kitti", provenance, pd.DataFrame(), pd.DataFrame(), 1)


@pytest.mark.parametrize(
    ("options", "causes", "sizes", "mode"),
    [
        ({}, ["ours in fast mode", "kernels of 31 px"], "31 px, as ours", "fast mode, as ours"),
        ({"mode": "exact"}, ["kernels of 31 px"], "31 px, as ours", ""),
        ({"mode": "exact", "kernel_size": 25}, [], "", ""),
        ({"kernel_size": 21}, ["ours in fast mode", "kernels of 21 px"], "31 px, ours 21 px", "fast mode, as ours"),
    ],
)
def test_causes_are_of_the_options_that_the_estimator_ran_with(
    tmp_path: Path, options: dict[str, object], causes: list[str], sizes: str, mode: str
) -> None:
    """Options left out are the estimator's defaults: fast mode and kernels of 31 px."""
    empty = FACTOR_CELLS.conform(pd.DataFrame({name: [] for name in FACTOR_CELLS.columns}))
    settings = (("kernel_px", "25 px", "31 px"), ("mode", "exact", "fast"))
    measured = [effects().assign(factor=name, first=first, second=second) for name, first, second in settings]
    moved = pd.concat(measured, ignore_index=True)
    put(tmp_path / "kitti-factors", "kitti", dict(zip(FACTOR_FILES, (empty, moved), strict=True)))
    row = {"dataset": "kitti", "estimator": "pmp", "blur_kind": "linear_motion", "kernel_size_px": 3.0}
    record = blur_record(**options)
    text = ledger_causes._effects(ReportInputs(paper=REPO / "data/paper", recorded=tmp_path))(row, record)
    points = ": +20.9 points (+15.0 to +25.0)"
    parts = [f"kernels of {sizes}{points}"] if sizes else []
    parts += [f"{mode}{points}"] if mode else []
    assert text == "; ".join(parts) + (", measured on KITTI" if parts else "")
    differences = ledger_causes._of_estimator(row, record, None)
    assert [words.split(",")[0] for words in differences] == causes


def test_an_effect_measured_on_the_same_dataset_goes_first(tmp_path: Path) -> None:
    empty = FACTOR_CELLS.conform(pd.DataFrame({name: [] for name in FACTOR_CELLS.columns}))
    for dataset in ("kitti", "udacity"):
        moved = effects().assign(dataset=dataset, factor="patches")
        moved["effect_percent"] += 1.0 if dataset == "udacity" else 0.0
        put(tmp_path / f"{dataset}-factors", dataset, dict(zip(FACTOR_FILES, (empty, moved), strict=True)))
    words = ledger_causes._effects(ReportInputs(paper=REPO / "data/paper", recorded=tmp_path))
    row = {"estimator": "pmp", "blur_kind": "linear_motion", "kernel_size_px": 3.0}
    patches = "patches on a grid, where both use objects"
    assert words(row | {"dataset": "udacity"}, None) == f"{patches}: +21.9 points (+15.0 to +25.0), measured on Udacity"
    assert words(row | {"dataset": "sim"}, None) == f"{patches}: +20.9 points (+15.0 to +25.0), measured on KITTI"


def test_factors_are_listed_whole_and_by_kernel(inputs: ReportInputs) -> None:
    blocks = blocks_of(factors.section(inputs))
    assert list(blocks) == ["factors_kitti", "factors_by_kernel_kitti"]
    whole, each = blocks["factors_kitti"], blocks["factors_by_kernel_kitti"]
    assert isinstance(whole, Table) and isinstance(each, Table) and (len(whole.rows), len(each.rows)) == (2, 1)
    assert whole.rows[0]["effect"] == Estimate(EFFECT, 15.0, 25.0, 5)


def test_nothing_recorded_is_no_section(tmp_path: Path) -> None:
    nothing = ReportInputs(paper=REPO / "data/paper", recorded=tmp_path)
    assert noise.recorded(nothing) is combined.recorded(nothing) is factors.section(nothing) is None


def test_an_item_without_datasets_has_no_rows() -> None:
    assert rows_of(BY_NAME["noise_levels"], ReportInputs(paper=REPO / "data/paper")) == []
