"""Settings of ``python -m pipeline.dvc exp run`` are checked before DVC starts: one line, and nothing is changed."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest
from dvc.cli import parse_args

from pipeline.config.compose import compile_params
from pipeline.dvc import experiment
from pipeline.dvc.__main__ import main
from pipeline.dvc.checked_params import check_params
from pipeline.errors import InputError

ROOT = Path(__file__).resolve().parents[2]
pytestmark = pytest.mark.usefixtures("remembered_compositions")

AUTHOR = {f"GIT_{role}_{key}": "t@example.org" for role in ("AUTHOR", "COMMITTER") for key in ("NAME", "EMAIL")}


@pytest.fixture(autouse=True)
def in_the_repository(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)


def check(arguments: Sequence[str]) -> None:
    experiment.check(parse_args(arguments))


def test_settings_are_found_in_every_spelling() -> None:
    arguments = ["exp", "run", "-S", "seed=1", "--set-param", "+a.b=2", "-Sc=3", "--set-param=d={kind: pca}", "report"]
    assert experiment.settings(parse_args(arguments)) == ["seed=1", "+a.b=2", "c=3", "d={kind: pca}"]
    of_files = ["exp", "run", "-S", "params.yaml:seed=1", "-S", "other.yaml:seed=1"]
    assert experiment.settings(parse_args(of_files)) == ["seed=1"]


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("corruption.galery.sigma_dn=10", "galery"),
        ("profile=smok", "did you mean 'smoke'"),
        ("+noise.estimators.mine={kind: pcaa}", "noise.estimators.mine.kind: unknown"),
        ("seed=minus", "seed"),
        ("noise.tile_px=16,xx", "noise.tile_px"),
        ("datasets.photos.limit=0", "limit"),
    ],
)
def test_a_wrong_setting_is_one_line(setting: str, words: str, capsys: pytest.CaptureFixture[str]) -> None:
    params = (ROOT / "params.yaml").read_bytes()
    assert main(["exp", "run", "-S", setting, "report"]) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ") and error.count("\n") == 1 and words in error
    assert (ROOT / "params.yaml").read_bytes() == params


def test_right_settings_and_sweeps_pass() -> None:
    check(["exp", "run", "-S", "profile=smoke", "-S", "+noise.estimators.mine={kind: pca}", "report"])
    check(["exp", "run", "--queue", "-S", "seed=1,2", "-S", "profile=smoke"])
    check(["exp", "run", "--run-all"])
    with pytest.raises(InputError, match="datasets\\.kitti\\.root=/nowhere: no such folder"):
        check(["exp", "run", "-S", "+dataset@datasets.kitti=kitti", "-S", "datasets.kitti.root=/nowhere"])


REAL = ["-S", "+dataset@datasets.mine=photos", "-S"]


@pytest.mark.parametrize("option", ["--queue", pytest.param("--temp", marks=pytest.mark.full("one more takes 4 s"))])
def test_an_experiment_in_a_copy_takes_no_relative_path_to_ignored_files(
    option: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pipeline.config.references.check_references", lambda config: None)  # the folder is not there
    relative = [*REAL, "datasets.mine.root=./data/raw/kitti"]
    with pytest.raises(InputError, match=r"datasets\.mine\.root=\./data/raw/kitti: .*absolute path$") as caught:
        check(["exp", "run", option, *relative])
    assert "\n" not in str(caught.value)
    check(["exp", "run", *relative])
    check(["exp", "run", option, "-C", "data/raw", *relative])
    check(["exp", "run", option, *REAL, f"datasets.mine.root={tmp_path}"])
    check(["exp", "run", option])


@pytest.mark.parametrize("words", [["-q", "exp", "run"], ["--wait-for-lock", "experiments", "run"]])
def test_options_of_all_commands_of_dvc_leave_settings_checked(
    words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*words, "-S", "profile=smok"]) == 2
    assert "did you mean 'smoke'" in capsys.readouterr().err


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A project with this configuration and the parameters it gives."""
    folder = tmp_path / "project"
    folder.mkdir()
    for name in ("conf", "data"):
        (folder / name).symlink_to(ROOT / name)
    shutil.copy(ROOT / "params.yaml", folder)
    return folder


@pytest.mark.parametrize(
    "words",
    [["repro"], ["repro", "index@photos"], ["-v", "repro"], ["--wait-for-lock", "repro"], ["--cd", "project", "repro"]],
)
def test_reproducing_refuses_params_that_conf_does_not_give(
    words: list[str], project: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    params = project / "params.yaml"
    params.write_text(params.read_text().replace("\nseed: 1\n", "\nseed: 2\n"))
    monkeypatch.chdir(project.parent if "--cd" in words else project)
    assert main(words) == 2
    error = capsys.readouterr().err
    assert "+seed: 2" in error and "run 'make params'" in error


def test_reproducing_takes_params_that_conf_gives(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(project)
    check_params()


@pytest.mark.parametrize(("words", "status"), [(["repro", "--nowhere"], 254), (["--cd", "nowhere", "repro"], 2)])
def test_what_dvc_cannot_parse_or_enter_is_an_error(words: list[str], status: int) -> None:
    assert main(words) == status


def test_an_archive_without_its_history_is_told_to_become_a_repository(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / ".dvc").mkdir()
    (tmp_path / ".dvc/config").touch()
    (tmp_path / "dvc.yaml").write_text("stages: {}\n")
    monkeypatch.setenv("GIT_CEILING_DIRECTORIES", str(tmp_path.parent))
    monkeypatch.chdir(tmp_path)
    assert main(["repro"]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"error: {tmp_path} is not a git repository") and error.count("\n") == 1
    subprocess.run(error.split("'")[1], shell=True, check=True, env=os.environ | AUTHOR, capture_output=True)
    done = subprocess.run([sys.executable, "-m", "pipeline.dvc", "repro"], env=os.environ | {"PYTHONPATH": str(ROOT)})
    assert done.returncode == 0


def test_names_whose_code_dvc_does_not_watch_are_refused_with_the_commands_that_list_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write = "python -m pipeline.dependencies --write'"
    setting = "detection.measure.sigma=bf"
    with pytest.raises(InputError, match=r"measured: bf.*run 'python -m pipeline\.config " + f"{setting} && {write}$"):
        check(["exp", "run", "-S", setting, "report"])
    with pytest.raises(InputError, match=f"config KEY=VALUE && {write} for each value, and queue it by itself$"):
        check(["exp", "run", "--queue", "-S", "detection.measure.sigma=bf,pca"])
    for name in ("pipeline", "data", "dvc.yaml"):
        (tmp_path / name).symlink_to(ROOT / name)
    conf = shutil.copytree(ROOT / "conf", tmp_path / "conf")
    option = conf / "experiment/iopc.yaml"
    before = option.read_text()
    option.write_text(before.replace("sigma: cellwise", "sigma: bf"))
    assert option.read_text() != before
    monkeypatch.chdir(tmp_path)
    compile_params()
    with pytest.raises(InputError, match=f"measured: bf.*run '{write}$"):
        check_params()
    with pytest.raises(InputError, match="measured: bf"):
        check(["exp", "run"])
    option.write_text(before)
    compile_params()
    check_params()
    check(["exp", "run"])
