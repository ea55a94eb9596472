"""What a benchmark cannot use is one line that names it, before anything is measured."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks import common, other_frames
from pipeline.errors import InputError


def test_a_dataset_is_named_by_its_kind_and_a_folder_that_exists(tmp_path: Path) -> None:
    assert common.dataset(f"mine=folder:{tmp_path}") == ("mine", "folder", str(tmp_path))
    with pytest.raises(InputError, match=r"expected NAME=KIND:ROOT"):
        common.dataset("mine")
    with pytest.raises(InputError, match=r"no folder .*absent; expected that of the dataset mine"):
        common.dataset(f"mine=folder:{tmp_path / 'absent'}")


def test_wrong_input_is_one_line_and_exit_code_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = f"kitti=kitti:{tmp_path / 'absent'}"
    with pytest.raises(SystemExit) as stopped:
        common.run(lambda: other_frames.main(["--calibrate", given, "--evaluate", given]))
    assert stopped.value.code == 2
    captured = capsys.readouterr()
    assert captured.err.startswith("error: ") and captured.err.count("\n") == 1 and captured.out == ""


def test_a_benchmark_runs_before_instruction_sets_are_pinned() -> None:
    """Some compare pinned with free instruction sets, which importing the package would settle."""
    code = "import sys; from benchmarks import common; common.run(lambda: print('pipeline' in sys.modules))"
    ran = subprocess.run([sys.executable, "-c", code], cwd=common.ROOT, capture_output=True, text=True, check=True)
    assert ran.stdout == "False\n"
