"""``camera-monitor curves``: answers with intervals, refusals that name the place, mistakes in one line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from control_makers import performance

from pipeline.cli import main
from pipeline.curves import build
from pipeline.streams import stream

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(autouse=True)
def at_top(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)


def ask(*arguments: str) -> Result:
    return CliRunner().invoke(main, ["curves", *arguments])


@pytest.fixture(scope="module")
def surface(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """AP = 80 - sigma at MTF 1, 60 - sigma at MTF 0.9; every draw two points off."""
    sigma, mtf = (axis.ravel() for axis in np.meshgrid([0.0, 5.0, 10.0], [0.9, 1.0], indexing="ij"))
    precision = 80.0 - sigma - 200.0 * (1.0 - mtf)
    draws = precision[:, None] + np.array([[-2.0, 2.0]])
    path = tmp_path_factory.mktemp("surface") / "surface-car.npz"
    build(sigma, mtf, precision, stream(1, "cli"), ap_draws=draws).save(path)
    return path


def test_every_pair_is_answered_with_its_interval(surface: Path) -> None:
    done = ask("query", str(surface), "--sigma", "2.5", "--sigma", "5", "--mtf", "0.95", "--mtf", "1")
    assert done.exit_code == 0, done.stderr
    rows = [[float(word) for word in line.split()] for line in done.stdout.splitlines()[1:]]
    assert [row[:3] for row in rows] == [[2.5, 0.95, 67.5], [2.5, 1.0, 77.5], [5.0, 0.95, 65.0], [5.0, 1.0, 75.0]]
    for row in rows:
        assert row[3] == pytest.approx(row[2] - 1.9) and row[4] == pytest.approx(row[2] + 1.9)


def test_what_was_not_measured_is_refused_and_the_rest_answered(surface: Path) -> None:
    done = ask("query", str(surface), "--sigma", "5", "--sigma", "25", "--mtf", "1")
    assert done.exit_code == 2 and "75.00" in done.stdout
    assert "sigma 25 DN, MTF 1: nothing was measured there" in done.stderr and "not extrapolated" in done.stderr
    assert "Traceback" not in done.stderr


def test_negative_noise_is_refused_and_an_mtf_just_above_1_has_the_answer_of_1(surface: Path) -> None:
    done = ask("query", str(surface), "--sigma", "-2", "--sigma", "0", "--mtf", "1.04")
    assert done.exit_code == 2 and [line.split()[0] for line in done.stdout.splitlines()[1:]] == ["0.00"]
    assert done.stdout.splitlines()[1].split()[2] == "80.00"
    assert "sigma -2 DN, MTF 1.04: expected numbers of at least 0" in done.stderr


def test_a_file_that_is_no_surface_is_named(tmp_path: Path) -> None:
    (tmp_path / "x.npz").write_bytes(b"none")
    done = ask("query", str(tmp_path / "x.npz"), "--sigma", "1", "--mtf", "1")
    assert done.exit_code == 2 and "x.npz" in done.stderr and "Traceback" not in done.stderr
    assert done.stderr.startswith(f"error: {tmp_path / 'x.npz'}: not a surface of average precision (.npz)")
    assert not any(word in done.stderr for word in ("pickle", "delete"))


def test_recording_an_unknown_detector_gets_a_hint(tmp_path: Path) -> None:
    given = ("--dataset", "sim", "--detector", "compakt", "--source", "none", "--to", str(tmp_path / "out"))
    done = ask("record", *given)
    assert done.exit_code == 2 and "--detector compakt" in done.stderr and "did you mean 'compact'" in done.stderr


def test_a_folder_that_holds_something_else_is_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("kept")
    given = ("--dataset", "sim", "--detector", "compact", "--source", "none", "--to", str(tmp_path))
    done = ask("record", *given)
    assert done.exit_code == 2 and "holds thesis.tex, which no earlier run" in done.stderr
    assert (tmp_path / "thesis.tex").read_text() == "kept"


def test_a_surface_for_control_is_named_as_such(tmp_path: Path) -> None:
    performance().save(tmp_path / "all.npz")
    answer = ask("query", str(tmp_path / "all.npz"), "--sigma", "5", "--mtf", "0.8")
    assert answer.exit_code == 2 and answer.stdout == ""
    assert answer.stderr.count("\n") == 1 and "a surface for control; expected surface-CLASS.npz" in answer.stderr


def test_without_an_answer_there_is_no_table(surface: Path) -> None:
    answer = ask("query", str(surface), "--sigma", "90", "--mtf", "0.95")
    assert answer.exit_code == 2 and answer.stdout == ""
