"""Blur of real pictures comes from two committed records, number by number; a broken record is named."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from report_makers import REPO

from pipeline.errors import InputError
from pipeline.report.display_names import word
from pipeline.report.inputs import ReportInputs
from pipeline.report.sections import real_blur
from pipeline.report.tables import Estimate, Table

RECORDS = {name: REPO / f"benchmarks/results/{name}.json" for name in ("real_blur", "noisy_blur", "other_frames")}


def inputs(**records: Path) -> ReportInputs:
    return ReportInputs(paper=REPO / "data/paper", benchmarks=records)


def content(name: str) -> dict:
    return json.loads(RECORDS[name].read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def tables() -> dict[str, Table]:
    section = real_blur.section(inputs(**RECORDS))
    assert section is not None
    return {block.name: block for block in section.blocks if isinstance(block, Table)}


@pytest.mark.parametrize("name", RECORDS)
def test_a_record_is_shown_as_one_with_the_command_that_makes_it(name: str) -> None:
    section = real_blur.section(inputs(**{name: RECORDS[name]}))
    assert section is not None
    (run,) = section.runs
    assert run.state == "recorded" and run.line.startswith(f"python benchmarks/{name}.py")
    assert {block.stage for block in section.blocks if isinstance(block, Table)} == {run.line}


def test_every_photograph_and_the_means_over_them_are_shown(tables: dict[str, Table]) -> None:
    photographs = content("real_blur")["shake"]["photographs"]
    *rows, means = tables["real_blur_shake"].rows
    known = content("real_blur")["shake"]["summary"]
    assert [(row["scene"], row["kernel"]) for row in rows] == [(one["scene"], one["kernel"]) for one in photographs]
    for name in ("fused_own", "fused_other", "spectral_own", "spectral_other", "pmp", "gbb", "null"):
        shown = [row[name].value for row in rows]
        assert shown == [one["error_percent"][name] for one in photographs]
        assert all(np.isnan([row[name].low, row[name].high]).all() for row in rows)
        assert means[name].value == pytest.approx(np.mean(shown), abs=1e-3)
        assert [means[name].low, means[name].high] == [known[name][f"{end}_percent"] for end in ("low", "high")]
        assert means[name].low < means[name].value < means[name].high


def test_differences_have_their_intervals(tables: dict[str, Table]) -> None:
    pairs = content("real_blur")["pairs"]
    rows = tables["real_blur_pairs"].rows
    assert len(rows) == sum(isinstance(entry, dict) for about in pairs.values() for entry in about.values())
    first = pairs["cc"]["spectral"]
    cell = next(row for row in rows if (row["recording"], row["estimator"]) == ("CC", "Spectral"))
    assert cell["difference_percent"] == Estimate(*(first[f"{end}_percent"] for end in ("difference", "low", "high")))
    assert cell["held_percent"] == pytest.approx(100 * first["held_fraction"])


def test_strong_noise_is_shown_for_every_dataset_and_estimator(tables: dict[str, Table]) -> None:
    record = content("noisy_blur")
    rows = tables["real_blur_strong_noise"].rows
    assert len(rows) == sum(map(len, record["results"].values()))
    assert f"{record['sigma_dn']:g} DN" in tables["real_blur_strong_noise"].caption
    kitti = record["results"]["kitti"]["spectral"]
    row = next(row for row in rows if row["dataset"] == "KITTI" and str(row["estimator"]).startswith("Spectral"))
    for kind in real_blur.KINDS:
        value, low, high = (kitti[kind][f"amae_{end}percent"] for end in ("", "low_", "high_"))
        assert row[kind] == Estimate(value, low, high) and low < value < high


def test_every_error_on_other_frames_is_shown(tables: dict[str, Table]) -> None:
    record = content("other_frames")
    named = ("dataset", "estimator", "blur")
    rows = {tuple(str(row[name]) for name in named): row for row in tables["real_blur_other_frames"].rows}
    assert len(rows) == len(tables["real_blur_other_frames"].rows)
    for camera in record["cameras"]:
        for estimator, results in camera["estimators"].items():
            key = (word(camera["calibrated_on"]["dataset"]), real_blur.ESTIMATORS[estimator])
            for name, part in (
                ("Table I", results["table_one"]["mean"]),
                ("Defocus under noise", results["noisy"]["defocus"]),
                ("Linear motion under noise", results["noisy"]["linear_motion"]),
                *([("Rendered optics", results["optics"]["mean"])] if "optics" in results else []),
            ):
                row = rows.pop((*key, name))
                shown = [row[measure] for measure in ("patch_error_percent", "coverage_percent")]
                assert shown == [part["patch_error_percent"], 100 * part["coverage"]]
                value, low, high = (part[f"amae_{end}percent"] for end in ("", "low_", "high_"))
                assert row["amae_percent"] == Estimate(value, low, high) and low < value < high
                assert row["calibrated_frames"] == camera["calibrated_on"]["frames"]
    assert not rows


def test_without_records_there_is_no_section_and_a_broken_one_is_named(tmp_path: Path) -> None:
    assert real_blur.section(inputs()) is None
    assert real_blur.section(inputs(real_blur=tmp_path / "real_blur.json")) is None
    (tmp_path / "real_blur.json").write_text('{"pairs": {"cc": {"pictures": 8, "spectral": {}}}}')
    with pytest.raises(InputError, match=r"real_blur\.json: .*python benchmarks/real_blur\.py"):
        real_blur.section(inputs(real_blur=tmp_path / "real_blur.json"))
    other = content("other_frames")
    camera = {"calibrated_on": {"dataset": "kitti", "frames": 1}, "estimators": {"spectral": {"frames": 1}}}
    for broken in (other | {"kernels": "foo"}, other | {"cameras": [camera]}):
        (tmp_path / "other_frames.json").write_text(json.dumps(broken))
        with pytest.raises(InputError, match=r"other_frames\.json: .*python benchmarks/other_frames\.py"):
            real_blur.section(inputs(other_frames=tmp_path / "other_frames.json"))
