"""Recorded datasets run through the same stages as the rendered ones, and the report says which were absent."""

import html
from pathlib import Path

import composed
import pytest

from pipeline import store, tables
from pipeline.config.schema import validate
from pipeline.stages import corrupt, index, noise, report

ROOT = Path(__file__).resolve().parents[1]


@pytest.mark.shared
@pytest.mark.slow
@pytest.mark.full("two graphs and reports take 16 s")
@pytest.mark.parametrize("name", ["kitti", "udacity"])
def test_recorded_frames_run_through_the_graph_and_into_a_report(shared, tmp_path, monkeypatch, name):
    overrides = [
        "profile=smoke",
        f"+dataset@datasets.{name}={name}",
        f"datasets.{name}.root={shared / 'realdata' / name}",
        f"datasets.{name}.limit=2",
        "corruption.target_sigmas_dn=[0,15]",
        "corruption.noise_sources=[dcsn]",
        "executor.workers=1",
    ]
    content = composed.content(*overrides)
    content["datasets"] = {name: content["datasets"][name]}
    content["matrix"]["datasets"] = [name]
    config = validate(content)
    index.run.run(config, {"dataset": name}, tmp_path, tmp_path)
    corrupt.run.run(config, {"dataset": name}, tmp_path, tmp_path)
    for estimator in ("pca", "bf"):
        noise.run.run(config, {"dataset": name, "estimator": estimator}, tmp_path, tmp_path)
    for file in ("data/paper", "dvc.yaml"):
        (tmp_path / file).symlink_to(ROOT / file)
    monkeypatch.chdir(tmp_path)  # a project without records, whose figures take ten times as long
    report.run.run(config, {}, tmp_path, tmp_path)
    frames = store.read_table(tmp_path / "data/index" / name / "frames.parquet", tables.FRAMES)
    assert len(frames) == 2
    assert (frames["objects"] > 0).any()
    summary = store.read_table(tmp_path / f"data/noise/{name}-pca/summary.parquet", tables.NOISE_SUMMARY)
    noisy = summary[summary["target_sigma_dn"] == 15].iloc[0]
    assert abs(noisy["median_dn"] - noisy["clipped_median_dn"]) < 1.5
    page = (tmp_path / "reports/index.html").read_text()
    absent = {"kitti": "udacity", "udacity": "kitti"}[name]
    assert "data absent" in page
    assert f"dataset@datasets.{absent}={absent}" in config.report.not_run[absent]
    assert html.escape(config.report.not_run[absent], quote=False) in page
    assert str(shared) not in page
