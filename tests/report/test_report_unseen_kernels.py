"""The table of rendered optics that no network was trained on: the record's numbers, nothing without a record."""

import json
from pathlib import Path

import pytest
from report_makers import REPO

from pipeline.errors import InputError
from pipeline.report.display_names import word
from pipeline.report.inputs import ReportInputs
from pipeline.report.sections import blur_amae
from pipeline.report.tables import Estimate

RECORD = REPO / "benchmarks/results/unseen_kernels.json"
INPUTS = ReportInputs(paper=REPO / "data/paper", benchmarks={"unseen_kernels": RECORD})


@pytest.fixture(scope="module")
def content() -> dict:
    return json.loads(RECORD.read_text(encoding="utf-8"))


def test_the_committed_record_is_shown_number_by_number(content: dict) -> None:
    table = INPUTS.benchmark(blur_amae.UNSEEN, blur_amae.unseen_kernels)
    assert table is not None and table.stage == blur_amae.UNSEEN.command
    photos = [row for row in table.rows if row["dataset"] == "Photos"]
    answers = {
        "raw": "",
        "generic_lens": ", generic lens",
        "calibrated": ", calibrated",
        "camera_calibrated": ", camera-calibrated",
    }
    assert [row["estimator"] for row in photos[:4]] == [f"Spectral{suffix}" for suffix in answers.values()]
    for row, answer in zip(photos, answers, strict=False):
        result = content["results"]["photos"]["spectral"][answer]
        per_kernel = result["amae_percent"].values()
        mean = row["mean"]
        assert isinstance(mean, Estimate) and mean.value == pytest.approx(sum(per_kernel) / len(per_kernel), abs=2e-3)
        assert [mean.low, mean.high] == result["mean_interval_percent"] and mean.low <= mean.value <= mean.high
        assert row["aberrated"] == result["mean_of_group_percent"]["aberrated"]
    assert f"{len(content['kernels'])} kernels" in table.footnotes[0]


def test_peers_stand_beside_the_network_on_the_same_patches() -> None:
    table = INPUTS.benchmark(blur_amae.UNSEEN, blur_amae.unseen_kernels)
    assert table is not None
    for dataset in {str(row["dataset"]) for row in table.rows}:
        rows = [row for row in table.rows if row["dataset"] == dataset]
        peers = {row["patches"] for row in rows if row["estimator"] in ("PMP", "GBB")}
        assert peers <= {row["patches"] for row in rows if row["estimator"] == "Spectral"}


def test_the_fused_estimator_stands_once_beside_the_network(content: dict) -> None:
    table = INPUTS.benchmark(blur_amae.UNSEEN, blur_amae.unseen_kernels)
    assert table is not None
    rows = {row["dataset"]: row["mean"].value for row in table.rows if row["estimator"] == "Fused, camera-calibrated"}
    means = {word(name): about["fused"]["camera_calibrated"]["mean_amae_percent"] for name, about in
             content["results"].items()}  # fmt: skip
    assert rows == means


def test_no_record_is_no_table_and_another_file_is_refused(tmp_path: Path) -> None:
    nothing = ReportInputs(paper=REPO / "data/paper", benchmarks={"unseen_kernels": tmp_path / "absent.json"})
    assert nothing.benchmark(blur_amae.UNSEEN, blur_amae.unseen_kernels) is None
    (tmp_path / "other.json").write_text('{"machine": {}}')
    other = ReportInputs(paper=REPO / "data/paper", benchmarks={"unseen_kernels": tmp_path / "other.json"})
    with pytest.raises(InputError, match=r"other\.json: expected an object with kernels, results"):
        other.benchmark(blur_amae.UNSEEN, blur_amae.unseen_kernels)
    (tmp_path / "other.json").write_text('{"kernels": [], "results": {"kitti": []}}')
    with pytest.raises(InputError, match=r"other\.json: not a record of .*benchmarks/unseen_kernels\.py"):
        other.benchmark(blur_amae.UNSEEN, blur_amae.unseen_kernels)
