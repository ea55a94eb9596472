"""Settings of ``python -m pipeline.dvc exp run`` are checked before DVC starts: one line, and nothing is changed."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.dvc import experiment
from pipeline.dvc.__main__ import main
from pipeline.errors import InputError

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(autouse=True)
def in_the_repository(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)


def test_settings_are_found_in_every_spelling() -> None:
    arguments = ["exp", "run", "-S", "seed=1", "--set-param", "+a.b=2", "-Sc=3", "--set-param=d={kind: pca}", "report"]
    assert experiment.settings(arguments) == ["seed=1", "+a.b=2", "c=3", "d={kind: pca}"]
    assert experiment.settings(["exp", "run", "-S", "params.yaml:seed=1", "-S", "other.yaml:seed=1"]) == ["seed=1"]
    assert experiment.is_experiment(arguments) and not experiment.is_experiment(["repro", "report"])


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
    experiment.check(["exp", "run", "-S", "profile=smoke", "-S", "+noise.estimators.mine={kind: pca}", "report"])
    experiment.check(["exp", "run", "--queue", "-S", "seed=1,2", "-S", "profile=smoke"])
    experiment.check(["exp", "run", "--run-all"])
    with pytest.raises(InputError, match="datasets\\.kitti\\.root=/nowhere: no such folder"):
        experiment.check(["exp", "run", "-S", "+dataset@datasets.kitti=kitti", "-S", "datasets.kitti.root=/nowhere"])
