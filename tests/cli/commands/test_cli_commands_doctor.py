"""``camera-monitor doctor``, ``init`` and ``report diff``: what they state is so, and what they make runs."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path

import pytest
from click.testing import CliRunner

from pipeline.cli import main
from pipeline.cli.commands.init import PICTURES, scene
from pipeline.cli.commands.report import compare, metrics
from pipeline.project_files import located

ROOT = Path(__file__).resolve().parents[3]


def call(*arguments):
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def test_doctor_states_packages_weights_and_data(tmp_path, monkeypatch):
    monkeypatch.setenv("CAMERA_MONITOR_HOME", str(tmp_path))
    done = call("doctor", "--json")
    assert done.exit_code == 0, done.output
    content = json.loads(done.stdout)
    assert content["packages"]["torch"] == {"version": metadata.version("torch"), "required": True, "extras": []}
    assert content["packages"]["hypothesis"]["extras"] == ["dev"] and not content["packages"]["hypothesis"]["required"]
    files = {row["file"]: row for row in content["weights"]}
    assert set(files) == {path.name for path in (ROOT / "data/weights").glob("*.safetensors")}
    assert all(row["released"] and len(row["sha256"]) == 64 for row in files.values())
    assert content["cameras"] == [] and content["problems"] == []
    assert content["data"]["sim"] == ((ROOT / "data/sim").is_dir() and any((ROOT / "data/sim").iterdir()))
    text = call("doctor").output
    assert "mtf_spectral.safetensors" in text and "released" in text and text.rstrip().endswith("ready")


def test_doctor_names_damaged_weights(tmp_path, monkeypatch):
    released = located("data/weights/sigma_cellwise.safetensors").read_bytes()
    (tmp_path / "a.safetensors").write_bytes(released)
    (tmp_path / "b.safetensors").write_bytes(released[:2000])
    (tmp_path / ".writing-a.safetensors").touch()  # a training that was killed
    monkeypatch.setattr("pipeline.project_files.located", lambda path: tmp_path / Path(path).name)
    done = call("doctor")
    assert done.exit_code == 2
    assert "problem: b.safetensors" in done.output and "not ready" in done.output
    assert ".writing-" not in done.output
    assert any(line.split()[:2] == ["a.safetensors", "released"] for line in done.output.splitlines())


def test_doctor_names_a_folder_of_cameras_that_cannot_be_listed(tmp_path, monkeypatch):
    monkeypatch.setenv("CAMERA_MONITOR_HOME", str(tmp_path))
    assert "calibrated cameras: none" in call("doctor").output.splitlines()
    (tmp_path / "cameras").touch()  # no folder: nobody can list it, root neither
    reason = f"{tmp_path / 'cameras'}: cannot be listed (Not a directory); set CAMERA_MONITOR_HOME"
    done = call("doctor")
    assert done.exit_code == 0 and f"calibrated cameras: unknown; {reason}" in done.output.splitlines()
    content = json.loads(call("doctor", "--json").stdout)
    assert content["cameras"] == [] and content["cameras_unknown"] == reason
    done = call("watch", tmp_path, "--camera", "front")
    assert done.exit_code == 2 and reason in done.output


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


def write(root, **content):
    for name, value in content.items():
        (root / "metrics").mkdir(parents=True, exist_ok=True)
        (root / f"metrics/{name}.json").write_text(json.dumps(value))
    return root


def test_report_diff_lists_the_largest_changes_first(tmp_path):
    old = write(tmp_path / "a", noise={"pca": {"mae": 1.0, "count": 9}}, blur={"amae": 2.0, "gone": 1, "zero": 0})
    new = write(tmp_path / "b", noise={"pca": {"mae": 1.5, "count": 9}}, blur={"amae": 1.9, "came": 1, "zero": 1})
    done = call("report", "diff", old, new)
    assert done.exit_code == 0, done.output
    assert done.output.splitlines()[0] == "1 equal, 3 changed, 1 added, 1 removed"
    names = [line.split()[-1] for line in done.output.splitlines() if line]
    order = [name for name in names if ":" in name and not name.endswith(":")]
    assert order == ["blur:zero", "noise:pca.mae", "blur:amae"]
    assert "+50.00" in done.output and "-5.00" in done.output
    assert call("report", "diff", old, new, "--fail").exit_code == 3
    assert call("report", "diff", old, old, "--fail").exit_code == 0
    tolerant = json.loads(call("report", "diff", old, new, "--tolerance-percent", 10, "--json").stdout)
    assert [row["name"] for row in tolerant["changes"]] == ["blur:zero", "noise:pca.mae"]
    assert tolerant["added_names"] == ["blur:came"] and tolerant["removed_names"] == ["blur:gone"]


def test_report_diff_lists_numbers_that_vanished_first_and_calls_no_change_smaller(tmp_path):
    nan, small = float("nan"), {f"small {number}": 1.0 for number in range(9)}
    old = {**small, "lost": 0.37, "was 0": 0, "no number": nan, "to no number": 2.0, "large": 1.0, "endless": 1.0}
    new = {**dict.fromkeys(small, 1.001), "lost": None, "was 0": 9, "no number": 1.0, "to no number": nan,
           "large": 3.0, "endless": float("inf")}  # fmt: skip
    changes = compare(old, new, 0.0)
    without_ratio = ["endless", "lost", "no number", "to no number", "was 0"]
    assert [row["name"] for row in changes] == [*without_ratio, "large", *small]
    assert [row["relative"] for row in changes][:6] == [*[None] * 5, 2.0]
    roots = (write(tmp_path / name, noise=content) for name, content in (("a", old), ("b", new)))
    done = call("report", "diff", *roots, "--most", 5)
    assert [line.split(":")[-1] for line in done.output.splitlines() if " noise:" in line] == without_ratio
    assert "... and 10 more changes (--most 0 lists all)" in done.output


def test_report_diff_takes_folders_of_metrics_and_single_files_and_refuses_others(tmp_path):
    old = write(tmp_path / "a", noise={"x": 1.0})
    assert metrics(old) == metrics(old / "metrics") == {"noise:x": 1.0}
    project = write(tmp_path / "project/reports", noise={"x": 1.0}).parent
    (project / "params.json").write_text('{"y": 2.0}')
    assert metrics(project) == {"noise:x": 1.0}
    assert metrics(old / "metrics/noise.json") == {":x": 1.0}
    assert compare({"a": float("nan")}, {"a": float("nan")}, 0.0) == []
    (old / "metrics/noise.json").write_text("{")
    assert "not readable JSON" in call("report", "diff", old, old).output
    for content, words in (
        ('{"c.d": 5, "c": {"d": 6}}', "two values have the name 'c.d'"),
        (f'{{"x": {"9" * 400}}}', "'x' is an integer of 400 digits"),
    ):
        (old / "metrics/noise.json").write_text(content)
        done = call("report", "diff", old, old)
        assert done.exit_code == 2 and f"noise.json: {words}" in done.output.replace("\n", " "), done.output
    (old / "metrics/noise.json").write_text('{"x": 1.0, "none": []}')
    (old / "metrics/.writing-a.json").write_text("{")
    assert metrics(old) == {"noise:x": 1.0, "noise:none": []}
    assert "no metrics" in call("report", "diff", tmp_path / "absent", old).output


def test_the_committed_report_equals_itself():
    assert call("report", "diff", ROOT / "reports", ROOT / "reports", "--fail").exit_code == 0
