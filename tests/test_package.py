"""The package installed from its wheel: weights inside, commands in any folder, without the checkout."""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from importlib import metadata
from pathlib import Path

import cv2
import pytest
from data_makers import picture

from pipeline.project_files import INSTALLED_WEIGHTS, located

ROOT = Path(__file__).resolve().parents[1]
RELEASED = [file.name for file in (ROOT / "data/weights").glob("*.safetensors")]


def test_weights_of_a_checkout_are_found_from_any_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in RELEASED:
        assert located(f"data/weights/{name}") == ROOT / "data/weights" / name
    monkeypatch.setattr("pipeline.project_files.PACKAGE", tmp_path / "site-packages/pipeline")
    assert located("data/weights/mtf_cnn.safetensors") == INSTALLED_WEIGHTS / "mtf_cnn.safetensors"


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel, built from a copy of what it is made of; or a skip that says why it cannot be built here."""
    if importlib.util.find_spec("setuptools") is None or importlib.util.find_spec("pip") is None:
        pytest.skip("no wheel can be built here: setuptools or pip is not installed")
    source = tmp_path_factory.mktemp("source")
    for name in ("pyproject.toml", "setup.py", "MANIFEST.in", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source / name)
    shutil.copytree(ROOT / "pipeline", source / "pipeline", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(ROOT / "data/weights", source / "data/weights")
    out = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "--no-index", "-w", str(out)]
    done = subprocess.run([*command, str(source)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    (file,) = out.glob("*.whl")
    return file


@pytest.mark.slow
def test_the_wheel_holds_weights_and_every_file_of_the_package(wheel):
    names = set(zipfile.ZipFile(wheel).namelist())
    assert RELEASED and {f"pipeline/released_weights/{name}" for name in RELEASED} <= names
    files = [path for path in (ROOT / "pipeline").rglob("*") if path.is_file() and path.parent.name != "__pycache__"]
    assert {path.suffix for path in files} >= {".py", ".yaml", ".j2"}
    assert {path.relative_to(ROOT).as_posix() for path in files} <= names
    assert not any(name.startswith(("tests/", "data/", "benchmarks/")) for name in names)


@pytest.mark.full("an environment of its own takes 15 s")
@pytest.mark.slow
def test_installed_in_an_empty_environment_the_commands_work_from_another_folder(wheel, tmp_path):
    """The environment holds the wheel; its dependencies are those installed here, which are not fetched again."""
    environment = tmp_path / "environment"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(environment)], check=True)
    (site,) = environment.glob("lib/python*/site-packages")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(site)
    (site / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    work = tmp_path / "work"
    work.mkdir()
    assert cv2.imwrite(str(work / "a.png"), picture("package"))
    variables = {"PATH": os.environ["PATH"], "HOME": str(tmp_path), "OMP_NUM_THREADS": "1"}
    python = str(environment / "bin/python")

    def run(*arguments: str, folder: Path = work) -> str:
        done = subprocess.run(
            [python, *arguments], cwd=folder, env=variables, capture_output=True, text=True, timeout=900
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    assert run("-c", "import pipeline; print(pipeline.__file__)").strip().startswith(str(site))
    assert "a.png" in run("-m", "pipeline.cli", "health", "a.png", "--out", "out")
    assert (work / "out/health.json").is_file()
    assert "a.png" in run("-m", "pipeline.cli", "health", "a.png", "--generic-lens", "--out", "relative")
    assert "a.png" in run("-m", "pipeline.cli", "noise", "a.png")
    assert "written" in run("-m", "pipeline.cli", "corrupt", "a.png", "--out", "noisy", "--sigma-dn", "5")
    code = "from pipeline import detection, blur; detection.create('compact'); blur.create('cnn'); print('loaded')"
    assert "loaded" in run("-c", code)
    state = json.loads(run("-m", "pipeline.cli", "doctor", "--json"))
    assert {row["file"] for row in state["weights"] if row["released"]} == set(RELEASED)
    assert state["problems"] == [] and not any(state["data"].values()) and not any(state["measured"].values())
    assert state["version"] == metadata.version("camera-condition-pipeline")
    assert "python run.py" in run("-m", "pipeline.cli", "init", "mine")
    assert run("run.py", folder=work / "mine").splitlines()[-1].startswith("policy: ")
