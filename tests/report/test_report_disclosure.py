"""Disclosure: shares of the paper's training, modes, the upright prior and light are stated with their size."""

from __future__ import annotations

import dataclasses
import re
import shutil
from pathlib import Path

import pandas as pd
import pytest
from report_makers import ABSENT, REPO

from pipeline import store
from pipeline.report import training_budget
from pipeline.report.display_names import ESTIMATORS, qualified, word
from pipeline.report.inputs import ReportInputs, mode_note, mode_of
from pipeline.report.ledger_items import ITEMS, rows_of
from pipeline.report.sections import claims, disclosure

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
    curve = pd.read_csv(REPO / "data/weights/mtf_cnn.csv")
    samples = percents["mtf_cnn"] / 100 * training_budget.PAPER_SAMPLES["mtf_cnn"]
    assert samples == pytest.approx(32 * curve["step"].max())  # the paper's batch
    assert training_budget.percents(NOTHING) == {}


def test_the_name_of_the_papers_networks_carries_the_share_wherever_it_stands() -> None:
    names = training_budget.names(TRAINED)
    blur, noise = (training_budget.percents(TRAINED)[name] for name in ("mtf_cnn", "sigma_cnn"))
    assert blur < 100 <= noise  # trained in full, the network for noise needs no words
    assert names == {"cnn": f"CNN (blur: at most {training_budget.rounded_up(blur)} % of the paper’s samples)"}
    item = next(item for item in ITEMS if item.name == "blur_amae")
    with qualified(names):
        assert word("cnn") == names["cnn"] and word("pmp") == "PMP"
        rows = rows_of(item, TRAINED)
    assert "," not in names["cnn"]  # which separates the parts of the ledger's quantities
    assert sum(names["cnn"] in row.quantity for row in rows) == 45
    assert word("cnn") == ESTIMATORS["cnn"]


def test_a_mode_that_is_not_exact_is_named() -> None:
    assert mode_of({"options": {"mode": "fast"}}) == "fast"
    assert mode_of({"options": {"mode": "exact"}}) == mode_of({"options": {}}) == mode_of({}) == ""
    note = mode_note({"pmp": "fast", "gbb": "fast"}, ["gbb", "cnn"])
    assert note.startswith("GBB in fast mode") and mode_note({"pmp": "fast"}, ["cnn"]) == ""


def test_the_section_states_sizes_where_they_were_measured(tmp_path: Path) -> None:
    bare = "\n".join(disclosure.section(NOTHING).text)
    assert "upright prior" in bare and "encoded grey levels" in bare and "order study" not in bare
    for name, error in (("base", 7.0), ("isotropic", 7.5)):
        store.write_json(tmp_path / f"{name}.json", {"mtf_error_percent": error})
    (tmp_path / "order_study").mkdir()
    rows = [
        {"order": order, "light": light, "target_sigma_dn": sigma, "amae_percent": amae, "ap_percent": 10 * amae}
        for light, order, amae in (
            ("encoded", "paper", 2.0),
            ("encoded", "detector", 9.0),
            ("linear", "paper", 9.0),
            ("linear", "detector", 3.0),
        )
        for sigma in (5.0, 15.0)
    ]
    pd.DataFrame(rows).to_parquet(tmp_path / "order_study/study.parquet")
    full = dataclasses.replace(TRAINED, ablation=tmp_path, data=tmp_path, modes={"pmp": "fast"})
    text = "\n".join(disclosure.section(full).text)
    assert "7.00 and 7.50 %" in text and "PMP in fast mode" in text
    assert (
        "AMAE is 2.0 % in the paper's order and encoded light and 3.0 % behind the optics and in linear light" in text
    )
    assert "AP 20.0 and 30.0 %" in text
    assert "Blur: CNN saw 3,280,000 samples, at most 48 % of the paper’s samples" in text
    assert "Noise: CNN saw 470,400 samples, as many as the paper’s, as far as is known" in text


OUR_NETWORK = re.compile(r"(?<!R-)(?<!paper's )(?<!Paper, )(?<![Ii]ts )\bCNN\b")
"""The name of the paper's networks, where it is neither a detector's nor that of the paper's own training."""


def test_no_text_of_the_report_names_the_papers_networks_past_their_share() -> None:
    """`word` adds the share to the name, so that no module or text may hold the name itself."""
    folder = REPO / "pipeline/report"
    sources = [path for kind in ("py", "yaml", "html") for path in folder.rglob(f"*.{kind}")]
    naming = {path.name for path in sources if OUR_NETWORK.search(path.read_text(encoding="utf-8"))}
    assert naming == {"display_names.yaml"}


def test_claims_on_the_papers_networks_carry_the_share() -> None:
    inputs = dataclasses.replace(
        TRAINED,
        recorded=REPO / "reports/recorded",
        benchmarks={"estimators": REPO / "benchmarks/results/estimators.json"},
    )
    with qualified(training_budget.names(inputs)):
        texts = [measured.text for _, measured in claims.measurements(inputs)]
    assert sum("CNN (blur: at most" in text for text in texts) >= 2
    assert not [text for text in texts if re.search(r"(?<!R-)CNN(?! \(blur: at most)", text)]


def test_the_name_states_both_shares_where_both_networks_had_fewer(tmp_path: Path) -> None:
    for name in training_budget.PAPER_SAMPLES:
        for kind in ("csv", "safetensors"):
            shutil.copy(REPO / f"data/weights/{name}.{kind}", tmp_path)
        curve = pd.read_csv(tmp_path / f"{name}.csv")
        curve[curve["step"] <= 5000].to_csv(tmp_path / f"{name}.csv", index=False)
    names = training_budget.names(dataclasses.replace(NOTHING, weights=tmp_path))
    assert names == {"cnn": "CNN (blur: at most 3 %; noise: at most 35 % of the paper’s samples)"}
