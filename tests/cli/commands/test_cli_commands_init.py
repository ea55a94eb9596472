"""``camera-monitor init``: the project that it makes runs, and nothing is overwritten."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from cli_makers import call

from pipeline.cli.commands.init import PICTURES, scene

ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.slow
def test_a_new_project_runs_and_its_dataset_is_valid(tmp_path):
    done = call("init", tmp_path / "mine")
    assert done.exit_code == 0, done.output
    checked = call("dataset", "folder", tmp_path / "mine/data")
    assert checked.exit_code == 0 and f"{PICTURES} usable frames" in checked.output
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    ran = subprocess.run(
        [sys.executable, "run.py"], cwd=tmp_path / "mine", env=environment, capture_output=True, text=True
    )
    assert ran.returncode == 0, ran.stderr
    lines = ran.stdout.splitlines()
    noise = [float(line.split("noise ")[1].split()[0]) for line in lines if "patches abstained" in line]
    assert len(noise) == PICTURES and all(1.5 < sigma < 4.5 for sigma in noise)  # 2 DN on the ground, 4 on the objects
    precision = [float(line.split(": ")[1].split()[0]) for line in lines if line.startswith("average precision")]
    assert precision[0] > 90 and len(precision) == 3
    assert lines[-1].startswith("policy: ") and float(lines[-1].split()[1]) <= 8.0
    points = tomllib.loads((tmp_path / "mine/pyproject.toml").read_text())["project"]["entry-points"]
    for group, entries in points.items():
        assert group in ("pipeline.noise", "pipeline.detection", "pipeline.control")
        for target in entries.values():
            module, name = target.split(":")
            assert f"class {name}" in (tmp_path / f"mine/{module}.py").read_text()


def test_scenes_have_their_objects_where_the_labels_are():
    image, boxes = scene(1)
    for x1, y1, x2, y2 in boxes:
        assert image[y1:y2, x1:x2].mean() < 40
    assert image[:15].mean() > 120


def test_the_next_command_can_be_pasted_into_a_shell(tmp_path):
    folder = tmp_path / "it's x y/z"
    done = call("init", folder)
    assert done.exit_code == 0, done.output
    next_command = done.output.strip().partition("; next: ")[2]
    assert shlex.split(next_command) == ["cd", str(folder), "&&", "python", "run.py"]


def test_init_leaves_folders_with_content_alone(tmp_path):
    (tmp_path / "note.txt").write_text("mine")
    done = call("init", tmp_path)
    assert done.exit_code == 2 and "not an empty folder" in done.output
    assert [path.name for path in tmp_path.iterdir()] == ["note.txt"]
