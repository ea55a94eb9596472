"""``dvc status`` itself: it names the stages of an edited module, in a small copy with stages as in ``dvc.yaml``."""

import shutil
import subprocess
import sys
from pathlib import Path

import composed
import pytest
import yaml

from pipeline.dependencies.__main__ import main

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """A DVC project with the code dependencies of a few stages, whose commands only write their output."""
    top = tmp_path_factory.mktemp("project")
    shutil.copytree(ROOT / "pipeline", top / "pipeline", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / ".dvcignore", top)
    graph = composed.graph()["stages"]
    stages = {}
    for name in ("noise_pca", "noise_cellwise", "train_mtf_cnn", "corrupt", "refit"):
        deps = [line for line in graph[name]["deps"] if line.startswith("pipeline/")]
        stages[name] = {"cmd": f"echo {name} > {name}.txt", "deps": deps, "outs": [{f"{name}.txt": {"cache": False}}]}
    (top / "dvc.yaml").write_text(yaml.safe_dump({"stages": stages}))
    dvc(top, "init", "--no-scm", "-q")
    dvc(top, "repro", "-q")
    return top


def dvc(top, *arguments):
    done = subprocess.run(
        [sys.executable, "-m", "dvc", *arguments], cwd=top, capture_output=True, text=True, check=True
    )
    return done.stdout


@pytest.mark.full("DVC on a copy of the project takes 10 s")
@pytest.mark.parametrize(
    ("edited", "named"),
    [
        ("experiments/corrupt.py", {"noise_pca", "noise_cellwise", "corrupt"}),
        ("noise/pca.py", {"noise_pca"}),
        ("noise/networks/cellwise_net.py", {"noise_cellwise"}),
        ("learning/streets.py", {"train_mtf_cnn"}),
        ("blur/networks/spectral_net.py", set()),
        ("noise/base.py", {"noise_pca", "noise_cellwise"}),
        ("curves/published.py", {"refit"}),
        ("__init__.py", {"noise_pca", "noise_cellwise", "train_mtf_cnn", "corrupt", "refit"}),
    ],
)
def test_status_names_the_stages_that_can_execute_an_edited_module(project, edited, named):
    path = project / "pipeline" / edited
    before = path.read_text(encoding="utf-8")
    path.write_text(before + "\n# edited\n", encoding="utf-8")
    try:
        status = dvc(project, "status")
    finally:
        path.write_text(before, encoding="utf-8")
    assert {line.rstrip(":") for line in status.splitlines() if line.endswith(":") and line[0] != "\t"} == named


def test_what_a_killed_run_left_changes_no_dependency(tmp_path):
    """Stages depend on whole folders, as `report` does on ``data/noise`` and ``reports/recorded``."""
    shutil.copy(ROOT / ".dvcignore", tmp_path)
    dvc(tmp_path, "init", "--no-scm", "-q")
    left = ["data/noise/.writing-a/maps.npz", "data/.replaced-psf-a/psf/bank.npz", "data/weights/.writing-a.csv"]
    assert dvc(tmp_path, "check-ignore", *left, "data/noise/sim-pca/maps.npz").split() == left


@pytest.mark.parametrize(("arguments", "status", "words"), [(["--help"], 0, "--write"), ([], 2, "required")])
def test_the_command_line_describes_itself(arguments, status, words, capsys):
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    output = capsys.readouterr()
    assert ended.value.code == status and words in output.out + output.err


def test_params_that_are_not_yaml_are_one_line(tmp_path, monkeypatch, capsys):
    (tmp_path / "dvc.yaml").write_text("stages: {}\n")
    (tmp_path / "params.yaml").write_text("a: [")
    monkeypatch.chdir(tmp_path)
    assert main(["--check"]) == 2
    assert capsys.readouterr().err == "error: params.yaml: not valid YAML; run 'make params' to compile it from conf/\n"
