"""The table of blurs nobody trained on: what the record says, nothing where there is none, no other file taken."""

import json
from pathlib import Path

import pytest

from pipeline.errors import InputError
from pipeline.report import unseen_kernels

RECORD = Path(__file__).resolve().parents[2] / "benchmarks/results/unseen_kernels.json"


def test_the_committed_record_is_shown_number_by_number():
    table = unseen_kernels.table(RECORD)
    content = json.loads(RECORD.read_text(encoding="utf-8"))
    photos = [row for row in table.rows if row["dataset"] == "Photos"]
    ways = {"raw": "", "typical": ", typical lens", "calibrated": ", calibrated", "fitted": ", fitted"}
    assert [row["estimator"] for row in photos[:4]] == [f"Spectral{said}" for said in ways.values()]
    for row, way in zip(photos, ways, strict=False):
        found = content["results"]["photos"]["spectral"][way]
        per_kernel = found["amae_percent"].values()
        assert row["mean"] == pytest.approx(sum(per_kernel) / len(per_kernel), abs=2e-3)
        assert row["aberrated"] == found["mean_of_group_percent"]["aberrated"]
    assert f"{len(content['kernels'])} kernels" in table.footnotes[0]


def test_peers_stand_beside_the_network_on_the_same_patches():
    table = unseen_kernels.table(RECORD)
    for dataset in {str(row["dataset"]) for row in table.rows}:
        rows = [row for row in table.rows if row["dataset"] == dataset]
        peers = {row["patches"] for row in rows if row["estimator"] in ("PMP", "GBB")}
        assert peers <= {row["patches"] for row in rows if row["estimator"] == "Spectral"}


def test_no_record_is_no_table_and_another_file_is_refused(tmp_path):
    assert unseen_kernels.table(None) is None and unseen_kernels.table(tmp_path / "absent.json") is None
    (tmp_path / "other.json").write_text('{"machine": {}}')
    with pytest.raises(InputError, match="expected the record of a benchmark"):
        unseen_kernels.table(tmp_path / "other.json")
