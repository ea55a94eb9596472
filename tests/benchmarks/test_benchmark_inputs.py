"""What a benchmark cannot use is one line that names it, before anything is measured."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace

import cv2
import numpy as np
import pytest

from benchmarks import coded_advice, coded_noise, common, flags, noisy_blur, other_frames, unseen_kernels
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


@pytest.fixture
def results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of records of its own, with one of two datasets."""
    monkeypatch.setattr(common, "RESULTS", tmp_path / "results")
    common.write("speed", {"datasets": ["kitti", "sim"], "count": 1})
    return tmp_path / "results"


@pytest.mark.parametrize("record", [{"datasets": ["sim"], "count": 2}, {"count": 2}])
def test_a_record_of_more_datasets_is_not_replaced(results: Path, record: dict[str, object]) -> None:
    with pytest.raises(InputError, match=r"speed\.json: has kitti, sim, .* lack kitti.*--out FILE") as refused:
        common.write("speed", record)
    assert "\n" not in str(refused.value)
    assert json.loads((results / "speed.json").read_text())["count"] == 1
    with pytest.raises(InputError, match="speed"):
        common.write("other", record, results / "speed.json")


def test_a_record_of_as_many_datasets_is_replaced(results: Path, tmp_path: Path) -> None:
    common.write("speed", {"datasets": ["sim", "udacity", "kitti"], "count": 2})
    assert json.loads((results / "speed.json").read_text())["count"] == 2
    path = common.write("speed", {"datasets": ["sim"], "count": 3}, tmp_path / "other.json")
    assert json.loads(path.read_text())["count"] == 3
    assert json.loads((results / "speed.json").read_text())["count"] == 2


@pytest.mark.parametrize("benchmark", [coded_advice, coded_noise, flags, noisy_blur, unseen_kernels])
def test_fewer_datasets_are_refused_before_anything_is_measured(
    benchmark: ModuleType, results: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = benchmark.__name__.rpartition(".")[2]
    common.write(name, {"datasets": ["photos", "sim", "kitti"]})
    for measuring in ("measure", "measured", "corrupted"):
        monkeypatch.setattr(benchmark, measuring, lambda *_: pytest.fail("it measures"), raising=False)
    for opener in (coded_noise, coded_advice):
        monkeypatch.setattr(opener, "open_dataset", lambda kind, name, root: SimpleNamespace(name=name), raising=False)
    monkeypatch.setattr(common, "dataset", lambda text: ("sim", "sim", "."))
    monkeypatch.setattr("sys.argv", [name])
    with pytest.raises(InputError, match=rf"{name}\.json: has .*kitti"):
        benchmark.main()


def test_committed_records_name_their_datasets() -> None:
    for name in ("noisy_blur", "unseen_kernels", "flags"):
        record = json.loads((common.RESULTS / f"{name}.json").read_text())
        assert set(record["datasets"]) == set(record["results"])
    for name in ("coded_advice", "coded_noise", "other_frames", "real_blur"):
        assert json.loads((common.RESULTS / f"{name}.json").read_text())["datasets"]


def test_make_bench_runs_what_needs_no_data_and_names_the_rest() -> None:
    lines = subprocess.run(["make", "-n", "bench"], cwd=common.ROOT, capture_output=True, text=True, check=True).stdout
    loop = next(line for line in lines.splitlines() if line.startswith("for name in "))
    ran = set(loop.removeprefix("for name in ").partition(";")[0].split())
    left_out = next(line for line in lines.splitlines() if "left out" in line).partition(": ")[2].strip('"').split()
    sources = {path.stem: path.read_text() for path in (common.ROOT / "benchmarks").glob("[a-z]*.py")}
    assert ran.isdisjoint(left_out)
    assert ran | set(left_out) == {name for name, text in sources.items() if "__main__" in text}
    of_datasets = {name for name, text in sources.items() if "check_datasets(" in text} - {"common"}
    assert of_datasets and of_datasets <= set(left_out)
    commands = (common.ROOT / "docs/reproduce.md").read_text().partition("## Benchmarks of your data")[2]
    assert all(f"`python benchmarks/{name}.py" in commands for name in left_out)
