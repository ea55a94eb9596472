"""Disclosure: shares of the paper's training, modes, the upright prior and light are stated with their size."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import pandas as pd
import pytest
from report_makers import ABSENT, REPO

from pipeline import blur, store
from pipeline.learning.learning_curve import LearningCurve, read
from pipeline.learning.weights import details
from pipeline.report import build, training_budget
from pipeline.report.display_names import ESTIMATORS, qualified, word
from pipeline.report.inputs import ReportInputs, mode_note, mode_of, options_of
from pipeline.report.ledger.items import ITEMS, rows_of
from pipeline.report.sections import combined, disclosure
from pipeline.report.spec import Figure
from pipeline.report.tables import Table

NOTHING = ReportInputs(paper=REPO / "data/paper", absent=ABSENT)
TRAINED = dataclasses.replace(NOTHING, weights=REPO / "data/weights")


@pytest.mark.parametrize(
    ("percent", "words"), [(0.6438, "0.7"), (0.6, "0.6"), (2.01, "3"), (12.3, "13"), (9.2, "10"), (0.0312, "0.04")]
)
def test_shares_are_rounded_up(percent: float, words: str) -> None:
    assert training_budget.in_words(percent) == f"at most {words} % of the paper’s samples"
    assert training_budget.in_words(100 + percent) == "as many as the paper’s, as far as is known"


def test_shares_follow_from_the_record_of_the_training() -> None:
    percents = training_budget.percents(TRAINED)
    assert set(percents) == set(training_budget.PAPER_SAMPLES)
    for name, paper in training_budget.PAPER_SAMPLES.items():
        step = int(details(REPO / f"data/weights/{name}.safetensors")["step"])
        assert percents[name] / 100 * paper == pytest.approx(32 * step)  # the paper's batch
        assert step < pd.read_csv(REPO / f"data/weights/{name}.csv")["step"].max()
    assert training_budget.percents(NOTHING) == {}


@pytest.mark.parametrize(("chosen", "samples"), [(12_500, 400_000), (None, 470_400)])
def test_the_share_counts_samples_until_the_released_step(chosen: int | None, samples: int) -> None:
    curve = LearningCurve("sigma_cnn", pd.DataFrame({"step": [100, 14_700]}), "sigma_error_dn", 1, chosen, 32)
    assert training_budget.released_samples(curve) == samples
    assert training_budget.percent_of(curve) == pytest.approx(100 * samples / 469_656)
    assert training_budget.percent_of(dataclasses.replace(curve, name="sigma_cellwise")) is None
    assert training_budget.percent_of(dataclasses.replace(curve, samples=None)) is None


def test_the_name_of_the_papers_networks_carries_the_share_wherever_it_stands() -> None:
    names = training_budget.names(TRAINED)
    blur, noise = (training_budget.percents(TRAINED)[name] for name in ("mtf_cnn", "sigma_cnn"))
    words = f"blur: at most {training_budget.rounded_up(blur)} %; noise: at most {training_budget.rounded_up(noise)} %"
    assert max(blur, noise) < 100 and names == {"cnn": f"CNN ({words} of the paper’s samples)"}
    item = next(item for item in ITEMS if item.name == "blur_amae")
    with qualified(names):
        assert word("cnn") == names["cnn"] and word("pmp") == "PMP"
        rows = rows_of(item, TRAINED)
    assert "," not in names["cnn"]  # which separates the parts of the ledger's quantities
    assert sum(names["cnn"] in row.quantity for row in rows) == 45
    assert word("cnn") == ESTIMATORS["cnn"]


def test_what_is_of_one_task_carries_its_share_alone(tmp_path: Path) -> None:
    """A figure of blur says nothing of how long the noise network was trained."""
    shares = training_budget.percents(TRAINED)
    for task, network in (("blur", "mtf_cnn"), ("noise", "sigma_cnn")):
        name = f"CNN (at most {training_budget.rounded_up(shares[network])} % of the paper’s samples)"
        with training_budget.named(TRAINED, task):
            assert word("cnn") == name
    blurs, noises = ([task for task in build.TASKS.values() if task == one] for one in (build.BLUR, build.NOISE))
    assert set(build.TASKS) <= set(build.SECTIONS) and len(blurs) + len(noises) == len(build.TASKS)
    recorded = dataclasses.replace(TRAINED, recorded=REPO / "reports/recorded")
    section = build.Drawn(recorded, tmp_path)(combined.recorded)
    assert section is not None
    captions = [block.caption for block in section.blocks if isinstance(block, Figure | Table)]
    texts = [*captions, *(path.read_text(encoding="utf-8") for path in tmp_path.glob("*.svg"))]
    assert any("CNN (at most" in text for text in texts) and not any("noise: at most" in text for text in texts)


def test_a_mode_that_is_not_exact_is_named() -> None:
    assert mode_of({"options": {"mode": "fast"}}) == "fast"
    assert mode_of({"options": {"mode": "exact"}}) == mode_of({"options": {}}) == mode_of({}) == ""
    for kind in ("pmp", "gbb"):  # left out, it is the estimator's default
        assert mode_of({"kind": kind}) == mode_of({"kind": kind, "options": {"kernel_size": 25}}) == "fast"
        assert mode_of({"kind": kind, "options": {"mode": "exact"}}) == ""
        estimator = blur.create(kind)
        default = {"mode": estimator.mode, "kernel_size": estimator.kernel_size, "workers": estimator.workers}
        assert options_of({"kind": kind}) == default
        assert options_of({"kind": kind, "options": {"kernel_size": 25}}) == default | {"kernel_size": 25}
    assert options_of({"kind": "cnn", "options": {"seed": 1}}) == {"seed": 1} and mode_of({"kind": "cnn"}) == ""
    note = mode_note({"pmp": "fast", "gbb": "fast"}, ["gbb", "cnn"])
    assert note.startswith("GBB in fast mode") and mode_note({"pmp": "fast"}, ["cnn"]) == ""


def test_the_section_states_sizes_where_they_were_measured(tmp_path: Path) -> None:
    bare = "\n".join(disclosure.section(NOTHING).text)
    assert "upright prior" in bare and "encoded grey levels" in bare and "order study" not in bare
    for name, error in (("base", 7.0), ("isotropic", 7.5), ("seed_2", 7.8)):
        store.write_json(tmp_path / f"{name}.json", {"mtf_error_percent": error})
    (tmp_path / "order_study").mkdir()
    rows = [
        {"order": order, "light": light, "target_sigma_dn": sigma, "motion_px": motion, "amae_percent": amae,
         "ap_percent": 10 * amae}
        for light, order, amae in (
            ("encoded", "paper", 2.0),
            ("encoded", "detector", 9.0),
            ("linear", "paper", 9.0),
            ("linear", "detector", 3.0),
        )
        for sigma in (5.0, 15.0)
        for motion in (0.0, 11.0)
    ]  # fmt: skip
    pd.DataFrame(rows).to_parquet(tmp_path / "order_study/study.parquet")
    full = dataclasses.replace(TRAINED, ablation=tmp_path, data=tmp_path, modes={"pmp": "fast"})
    text = "\n".join(disclosure.section(full).text)
    assert "7.00 and 7.50 %" in text and "another seed the error is 7.80 %" in text and "PMP in fast mode" in text
    assert (
        "AMAE is 2.0 % in the paper's order and encoded light and 3.0 % behind the optics and in linear light" in text
    )
    assert "AP 20.0 and 30.0 % (means over motions of 0 and 11 px, of AMAE the median over frames; " in text
    for task, network in (("Blur", "mtf_cnn"), ("Noise", "sigma_cnn")):
        curve = next(curve for curve in read(TRAINED.weights) if curve.name == network)
        released, share = training_budget.released_samples(curve), training_budget.percent_of(curve)
        whole = f"of {32 * curve.steps:,} samples, {training_budget.in_words(share)}"
        assert f"{task}: CNN is released after {released:,} {whole}" in text


OUR_NETWORK = re.compile(r"(?<!R-)(?<!paper's )(?<!Paper, )(?<![Ii]ts )\bCNN\b")
"""The name of the paper's networks, where it is neither a detector's nor that of the paper's own training."""


def test_no_text_of_the_report_names_the_papers_networks_past_their_share() -> None:
    """`word` adds the share to the name, so that no module or text may hold the name itself."""
    folder = REPO / "pipeline/report"
    sources = [path for kind in ("py", "yaml", "html") for path in folder.rglob(f"*.{kind}")]
    naming = {path.name for path in sources if OUR_NETWORK.search(path.read_text(encoding="utf-8"))}
    assert naming == {"display_names.yaml"}


@pytest.mark.parametrize(
    ("noise", "name"),
    [(34.1, "CNN (blur: at most 3 %; noise: at most 35 % of the paper’s samples)"),
     (100.0, "CNN (blur: at most 3 % of the paper’s samples)")],
)  # fmt: skip
def test_the_name_states_the_share_of_each_network_that_saw_fewer(
    monkeypatch: pytest.MonkeyPatch, noise: float, name: str
) -> None:
    monkeypatch.setattr(training_budget, "percents", lambda _: {"mtf_cnn": 2.3, "sigma_cnn": noise})
    assert training_budget.names(NOTHING) == {"cnn": name}
    assert training_budget.names(NOTHING, "blur") == {"cnn": "CNN (at most 3 % of the paper’s samples)"}
    assert bool(training_budget.names(NOTHING, "noise")) == (noise < 100)
    monkeypatch.setattr(training_budget, "percents", lambda _: {"mtf_cnn": 100.0, "sigma_cnn": noise + 100})
    assert training_budget.names(NOTHING) == {}
