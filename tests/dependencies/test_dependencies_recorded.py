"""Reality: modules and files that stage processes really executed and opened are dependencies in ``dvc.yaml``."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/recorder"))
import compare  # noqa: E402


@pytest.fixture
def project(tmp_path):
    """The project without data, with the smoke profile's parameters."""
    for name in ("pipeline", "conf", "data/paper"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "dvc.yaml", tmp_path)
    environment = {**os.environ, "PYTHONPATH": f"{ROOT / 'tests/recorder'}{os.pathsep}{tmp_path}"}
    subprocess.run(
        [sys.executable, "-m", "pipeline.config", "profile=smoke"], cwd=tmp_path, env=environment, check=True
    )
    environment["RECORD_STAGES"] = str(tmp_path / "records")
    (tmp_path / "records").mkdir()
    return tmp_path, environment


def test_processes_execute_and_open_what_is_declared(project):
    top, environment = project
    for stage, *job in (("sensor",), ("psf_bank",), ("refit",), ("index", "+job.dataset=photos")):
        command = [sys.executable, "-m", f"pipeline.stages.{stage}", "--params", *job]
        subprocess.run(command, cwd=top, env=environment, check=True, capture_output=True)
    records = compare.records(top / "records")
    assert {record["stage"][0].rpartition(".")[2] for record in records} == {"sensor", "psf_bank", "refit", "index"}
    assert any("pipeline/camera/characterisation/moments.py" in record["executed"] for record in records)
    assert any("data/paper/fitted_ap_grid.csv" in record["opened"] for record in records)
    assert compare.problems(records, top) == []
    graph = (top / "dvc.yaml").read_text()
    (top / "dvc.yaml").write_text(
        graph.replace("pipeline/camera/characterisation/moments.py,", "", 1).replace("data/paper/fitted", "x")
    )
    missing = compare.problems(records, top)
    assert "sensor: executes pipeline/camera/characterisation/moments.py, which is not in deps" in missing
    assert "refit: opens data/paper/fitted_ap_grid.csv, which is not in deps or outs" in missing


def test_the_costliest_stages_come_first():
    spent = [("noise", "sim", 2.0), ("blur", "sim", 5.0), ("blur", "sim", 1.0), ("blur", "kitti", 1.0)]
    records = [
        {"stage": [f"pipeline.stages.{stage}", f"+job.dataset={dataset}"], "processor_s": processor_s}
        for stage, dataset, processor_s in spent
    ]
    total, *stages = compare.costliest(records, most=2)
    assert total.split()[0] == "9" and [line.split() for line in stages] == [
        ["6", "s", "67%", "blur", "sim"],
        ["2", "s", "22%", "noise", "sim"],
    ]
