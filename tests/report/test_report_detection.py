"""The chapter of detection: what its figures and tables show, what the ledger takes, what is said of the rest."""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path

import composed
import numpy as np
import pandas as pd
import pytest
from report_makers import ABSENT, REPO
from sweep_makers import LEVELS, SIZES, sweep_tables

from pipeline import store
from pipeline.config.schema import validate
from pipeline.curves.regression import fit
from pipeline.experiments.detect import DETECTIONS, LOOKED, OBJECTS
from pipeline.experiments.tables import CONDITIONS
from pipeline.report import detection_results, style
from pipeline.report.build import build
from pipeline.report.claims import paired_precision
from pipeline.report.inputs import ReportInputs
from pipeline.report.ledger.items import ITEMS, rows_of
from pipeline.report.ledger.rows import MATCH, NOT_COMPARABLE
from pipeline.report.sections import detection, detection_figures
from pipeline.report.spec import Figure, NotRun
from pipeline.report.tables import Estimate, Table
from pipeline.stages import curves, direction, refit, regression

BY_NAME = {item.name: item for item in ITEMS}
DETECTORS = ("compact", "compact_two_stage")


JUDGED = [
    f"detection.evaluation.{setting}"
    for setting in ("bootstrap_draws=60", "min_height_px=25", "min_visible_fraction=0.3")
]


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> ReportInputs:
    """Two detectors on Sim through the stages after detection; the second finds a third less."""
    root = tmp_path_factory.mktemp("detection")
    content = composed.content(*JUDGED)
    config = validate(content)
    detections, looked, objects, medians = sweep_tables()
    for number, name in enumerate(DETECTORS):
        out = root / "data/detect" / f"sim-{name}"
        selected = detections[detections["frame"] < ("f99", "f08")[number]]
        for file, table, schema in (
            ("detections", selected, DETECTIONS), ("looked", looked, LOOKED), ("objects", objects, OBJECTS),
        ):  # fmt: skip
            store.write_table(out / f"{file}.parquet", table, schema)
        store.write_json(out / "about.json", {"classes": ["car", "person"]})
    store.write_table(root / "data/measured/sim/conditions.parquet", medians, CONDITIONS)
    for name in DETECTORS:
        for stage in (curves, direction, regression):
            stage.run.run(config, {"dataset": "sim", "detector": name}, root, root)
    refit.run.run(config, {}, REPO, root)
    return ReportInputs(
        paper=REPO / "data/paper",
        data=root / "data",
        members={"curves": [f"sim-{name}" for name in DETECTORS], "index": ()},
        detectors_absent={"yolov4": "camera-monitor weights get yolov4 && dvc exp run"},
        recorded=REPO / "reports/recorded",
        absent={"kitti": ABSENT["kitti"]},
    )


@pytest.fixture(scope="module")
def blocks(inputs: ReportInputs) -> dict[str, Figure | Table]:
    result = detection.section(inputs)
    return {block.name: block for block in result.blocks if not isinstance(block, NotRun)}


def test_corners_of_the_sweep_with_intervals_and_counts(blocks: dict[str, Figure | Table]) -> None:
    table = blocks["detection_ap_sim"]
    assert isinstance(table, Table)
    first, second = table.rows
    assert (first["detector"], first["label"], first["objects"], first["images"]) == ("Compact", "Car", 12, 12)
    clean, both = first["clean"], first["both"]
    assert isinstance(clean, Estimate) and isinstance(both, Estimate) and isinstance(second["clean"], Estimate)
    assert clean.value == pytest.approx(100.0) and second["clean"].value == pytest.approx(100 * 8 / 12)
    assert both.low <= both.value <= both.high < clean.value
    assert [row["label"] for row in table.rows] == ["Car", "Car"]  # a class without an object is no row


def test_figures_hold_every_point(blocks: dict[str, Figure | Table]) -> None:
    iopc, heat = blocks["iopc_sim"], blocks["iopc_heat_sim"]
    assert isinstance(iopc, Figure) and isinstance(heat, Figure)
    values = iopc.drawing.values
    assert values is not None and heat.drawing.values is not None
    noise = values[(values["quantity"] == "sigma_dn") & (values["detector"] == "compact")]
    assert noise["quantity_value"].tolist() == list(LEVELS)
    assert len(heat.drawing.values) == 2 * len(SIZES) * len(LEVELS)
    assert "Compact, Car: 100 to" in iopc.drawing.alt
    assert iopc.stages == ("curves@sim-compact", "curves@sim-compact_two_stage")
    texts = [text.get_text() for text in heat.drawing.figure.findobj(lambda a: hasattr(a, "get_text"))]
    assert "100" in texts and "67" in texts


def test_the_direction_table_has_a_row_for_each_noise_and_angle(blocks: dict[str, Figure | Table]) -> None:
    table = blocks["direction_sim_compact"]
    assert isinstance(table, Table)
    assert [(row["target_sigma_dn"], row["angle_deg"]) for row in table.rows] == [
        (n, a) for n in LEVELS for a in (0.0, 90.0)
    ]
    assert {"car_7", "car_21"} <= set(table.rows[0])
    assert all(table.rows[0][name].has_interval for name in ("car_7", "car_21"))
    assert "direction_sim_car" in blocks and "direction_spread_sim" in blocks


def test_too_few_cells_for_the_regression_are_said(blocks: dict[str, Figure | Table]) -> None:
    """Fifteen cells make a fit of eight coefficients; a class without objects makes none and says why."""
    table = blocks["regression_fits_sim"]
    assert isinstance(table, Table)
    cars = [row for row in table.rows if row["label"] == "Car"]
    assert all(row["cells"] == 15 for row in cars)
    assert all("no fit" in str(row["reason"]) for row in table.rows if row["label"] == "Person")


def test_errors_that_were_raised_are_counted_and_the_unweighted_fit_stands_beside(
    inputs: ReportInputs, blocks: dict[str, Figure | Table]
) -> None:
    """No cell weighs more than one with an error of 2 points; the made-up detector has cells without any error."""
    table = blocks["regression_fits_sim"]
    assert isinstance(table, Table)
    row = next(row for row in table.rows if row["label"] == "Car" and row["detector"] == "Compact")
    one = detection_results.read(dataclasses.replace(inputs, recorded=None))[0]
    errors = one.fitted_cells("car")["error_percent"]
    assert errors.min() == 2.0 and row["raised"] == (errors == 2.0).sum() > 0
    assert any("below 2 points count as 2" in note for note in table.footnotes)
    cells = one.fitted_cells("car")
    fitted = fit(cells["iso"], cells["exposure_ms"], cells["ap_percent"]).r2
    assert row["unweighted_r2"] == fitted != row["r2"]


def test_a_residual_stands_wholly_on_its_mark() -> None:
    """White digits beside a dark mark would be lost on white paper: -21 would read -2."""
    iso, exposure_ms = (axis.ravel() for axis in np.meshgrid([100.0, 500, 1500, 2500], [1.0, 7, 15, 21]))
    rows = {"iso": iso, "exposure_ms": exposure_ms, "ap_percent": 50.0, "fitted_percent": 71.0, "residual": -21.0}
    cells = pd.DataFrame(rows).assign(label="car", error_percent=2.0, fit="a car")
    grid = cells.assign(ap_percent=np.nan, fitted_percent=iso / 50 + exposure_ms)
    drawing = detection_figures.regression(pd.concat([cells, grid]), {"a car": "A, car"})
    drawing.figure.draw_without_rendering()
    axes = drawing.figure.axes[1]
    half = detection_figures.RESIDUAL_PT / 2 * drawing.figure.dpi / 72
    for text, offset in zip(axes.texts, axes.collections[0].get_offsets(), strict=True):
        middle, extent = axes.transData.transform(offset)[0], text.get_window_extent()
        assert text.get_text() == "−21" and middle - half <= extent.x0 and extent.x1 <= middle + half


def test_a_stage_keeps_what_paired_differences_need(inputs: ReportInputs) -> None:
    """The resampled values belong to the points: their mean is near AP, and scenes are shared by all conditions."""
    alone = dataclasses.replace(inputs, recorded=None)
    cars = [sweep for sweep in paired_precision.sweeps(detection_results.read(alone)) if sweep.label == "car"]
    assert [sweep.detector for sweep in cars] == list(DETECTORS)
    for sweep in cars:
        assert sweep.draws.shape[0] == len(sweep.points) == len(SIZES) * len(LEVELS)
        np.testing.assert_allclose(np.nanmean(sweep.draws, axis=1), sweep.points["ap_percent"], atol=6.0)
        longest, strongest = sweep.ends()
        value, low, high = sweep.difference((longest, strongest), (0.0, 0.0))
        assert value == sweep.ap_percent(longest, strongest) - sweep.ap_percent(0.0, 0.0)
        assert low <= value <= high < 0


def test_recorded_curves_carry_their_source(blocks: dict[str, Figure | Table]) -> None:
    shown = blocks["recorded_kitti_yolox_iopc"]
    assert isinstance(shown, Figure) and "CC BY-NC-SA" in shown.caption
    assert "181 objects in 66 frames" in shown.caption and "behind linear motion" in shown.caption
    assert "recorded_kitti_yolox_iopc_heat" in blocks and "81 to 52 % under noise" in shown.drawing.alt


def test_a_record_tells_its_surfaces_and_refusals_by_class(inputs: ReportInputs, tmp_path: Path) -> None:
    folder = tmp_path / "kitti-yolox"
    shutil.copytree(REPO / "reports/recorded/kitti-yolox", folder)
    (folder / "surface-car.npz").rename(folder / "surface-traffic_light.npz")
    table = pd.read_csv(folder / "precision.csv")
    table.assign(label=table["label"].replace("car", "traffic light")).to_csv(folder / "precision.csv", index=False)
    store.write_json(folder / "refused.json", {"bus": "too few"})
    (tmp_path / ".writing-a").mkdir()  # a recording that was killed
    shutil.copy(folder / "precision.csv", tmp_path / ".writing-a")
    (record,) = detection_results.recorded(dataclasses.replace(inputs, recorded=tmp_path))
    assert set(record.results.surfaces) == {"traffic light", "person"}
    assert record.results.refused == {"bus": "too few"}


def test_the_ledger_matches_the_published_regression(inputs: ReportInputs) -> None:
    grid = rows_of(BY_NAME["fitted_ap_grid"], inputs)
    assert len(grid) == 84 and all(row.verdict == MATCH for row in grid)
    numbers = rows_of(BY_NAME["regression_coefficients"], inputs)
    results = {"match": 32, "not comparable": 4}
    assert {verdict: sum(row.verdict == verdict for row in numbers) for verdict in results} == results


def test_another_detector_is_not_set_against_the_papers(inputs: ReportInputs) -> None:
    rows = rows_of(BY_NAME["yolov7_direction_ap"], inputs)
    ours = [row for row in rows if np.isfinite(row.ours)]
    assert ours and all(row.verdict == NOT_COMPARABLE and "another detector" in row.why for row in ours)
    assert "σ 10 DN, 0 °, 7 px" in {row.quantity for row in ours} or len(ours) > 4


def test_what_did_not_run_says_how(inputs: ReportInputs) -> None:
    result = detection.section(inputs)
    notes = {(block.title, block.why): block.line for block in result.blocks if isinstance(block, NotRun)}
    assert notes["Detection by YOLOv4", "weights absent"].startswith("camera-monitor weights get yolov4")
    assert notes["Object detection under blur and noise on KITTI", "data absent"] == ABSENT["kitti"]
    ran = {(run.experiment, run.dataset) for run in result.runs if run.ran}
    assert ("Detection by Compact", "sim") in ran
    nothing = dataclasses.replace(inputs, data=None, recorded=None)
    bare = detection.section(nothing)
    assert not detection_results.read(nothing)
    assert ABSENT["kitti"] in {block.line for block in bare.blocks if isinstance(block, NotRun)}


def test_recorded_sweeps_are_a_state_of_the_overview_and_show_their_precision(inputs: ReportInputs) -> None:
    record = next(one for one in detection_results.recorded(inputs) if one.name == "kitti_yolox")
    requested = dataclasses.replace(inputs, detectors_absent={"yolox": "get yolox", "yolov4": "get yolov4"})
    section = detection.section(requested)
    states = {(run.experiment, run.dataset): run.state for run in section.runs}
    assert states["Detection by YOLOX", "kitti"] == "recorded"
    assert states["Detection by YOLOX", "sim"] == states["Detection by YOLOv4", ""] == "absent"
    table = next(block for block in section.blocks if getattr(block, "name", "") == "recorded_kitti_yolox_ap")
    assert isinstance(table, Table) and f"{record.objects} objects" in table.caption
    clean = record.results.precision
    clean = clean[(clean["label"] == "car") & (clean["kernel_size_px"] == 0) & (clean["target_sigma_dn"] == 0)][
        "ap_percent"
    ].iloc[0]
    first = table.rows[0]["clean"]
    assert isinstance(first, Estimate) and first.value == clean and first.low < clean < first.high


@pytest.mark.full("two pages take 10 s")
@pytest.mark.slow
def test_the_page_is_built_twice_with_the_same_bytes(inputs: ReportInputs, tmp_path: Path) -> None:
    alone = dataclasses.replace(inputs, recorded=None)  # figures of records: in the next test
    for name in ("first", "second"):
        build(alone, tmp_path / name)
    for path in sorted((tmp_path / "first").rglob("*")):
        if path.is_file():
            assert path.read_bytes() == (tmp_path / "second" / path.relative_to(tmp_path / "first")).read_bytes()
    assert {"regression_sim.svg", "iopc_heat_sim.svg"} <= {path.name for path in (tmp_path / "first/figures").iterdir()}
    page = (tmp_path / "first/index.html").read_text()
    assert "Object detection under blur and noise" in page and "Compact, two stages" in page


@pytest.mark.full("figures of two records, twice, take 12 s")
def test_figures_of_records_drawn_twice_are_the_same_bytes(inputs: ReportInputs, tmp_path: Path) -> None:
    written = []
    for index in ("a", "b"):
        blocks = detection.section(inputs).blocks
        shown = [block for block in blocks if isinstance(block, Figure) and block.name.startswith("recorded_")]
        assert "recorded_kitti_yolox_iopc_heat" in [block.name for block in shown]
        paths = [style.save(block.drawing.figure, tmp_path / index / block.name) for block in shown]
        written.append([path.read_bytes() for each in paths for path in each])
    assert written[0] == written[1]
