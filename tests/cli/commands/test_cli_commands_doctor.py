"""``camera-monitor doctor``: what it states is so."""

from __future__ import annotations

import json
from importlib import metadata
from pathlib import Path

from cli_makers import call
from plug_in_makers import plug_in

from pipeline.project_files import located

ROOT = Path(__file__).resolve().parents[3]


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


def test_doctor_names_what_is_registered_under_a_built_in_name(tmp_path, monkeypatch):
    """It said that there is no problem; the class is never used."""
    plug_in(tmp_path, monkeypatch, "wavelets", "class Mine: ...\n", noise="wavelet = wavelets:Mine")
    done = call("doctor")
    assert done.exit_code == 2 and "no problem" not in done.output
    (line,) = (line for line in done.output.splitlines() if line.startswith("problem: "))
    assert "pipeline.noise.wavelet:WaveletMedian of this package, and wavelets:Mine of wavelets is never used" in line
    assert "not ready" not in done.output  # nothing of this package is affected
    content = json.loads(call("doctor", "--json").stdout)
    assert content["problems"] == [] and len(content["name_clashes"]) == 1


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
