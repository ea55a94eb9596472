"""The chapter of blur estimation: what its figures and tables show, what the ledger takes from it, what is refused."""

from __future__ import annotations

import csv
import dataclasses
import math
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from blur_makers import BIAS, add_blur, bank
from report_makers import ABSENT, REPO, make_star

from pipeline import store
from pipeline.camera import mtf
from pipeline.errors import InputError
from pipeline.experiments.sharp_curves import NOMINAL_FREQUENCIES, sharp_curves, sharp_errors
from pipeline.report.build import build
from pipeline.report.inputs import Arrays, ReportInputs, published_table
from pipeline.report.ledger import sources as ledger_sources
from pipeline.report.ledger.items import ITEMS, rows_of
from pipeline.report.sections import blur, blur_amae, kernel_gallery
from pipeline.report.sections.kernel_gallery import Gallery
from pipeline.report.spec import Figure, NotRun
from pipeline.report.tables import Estimate, Table

BY_NAME = {item.name: item for item in ITEMS}
SIZES = (3, 21)


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> ReportInputs:
    """Blur estimates of Sim and KITTI by three estimators, and Sim's star."""
    root = tmp_path_factory.mktemp("blur")
    make_star(root / "star")
    nothing = ReportInputs(paper=REPO / "data/paper", absent={"udacity": ABSENT["udacity"]})
    made = add_blur(nothing, root, ("sim", "kitti"), ("spectral", "pmp", "gbb"), SIZES)
    return dataclasses.replace(made, members={"index": ("sim", "kitti")})


@pytest.fixture(scope="module")
def summary(inputs: ReportInputs) -> pd.DataFrame:
    return inputs.noiseless("blur_summary")


@pytest.fixture(scope="module")
def paper() -> pd.DataFrame:
    return published_table(REPO / "data/paper/blur_amae.csv")


@pytest.fixture(scope="module")
def published(paper: pd.DataFrame) -> dict[tuple[str, str, str, float], float]:
    return paper.set_index(["dataset", "estimator", "blur_kind", "kernel_size_px"])["amae_percent"].to_dict()


def artists(figure: object, prefix: str) -> list:
    return figure.findobj(lambda artist: (artist.get_gid() or "").startswith(prefix))  # type: ignore[attr-defined]


def test_members_of_other_runs_are_left_out(inputs: ReportInputs) -> None:
    one = dataclasses.replace(inputs, members={"blur": ("sim-pmp",)})
    assert one.noiseless("blur_summary")[["dataset", "estimator"]].drop_duplicates().values.tolist() == [["sim", "pmp"]]
    assert dataclasses.replace(inputs, members={}).noiseless("blur_summary")["estimator"].nunique() == 3
    assert dataclasses.replace(inputs, data=None).noiseless("blur_estimates").empty


def test_sharp_curves_are_robust_medians_of_sharp_patches(inputs: ReportInputs) -> None:
    estimates = inputs.noiseless("blur_estimates")
    curves = sharp_curves(estimates)
    assert len(curves) == 2 * 3 * 2 * 8 and (curves["abstained"] == 1).all()
    assert (curves["count"] + curves["abstained"] == 8).all()
    camera = np.exp(-0.6 * mtf.FREQUENCIES)
    for _, curve in curves.groupby(["dataset", "estimator", "axis"]):
        assert curve["median"].to_numpy() == pytest.approx(camera, abs=0.02)
        assert curve["frequency"].tolist() == list(NOMINAL_FREQUENCIES)
    spoilt = estimates.copy()
    here = (spoilt["kernel"] == "sharp") & (spoilt["frame"].str.endswith("0000")) & (spoilt["patch"] == 0)
    spoilt.loc[here, "mtf"] = 0.0
    again = sharp_curves(spoilt)
    assert (again["rejected"] >= 1).all() and (again["min"] > 0.5).all()


def test_a_curve_of_nothing_but_abstentions_is_nan(inputs: ReportInputs) -> None:
    estimates = inputs.noiseless("blur_estimates").assign(mtf=np.nan, abstained=True)
    curves = sharp_curves(estimates)
    assert curves["median"].isna().all() and (curves["count"] == 0).all() and (curves["rejected"] == 0).all()


def test_nominal_frequencies_are_the_bins_in_order() -> None:
    assert np.abs(mtf.FREQUENCIES - NOMINAL_FREQUENCIES).max() < 0.015


def test_the_figure_of_sharp_curves_shows_ours_theirs_and_the_star(inputs: ReportInputs) -> None:
    curves = sharp_curves(inputs.noiseless("blur_estimates"))
    paper = published_table(REPO / "data/paper/uncorrupted_mtf.csv")
    star = (np.array([0.1, 0.5, 0.9]), np.array([0.98, 0.8, 0.4]))
    drawing = blur.uncorrupted(curves, ["sim", "kitti", "udacity"], paper, {"sim": star})
    lines = artists(drawing.figure, "series--pmp--median")
    assert len(lines) == 4  # two datasets, two directions
    selected = curves[(curves["dataset"] == "sim") & (curves["estimator"] == "pmp") & (curves["axis"] == "H")]
    assert np.asarray(lines[0].get_ydata()) == pytest.approx(selected["median"].to_numpy())
    assert np.asarray(lines[0].get_xdata()) == pytest.approx(mtf.FREQUENCIES)
    assert len(artists(drawing.figure, "series--cnn--paper")) == 3  # horizontal only, Udacity too
    texts = [text.get_text() for axes in drawing.figure.axes for text in axes.texts]
    assert texts.count("not run") == 2 and any("PMP abstained 1 of 8" in text for text in texts)
    legend = [text.get_text() for text in drawing.figure.legends[0].get_texts()]
    assert legend == ["CNN (paper's only)", "PMP", "GBB", "Spectral", "the paper's", "Siemens star"]
    assert "Siemens star of Sim" in drawing.alt and "0.59 of Nyquist" in drawing.alt


def test_the_figure_of_amae_draws_each_cell(summary: pd.DataFrame) -> None:
    raw = summary[~summary["calibrated"] & (summary["blur_kind"] != "sharp")]
    drawing = blur_amae.curves(raw, ["sim", "kitti"], published_table(REPO / "data/paper/blur_amae.csv"))
    line = artists(drawing.figure, "series--gbb--amae_sim_defocus")[0]
    cells = raw[(raw["dataset"] == "sim") & (raw["estimator"] == "gbb") & (raw["blur_kind"] == "defocus")]
    assert np.asarray(line.get_ydata()) == pytest.approx(cells.sort_values("kernel_size_px")["amae_percent"].to_numpy())
    assert len(artists(drawing.figure, "series--cnn--paper")) == 6 and not artists(drawing.figure, "series--cnn--amae")
    assert drawing.values.set_index(["dataset", "blur_kind", "kernel_size_px", "estimator"]).loc[
        ("sim", "defocus", 3.0, "pmp"), "paper_amae_percent"
    ] == pytest.approx(13.9)
    assert f"GBB {raw[raw['estimator'] == 'gbb']['amae_percent'].mean():.1f} %" in drawing.alt


def test_table_one_sets_the_papers_value_beside_each_cell(summary: pd.DataFrame, paper: pd.DataFrame) -> None:
    table = blur_amae.table_one("sim", blur_amae.without_unknown_lenses(summary), paper, False)
    assert [row["blur"] for row in table.rows] == [
        *(f"{kind} {size}" for kind in "DLN" for size in (3, 7, 11, 15, 21)), "Mean"
    ]  # fmt: skip
    ran = next(row for row in table.rows if row["blur"] == "D 21")
    assert isinstance(ran["pmp"], Estimate) and ran["pmp"].reference == 6.7 and ran["pmp"].count == 7
    selected = summary[(summary["dataset"] == "sim") & ~summary["calibrated"] & (summary["kernel_size_px"] == 21)]
    cell = selected[(selected["blur_kind"] == "defocus") & (selected["estimator"] == "pmp")].iloc[0]
    assert ran["pmp"].value == cell["amae_percent"] and ran["pmp"].low == cell["low_percent"]
    values = selected[selected["blur_kind"] == "defocus"].set_index("estimator")["amae_percent"]
    assert str(ran["best"]).lower() == values.idxmin()
    assert isinstance(ran["cnn"], Estimate) and math.isnan(ran["cnn"].value) and ran["cnn"].reference == 1.1
    skipped = next(row for row in table.rows if row["blur"] == "L 7")  # not among our sizes
    assert isinstance(skipped["gbb"], Estimate) and math.isnan(skipped["gbb"].value) and skipped["best"] == ""


def test_sharp_frames_are_evaluated_against_their_lens(
    inputs: ReportInputs, summary: pd.DataFrame, paper: pd.DataFrame
) -> None:
    estimates, lens = inputs.noiseless("blur_estimates"), ledger_sources.lenses(inputs)
    errors = sharp_errors(estimates, lens, 1, 50)
    assert set(errors["dataset"]) == {"sim"} == set(lens)  # the lens of a photograph is not known
    curves = sharp_curves(estimates, draws=0)
    for row in errors.itertuples():
        selected = curves[(curves["dataset"] == "sim") & (curves["estimator"] == row.estimator)]
        both = [selected.loc[selected["axis"] == axis, "median"].to_numpy() - lens["sim"] for axis in "HV"]
        assert row.amae_percent == pytest.approx(100 * np.abs(both).mean())
        assert row.low_percent <= row.amae_percent <= row.high_percent
        assert row.count + row.abstained == 8
    shown = blur_amae.without_unknown_lenses(summary, errors)
    first = blur_amae.table_one("sim", shown, paper, False).rows[0]
    assert first["blur"] == "None (sharp)" and isinstance(first["pmp"], Estimate)
    assert first["pmp"].value == errors.set_index("estimator")["amae_percent"]["pmp"]
    assert blur_amae.table_one("kitti", shown, paper, False).rows[0]["blur"] == "D 3"


def test_means_of_table_one_are_over_the_same_kernels(
    summary: pd.DataFrame, paper: pd.DataFrame, published: dict
) -> None:
    mean = blur_amae.table_one("sim", summary, paper, False).rows[-1]
    selected = summary[(summary["dataset"] == "sim") & ~summary["calibrated"] & (summary["blur_kind"] != "sharp")]
    pmp = selected[selected["estimator"] == "pmp"]
    assert isinstance(mean["pmp"], Estimate)
    assert mean["pmp"].value == pytest.approx(pmp["amae_percent"].mean())
    theirs = [published["sim", "pmp", row.blur_kind, row.kernel_size_px] for row in pmp.itertuples()]
    assert mean["pmp"].reference == pytest.approx(np.mean(theirs))
    assert isinstance(mean["cnn"], Estimate)
    assert mean["cnn"].reference == pytest.approx(np.mean([v for k, v in published.items() if k[:2] == ("sim", "cnn")]))


def test_calibrated_answers_stand_in_a_table_of_their_own(summary: pd.DataFrame, paper: pd.DataFrame) -> None:
    table = blur_amae.table_one("kitti", summary, paper, True)
    assert [row["blur"] for row in table.rows] == ["D 3", "D 21", "L 3", "L 21", "N 3", "N 21", "Mean"]
    cells = [cell for row in table.rows for cell in row.values() if isinstance(cell, Estimate)]
    assert all(cell.reference is None for cell in cells)  # the paper calibrates nothing
    raw = blur_amae.table_one("kitti", summary, paper, False).rows[-1]["spectral"]
    selected = table.rows[-1]["spectral"]
    assert isinstance(raw, Estimate) and isinstance(selected, Estimate) and selected.value < 0.5 * raw.value


def test_ours_stands_beside_the_papers_best_of_three(summary: pd.DataFrame, paper: pd.DataFrame) -> None:
    table = blur_amae.beside_the_best(summary, paper)
    assert table is not None
    assert [column.name for column in table.columns][2:4] == ["spectral", "spectral_calibrated"]
    assert [row["dataset"] for row in table.rows] == ["Sim"] * 7 + ["KITTI"] * 7
    row = next(row for row in table.rows if (row["dataset"], row["blur"]) == ("Sim", "N 21"))
    assert (row["cnn"], row["best"], row["which"]) == (25.0, 11.5, "PMP")
    assert table.rows[6]["best"] == pytest.approx(np.mean([row["best"] for row in table.rows[:6]]))
    calibrated = summary[(summary["estimator"] == "spectral") & summary["calibrated"]]
    both = pd.concat([summary, calibrated.assign(estimator="camera_calibrated")])
    beside = blur_amae.beside_the_best(both, paper)
    assert beside is not None  # an estimator without raw estimates has one column, of its name
    assert [column.name for column in beside.columns][2:5] == ["spectral", "spectral_calibrated", "camera_calibrated"]
    photos = summary.assign(dataset="photos")
    assert blur_amae.beside_the_best(photos, paper) is None
    assert blur_amae.beside_the_best(summary[summary["estimator"] == "pmp"], paper) is None


def test_abstentions_are_counted_once_a_patch(inputs: ReportInputs, summary: pd.DataFrame) -> None:
    table = blur_amae.abstentions(summary, inputs.noiseless("blur_estimates"))
    kernels = 1 + len(bank(SIZES))
    assert len(table.rows) == 6
    for row in table.rows:
        assert (row["asked"], row["abstained"], row["reasons"]) == (8 * kernels, kernels, f"flat: {kernels}")
    coverage = {str(row["estimator"]): row["coverage_percent"] for row in table.rows}
    assert math.isnan(coverage["PMP"]) and 0 < coverage["Spectral"] <= 100  # type: ignore[arg-type,operator]


NO_CURVES = pd.DataFrame(columns=kernel_gallery.CURVES)


def galleries(inputs: ReportInputs, dataset: str = "sim") -> list[Gallery]:
    made = []
    for name in ("pmp", "gbb"):
        about = store.read_json(inputs.data / "blur" / f"{dataset}-{name}" / "gallery.json")
        made.append((about, inputs.arrays(f"blur/{dataset}-{name}/gallery.npz")))
    return made


def test_the_gallery_shows_truth_and_estimates_at_one_scale(inputs: ReportInputs) -> None:
    shown = galleries(inputs)
    pmp = kernel_gallery._curves(shown[0][0])
    other = pmp[pmp["kernel"] == "defocus_3"].assign(estimator="spectral", mtf=np.linspace(1, 0.5, 16))
    drawing = kernel_gallery.draw(shown, other)
    # Six blurs: a patch, a true kernel, and a kernel of each estimator but for GBB's one abstention.
    assert sum(len(axes.images) for axes in drawing.figure.axes) == 6 * 4 - 1
    texts = [text.get_text() for axes in drawing.figure.axes for text in axes.texts]
    assert sum(text.startswith("abstained:") for text in texts) == 1
    assert len(artists(drawing.figure, "series--pmp--")) == 12 and len(artists(drawing.figure, "series--gbb--")) == 10
    assert len(artists(drawing.figure, "series--spectral--")) == 2
    assert "GBB mean AMAE" in drawing.alt and "1 abstained" in drawing.alt
    assert set(drawing.values["estimator"]) == {"pmp", "gbb", "spectral"}
    small = next(e for e in shown[0][0]["kernels"] if e["kernel"] == "defocus_3")
    selected = drawing.values[(drawing.values["kernel"] == "defocus_3") & (drawing.values["estimator"] == "pmp")]
    assert selected["mtf"].to_numpy() == pytest.approx(np.ravel(small["mtf"]))
    wide = [axes.get_xlim() for axes in drawing.figure.axes if axes.images and axes.get_title() in ("true", "PMP")]
    assert set(wide) == {(-5.5, 5.5)}


def test_galleries_that_do_not_fit_are_refused(inputs: ReportInputs) -> None:
    (about, arrays), (other, of_other) = galleries(inputs)
    with pytest.raises(InputError, match="no array 'truth_defocus_3'"):
        without = {name: array for name, array in arrays.items() if name != "truth_defocus_3"}
        kernel_gallery.draw([(about, Arrays(without))], NO_CURVES)
    with pytest.raises(InputError, match="other kernels than 'pmp'"):
        kernel_gallery.draw([(about, arrays), ({**other, "kernels": other["kernels"][1:]}, of_other)], NO_CURVES)


def test_the_section_shows_everything_and_says_what_did_not_run(inputs: ReportInputs) -> None:
    section = blur.section(inputs)
    figures = [block.name for block in section.blocks if isinstance(block, Figure)]
    assert figures == [
        "uncorrupted_mtf", "blur_amae", "blur_amae_calibrated", "kernel_estimates_sim", "kernel_estimates_kitti"
    ]  # fmt: skip
    tables = {block.name for block in section.blocks if isinstance(block, Table)}
    assert tables == {
        "blur_amae_sim", "blur_amae_sim_calibrated", "blur_amae_kitti", "blur_amae_kitti_calibrated",
        "blur_beside_the_best", "blur_abstentions",
    }  # fmt: skip
    missing = [block for block in section.blocks if isinstance(block, NotRun)]
    assert [(block.why, block.line) for block in missing] == [("data absent", ABSENT["udacity"])]
    assert sum(run.ran for run in section.runs) == 6 and len(section.runs) == 9
    drawing = next(b for b in section.blocks if isinstance(b, Figure) and b.name == "kernel_estimates_sim").drawing
    assert drawing.values is not None and set(drawing.values["estimator"]) == {"pmp", "gbb", "spectral"}


def test_without_results_the_section_names_the_stage() -> None:
    section = blur.section(ReportInputs(paper=REPO / "data/paper", absent=ABSENT))
    (block,) = section.blocks
    assert isinstance(block, NotRun) and block.line == "dvc repro blur@<dataset>-<estimator>"
    assert [run.ran for run in section.runs] == [False]


def test_members_that_did_not_run_and_absent_galleries_are_noted(inputs: ReportInputs) -> None:
    requested = ("sim-cnn", "sim-spectral")
    sim = dataclasses.replace(inputs, members={"blur": requested, "index": ("sim",)})
    lines = {block.line for block in blur.section(sim).blocks if isinstance(block, NotRun)}
    assert {"dvc repro blur@sim-cnn", "dvc repro blur@sim-pmp"} <= lines


def test_galleries_of_different_patches_are_refused(inputs: ReportInputs, tmp_path: Path) -> None:
    import shutil

    for name in ("pmp", "gbb"):
        shutil.copytree(inputs.data / f"blur/sim-{name}", tmp_path / f"blur/sim-{name}")
    content = store.read_json(tmp_path / "blur/sim-gbb/gallery.json")
    store.write_json(tmp_path / "blur/sim-gbb/gallery.json", {**content, "frame": "another"})
    with pytest.raises(InputError, match="show different frames or patches"):
        blur.section(dataclasses.replace(inputs, data=tmp_path))
    store.write_json(tmp_path / "blur/sim-gbb/gallery.json", {"kernels": []})
    with pytest.raises(InputError, match="expected an object with dataset, estimator, frame, patch"):
        blur.section(dataclasses.replace(inputs, data=tmp_path))


def test_the_ledger_compares_same_names_but_not_our_sim(inputs: ReportInputs, summary: pd.DataFrame) -> None:
    rows = rows_of(BY_NAME["blur_amae"], inputs)
    assert len(rows) == 135
    ran = [row for row in rows if math.isfinite(row.ours)]
    assert len(ran) == 2 * 2 * 6  # datasets, estimators of the paper's names, kernels
    sim = [row for row in ran if row.quantity.startswith("Sim")]
    assert {row.verdict for row in sim} == {"not comparable"} and all("rendered here" in row.why for row in sim)
    kitti = next(row for row in ran if row.quantity.startswith("KITTI, GBB, Defocus, 21 px"))
    selected = summary[(summary["dataset"] == "kitti") & (summary["estimator"] == "gbb") & ~summary["calibrated"]]
    cell = selected[(selected["blur_kind"] == "defocus") & (selected["kernel_size_px"] == 21)].iloc[0]
    assert kitti.ours == cell["amae_percent"] and kitti.verdict in ("match", "better", "close", "differs")
    assert any("frames than the paper's" in row.why for row in ran if row.verdict == "differs")
    cnn = next(row for row in rows if row.quantity.startswith("KITTI, CNN"))
    assert cnn.verdict == "not run" and cnn.line == "dvc repro blur@kitti-cnn"


def test_the_ledger_takes_sharp_curves_and_the_star(inputs: ReportInputs) -> None:
    rows = rows_of(BY_NAME["uncorrupted_mtf"], inputs)
    assert len(rows) == 224
    ran = [row for row in rows if math.isfinite(row.ours)]
    assert len(ran) == 8 + 2 * 2 * 24  # the star, and two estimators of the paper's names on two datasets
    star = [row for row in rows if "Ground truth" in row.quantity]
    assert {row.line for row in star} == {"dvc repro star"} and all(row.comparable for row in star)
    sim = [row for row in ran if row.quantity.startswith("Sim") and row not in star]
    assert {row.verdict for row in sim} == {"not comparable"}
    assert BIAS["pmp"] > 0  # so that what follows compares with a known answer: sharp frames carry no bias
    median = [row.ours for row in ran if row.quantity.startswith("KITTI, PMP, median")]
    assert median == pytest.approx(np.exp(-0.6 * mtf.FREQUENCIES), abs=0.02)


@pytest.mark.full("a page takes 9 s")
@pytest.mark.slow
def test_the_page_holds_the_chapter_with_its_files(inputs: ReportInputs, tmp_path: Path) -> None:
    build(inputs, tmp_path)
    text = (tmp_path / "index.html").read_text(encoding="utf-8")
    for name in ("uncorrupted_mtf", "blur_amae", "blur_amae_calibrated", "kernel_estimates_sim"):
        assert f'id="figure-{name}"' in text and (tmp_path / f"figures/{name}.csv").exists()
    assert "blur@sim-pmp" in text and 'data-series="spectral"' in text
    ids = re.findall(r'\bid="([^"]+)"', text)
    assert len(ids) == len(set(ids))
    with (tmp_path / "tables/blur_amae_sim.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert rows[1]["blur"] == "D 3" and float(rows[1]["pmp_reference"]) == 13.9 and float(rows[1]["pmp_low"]) > 0
    assert r"\toprule" in (tmp_path / "tables/blur_amae_sim.tex").read_text(encoding="utf-8")
