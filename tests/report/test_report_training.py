"""The section of training reads any network's learning curve, and the weights beside it."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pandas as pd
import pytest
from report_makers import REPO

from pipeline.errors import InputError
from pipeline.learning.learning_curve import read
from pipeline.report import training_budget
from pipeline.report.display_names import qualified
from pipeline.report.inputs import ReportInputs
from pipeline.report.sections import training
from pipeline.report.spec import Figure, NotRun
from pipeline.report.tables import Estimate, Table

NOTHING = ReportInputs(paper=REPO / "data/paper")


def write(folder: Path, name: str, **measures: list[float | None]) -> None:
    count = len(next(iter(measures.values())))
    table = pd.DataFrame({"step": [100 * (number + 1) for number in range(count)], "loss": 1.0, **measures})
    table.to_csv(folder / f"{name}.csv", index=False)


def save(path: Path, shape: tuple[int, ...], **details: object) -> None:
    import torch

    from pipeline.learning.weights import save as save_weights

    save_weights(path, {"a": torch.zeros(shape), "b": torch.zeros(5)}, "made-up-1", **details)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write(
        tmp_path, "mtf_cnn", mtf_error_percent=[20.0, 9.0, 7.0, 6.0],
        validation_mtf_error_percent=[None, 10.0, None, 11.0], validation_mean_squared_error=[None, 0.02, None, 0.03],
    )  # fmt: skip
    settings = {"new_chunks_per_step": 2, "replays": 3, "recipe": {"views": 16, "kernels_per_view": 2}}
    save(tmp_path / "mtf_cnn.safetensors", (3, 4), step=200, settings=settings, device="cuda")
    write(tmp_path, "detector_compact", validation_ap=[0.1, 0.5, 0.8, 0.79], validation_loss=[3.0, 2.0, 1.0, 1.0])
    write(tmp_path, "sigma_cellwise", sigma_error_dn=[3.0, 1.0], validation_sigma_error_dn=[2.0, 0.5])
    return tmp_path


def test_curves_are_read_by_what_their_columns_say(folder: Path) -> None:
    (folder / ".writing-a.csv").touch()  # a training that was killed
    blur, noise, detector = read(folder)
    assert [training.network_title(one) for one in (blur, noise, detector)] == [
        "Blur: CNN",
        "Noise: Cell-wise",
        "Detector: Compact",
    ]
    assert (blur.parameters, blur.chosen, blur.samples, blur.steps) == (17, 200, 2 * 3 * 16 * 2, 400)
    assert (blur.measure, blur.unit, noise.unit, detector.measure) == ("mtf_error_percent", "%", "DN", "ap")
    assert blur.held_out().to_dict() == {200: 10.0, 400: 11.0}
    assert blur.at_release("validation_mtf_error_percent") == 10.0  # of the released step, not the last
    assert detector.at_release("validation_ap") == 0.79  # without weights, the last
    assert detector.training() is None and detector.parameters is None


def test_the_section_shows_budget_size_and_error_beside_the_papers(folder: Path) -> None:
    result = training.section(dataclasses.replace(NOTHING, weights=folder))
    figure, table = result.blocks[:2]
    assert isinstance(figure, Figure) and isinstance(table, Table)
    assert figure.stages == ("train_mtf@cnn", "train_sigma@cellwise", "train_detector@compact")
    assert "MTF error 10 %" in figure.drawing.alt
    row = table.rows[0]
    assert row["samples"] == 400 * 192 and row["released"] == 200 and row["released_samples"] == 200 * 192
    assert row["training"] == 9.0
    assert row["squared"] == Estimate(0.02, reference=0.0083) and row["device"] == "GPU"
    assert table.rows[1].get("device") is None  # without weights nobody knows
    assert row["parameters"] == Estimate(17, reference=6_757_384)
    missing = [block for block in result.blocks if isinstance(block, NotRun)]
    assert [block.line for block in missing] == ["dvc repro train_mtf@spectral"]


def test_titles_of_the_papers_networks_carry_their_own_share(folder: Path) -> None:
    inputs = dataclasses.replace(NOTHING, weights=folder)
    with qualified(training_budget.names(inputs)):
        titles = [training.network_title(one) for one in read(folder)]
    assert titles == ["Blur: CNN (at most 0.6 % of the paper’s samples)", "Noise: Cell-wise", "Detector: Compact"]


def test_one_panel_a_network_with_the_released_step_marked(folder: Path) -> None:
    curves = read(folder)
    drawing = training.curves_figure(curves)
    panels = [axes for axes in drawing.figure.axes if axes.axison]
    assert [axes.get_title() for axes in panels] == [training.network_title(one) for one in curves]
    marked = [line for line in panels[0].get_lines() if line.get_label() == "released"]
    assert marked[0].get_xydata().tolist() == [[200.0, 10.0]]
    assert drawing.values is not None
    counted = drawing.values.groupby(["network", "samples"]).size()
    assert counted["mtf_cnn", "held out"] == 2 and counted["mtf_cnn", "training"] == 4


def test_released_networks_have_curves_that_end_where_their_weights_say() -> None:
    curves = read(REPO / "data/weights")
    assert {"mtf_spectral", "sigma_cellwise"} <= {one.name for one in curves}
    for one in curves:
        assert one.parameters is not None and one.parameters > 10_000
        assert one.chosen in set(one.curve["step"])
        assert one.held_out().iloc[-1] < one.held_out().iloc[0] or one.measure == "ap"


def test_nothing_trained_is_said_and_a_foreign_table_is_refused(tmp_path: Path) -> None:
    result = training.section(NOTHING)
    assert all(isinstance(block, NotRun) for block in result.blocks) and len(result.blocks) == 3
    (tmp_path / "mtf_cnn.csv").write_text("epoch,loss\n1,2\n")
    with pytest.raises(InputError, match=r"mtf_cnn\.csv: expected a column 'step'"):
        read(tmp_path)


def test_short_trainings_stand_beside_each_other_with_the_spread_of_seeds(tmp_path: Path) -> None:
    from pipeline import store

    for name, error in {"base": 9.0, "seed_2": 9.4, "no_noise": 15.0}.items():
        measures = {"mtf_error_percent": error, "mtf_error_clean_percent": 8.0, "mtf_error_noisy_percent": error + 2}
        store.write_json(tmp_path / f"{name}.json", {**measures, "sigma_error_dn": 1.0})
    inputs = dataclasses.replace(NOTHING, ablation=tmp_path, ablations=("no_noise", "base", "seed_2", "seed_3"))
    table = next(block for block in training.section(inputs).blocks if isinstance(block, Table))
    assert [row["variant"] for row in table.rows] == [
        "no noise in training", "as released, but short", "another seed (2)",
    ]  # fmt: skip
    assert [row["all"] for row in table.rows] == [15.0, 9.0, 9.4]
    assert "0.40 %" in " ".join(table.footnotes)


def test_the_released_training_stands_beside_the_shorter_ones(tmp_path: Path) -> None:
    from pipeline import store

    store.write_json(tmp_path / "base.json", {"mtf_error_percent": 9.0, "mtf_error_isotropic_percent": 9.5})
    curve = tmp_path / "mtf_spectral.csv"
    curve.write_text("step,loss,mtf_error_percent,validation_mtf_error_percent\n10,1.0,5.0,4.5\n20,0.9,4.0,3.5\n")
    inputs = dataclasses.replace(NOTHING, weights=tmp_path, ablation=tmp_path, ablations=("base",))
    table = training.ablation(inputs, read(tmp_path))
    assert table is not None
    assert [(row["variant"], row["all"]) for row in table.rows] == [
        ("released (full length)", 3.5), ("as released, but short", 9.0),
    ]  # fmt: skip
    assert "isotropic" not in table.rows[0]
