"""``camera-monitor blur record``: writes a record, says its numbers, and refuses what is absent in one line."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from data_makers import make_folder

from pipeline.cli import main

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def pictures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(ROOT)  # the configuration is found from the project's top folder
    return make_folder(tmp_path / "pictures", 1)


def call(pictures: Path, out: Path, *more: str, dataset: str = "mine") -> Result:
    given = ["+dataset@datasets.mine=folder", f"datasets.mine.root={pictures}", "psf.kinds=[defocus]"]
    given += ["psf.sizes_px=[7]", "blur.bootstrap_draws=5", "--dataset", dataset, "--to", str(out), "--source", "none"]
    return CliRunner().invoke(main, ["blur", "record", *given, *more])


def test_a_record_is_written_and_its_mean_said(pictures: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    done = call(pictures, out, "--estimator", "spectral", "--estimator", "spectral")
    assert done.exit_code == 0, done.output
    means = [line for line in done.stdout.splitlines() if "mean AMAE" in line]
    assert len(means) == 1 and means[0].startswith("spectral: mean AMAE calibrated ") and ", raw " in means[0]
    assert f"written to {out}" in done.stdout
    assert "blur_kind,kernel_size_px" in (out / "summary.csv").read_text()
    done = call(pictures, out, "--estimator", "spectral", "--join")  # the record itself may be replaced
    assert done.exit_code == 0, done.output


@pytest.mark.parametrize("to", [".", "kept", "pictures/out"])
def test_neither_pictures_nor_finished_frames_are_replaced(pictures: Path, tmp_path: Path, to: str) -> None:
    before = sorted(tmp_path.rglob("*"))
    done = call(pictures, tmp_path / to, "--estimator", "spectral", "--keep", str(tmp_path / "kept"))
    assert done.exit_code == 2 and "lies inside the input" in done.output
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize(
    ("more", "dataset", "said"),
    [
        (
            ["--estimator", "spektral"],
            "mine",
            "--estimator spektral: not in the configuration; did you mean 'spectral'",
        ),
        ([], "main", "--dataset main: not in the configuration; did you mean 'mine'"),
        (["datasets.mine.root=/nowhere", "--estimator", "spectral"], "mine", "/nowhere"),
        (["psf=paper", "psf.folder=/nowhere"], "mine", "psf.folder=/nowhere: no such folder"),
        (["psf=papers"], "mine", "papers"),
        (["blur.estimators.gbb.per_frame=2"], "mine", "blur.estimators.gbb.per_frame: a setting of the stages"),
        (["++blur.estimators.spectral.per_frame=null"], "mine", "--patches measures fewer patches of each frame"),
    ],
)
def test_mistakes_get_one_clear_line(pictures: Path, tmp_path: Path, more: list[str], dataset: str, said: str) -> None:
    done = call(pictures, tmp_path / "out", *more, dataset=dataset)
    assert done.exit_code == 2 and said in done.output and "Traceback" not in done.output
    assert not (tmp_path / "out").exists()


def test_help_shows_an_example() -> None:
    done = CliRunner().invoke(main, ["blur", "record", "--help"])
    assert done.exit_code == 0 and "psf=paper" in done.output and "--estimator" in done.output
