"""What a benchmark cannot use is one line that names it, before anything is measured."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from benchmarks import common, other_frames
from pipeline.datasets.dataset import Frame
from pipeline.datasets.patches import Patch
from pipeline.errors import InputError
from pipeline.experiments.frames import TestFrame


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


@pytest.mark.parametrize("given", [[], ["--calibrate", "a=folder:."], ["--evaluate", "a=folder:."]])
def test_other_frames_wants_frames_to_calibrate_on_and_others(given: list[str]) -> None:
    with pytest.raises(InputError, match=r"give --calibrate together with --evaluate, or --leave-one-out"):
        other_frames.main(given)


def test_whole_frames_are_calibrated_to_on_tiles_with_structure(tmp_path: Path) -> None:
    picture = np.full((192, 400), 128, np.uint8)
    picture[:, 200:] = 60 + 120 * (np.arange(200) // 10 % 2)
    cv2.imwrite(str(tmp_path / "a.png"), picture)
    sharp = TestFrame(Frame("mine", "a", tmp_path / "a.png"), {"mtf": [Patch(5, 0, 192)]})
    assert other_frames.over_the_frame(sharp).patches["mtf"] == [Patch(192, 0, 192), Patch(208, 0, 192)]
    cv2.imwrite(str(tmp_path / "a.png"), np.full_like(picture, 128))
    with pytest.raises(InputError, match=r"a\.png: no tile with structure"):
        other_frames.over_the_frame(sharp)
    given = [f"--leave-one-out=mine=folder:{tmp_path}", "--whole-frames"]
    with pytest.raises(InputError, match=r"--whole-frames: .*give --out FILE as well"):
        other_frames.main(given)


def test_leave_one_out_calibrates_to_every_frame_but_the_one_evaluated(monkeypatch: pytest.MonkeyPatch) -> None:
    frames = [TestFrame(Frame("mine", name, Path(f"{name}.png")), {"mtf": [Patch(0, 0, 192)]}) for name in "abc"]
    monkeypatch.setattr(other_frames, "indexed", lambda config, name, patches: (frames, frames))
    camera = other_frames.leave_one_out(None, "mine", 4)
    assert [item.frame.name for item in camera.frames] == ["a", "b", "c"]
    for item in camera.frames:
        calibrated_on = {sharp.frame.name for sharp in camera.calibrations[item.fold]}
        assert calibrated_on == {"a", "b", "c"} - {item.frame.name}
    del frames[1:]
    with pytest.raises(InputError, match=r"--leave-one-out mine: 1 usable frame; expected at least two"):
        other_frames.leave_one_out(None, "mine", 4)
