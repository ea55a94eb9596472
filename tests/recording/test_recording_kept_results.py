"""Kept results of a recording: computed once by the same code and weights, nothing kept where none is wanted."""

from __future__ import annotations

import os
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from pipeline import blur
from pipeline.datasets.frame import Frame
from pipeline.datasets.patches import Patch
from pipeline.dependencies import closure
from pipeline.errors import InputError
from pipeline.experiments.condition import Condition, sweep_kernels
from pipeline.experiments.frames import TestFrame
from pipeline.experiments.run import Method, Registered
from pipeline.recording import kept_results
from pipeline.recording.kept_results import keeping, kept_tables, keyed

CALLS: list[int] = []
MODULE = "pipeline.statistics"
WEIGHTS = {"blur": {"cnn": {"mtf_cnn.safetensors": "0" * 64}}}


def columns(item: int) -> dict[str, np.ndarray]:
    CALLS.append(item)
    return {"frame": np.array([f"f{item}", "b"], object), "value": np.array([item / 3, np.nan])}


def count(item: int) -> int:
    CALLS.append(item)
    return item + 1


@pytest.fixture(autouse=True)
def no_calls() -> None:
    CALLS.clear()


def mapped(folder: Path, weights=None, module: str = MODULE):
    return keyed(keeping(folder), module, WEIGHTS if weights is None else weights)


def test_a_frame_is_measured_once_and_read_again_as_it_was(tmp_path: Path) -> None:
    first = mapped(tmp_path / "kept")(columns, [1, 2])
    again = mapped(tmp_path / "kept")(columns, [2, 3, 1])
    assert CALLS == [1, 2, 3] and len(list((tmp_path / "kept").iterdir())) == 3
    for before, after in zip(first, (again[2], again[0]), strict=True):
        assert list(before) == list(after)
        assert before["frame"].tolist() == after["frame"].tolist()
        assert np.array_equal(before["value"], after["value"], equal_nan=True)


def test_other_weights_do_not_answer_from_the_kept_results(tmp_path: Path) -> None:
    mapped(tmp_path)(columns, [1])
    mapped(tmp_path, {"blur": {"cnn": {"mtf_cnn.safetensors": "1" * 64}}})(columns, [1])
    mapped(tmp_path, {"blur": {"cnn": {"other.safetensors": "0" * 64}}})(columns, [1])
    assert CALLS == [1, 1, 1]


def test_edited_code_does_not_answer_from_the_kept_results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A module of the package copied, and a module that it imports edited: also what is imported counts."""
    package = tmp_path / "pipeline"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "recorder.py").write_text("from pipeline.estimator import estimate\n")
    (package / "estimator.py").write_text("def estimate(x):\n    return x\n")
    monkeypatch.setattr(
        kept_results, "fingerprint", lambda module, weights: closure.fingerprint(module, weights, root=tmp_path)
    )

    def measure() -> None:
        closure._source_digest.cache_clear()  # as in a new process
        mapped(tmp_path / "kept", module="pipeline.recorder")(columns, [1])

    measure()
    measure()
    assert CALLS == [1]
    (package / "estimator.py").write_text("def estimate(x):\n    return x + 1\n")
    measure()
    assert CALLS == [1, 1]
    (package / "unrelated.py").write_text("x = 1\n")
    measure()
    assert CALLS == [1, 1]


@pytest.mark.parametrize("module", ["blur", "detection", "frames"])
def test_the_code_of_every_recording_that_keeps_can_be_followed(module: str) -> None:
    files = closure.closure(f"pipeline.recording.{module}")
    assert {"pipeline/camera/corruption.py", "pipeline/blur/spectral.py", "pipeline/recording/provenance.py"} <= files


def test_without_a_key_nothing_is_kept(tmp_path: Path) -> None:
    keeping(tmp_path)(columns, [1])
    assert keeping(tmp_path)(columns, [1])[0]["frame"].tolist() == ["f1", "b"]
    assert CALLS == [1, 1] and not list(tmp_path.iterdir())


def test_what_is_no_table_is_computed_again(tmp_path: Path) -> None:
    assert mapped(tmp_path)(count, [1]) == mapped(tmp_path)(count, [1]) == [2]
    assert CALLS == [1, 1] and not list(tmp_path.iterdir())


def test_without_a_folder_nothing_is_kept() -> None:
    assert keyed(keeping(None), MODULE, WEIGHTS)(count, [1, 2]) == [2, 3]


def test_what_a_killed_recording_was_writing_is_no_result(tmp_path: Path) -> None:
    mapped(tmp_path)(columns, [1])
    (path,) = tmp_path.iterdir()
    (tmp_path / ".writing-a.npz").write_bytes(path.read_bytes())
    (tmp_path / ".writing-b.npz").touch()
    assert len(kept_tables(tmp_path)) == 1


def test_a_broken_kept_file_names_the_remedy_of_a_recording(tmp_path: Path) -> None:
    mapped(tmp_path)(columns, [1])
    (path,) = tmp_path.iterdir()
    path.write_bytes(path.read_bytes()[:20])
    remedy = rf"{path.name}: not a readable \.npz archive \(.*\); delete it and repeat the command$"
    with pytest.raises(InputError, match=remedy):
        mapped(tmp_path)(columns, [1])
    with pytest.raises(InputError, match=remedy):
        kept_tables(tmp_path)


def of_frame(
    work: tuple[TestFrame, tuple[str, ...]],
    *,
    conditions: list[Condition],
    methods: list[Method],
    words: frozenset[str],
) -> dict[str, np.ndarray]:
    """A stand-in for `pipeline.experiments.run.measure_frame`; leaves a line for every frame that it measures."""
    with Path(os.environ["MEASURED"]).open("a", encoding="utf-8") as file:
        file.write(f"{work[0].frame.name}\n")
    return {"frame": np.array([work[0].frame.name]), "value": np.array([len(words), len(conditions) + len(methods)])}


def record_frames(folder: Path, workers: int) -> None:
    """Measure frames as recordings do: arguments with sets, arrays and objects that several of them share."""
    name = "-".join(["mtf", "sigma"])
    condition = Condition(sweep_kernels("defocus", [5], [0], "nominal", 1)[1], "dcsn", 5.0, name)
    method = Method(name, "mtf", Registered(blur.create, "spectral", {"a": 1, "b": 2}), of_folds=(None, name))
    items = [
        (TestFrame(Frame("mine", item, Path(f"{item}.png")), {"mtf": [Patch(0, 0, 192, name)]}), (name,))
        for item in ("0", "1", "2")
    ]
    words = frozenset("abcdefgh")
    function = partial(of_frame, conditions=[condition, condition], methods=[method], words=words)
    keyed(keeping(folder, workers), MODULE, WEIGHTS)(function, items)


def test_an_interrupted_recording_continues_in_another_process_with_other_workers(tmp_path: Path) -> None:
    """The order of sets follows the hash seed, and which objects are identical follows the way to a worker."""
    kept, marks, here = tmp_path / "kept", tmp_path / "measured", Path(__file__)
    program = f"from pathlib import Path; from {here.stem} import record_frames; record_frames(Path({str(kept)!r}), "
    paths = [str(folder) for folder in (here.parent, here.parents[1], here.parents[2])]
    for seed, workers in (("1", 1), ("2", 1), ("3", 2), ("4", 2)):
        environment = os.environ | {"PYTHONHASHSEED": seed, "PYTHONPATH": os.pathsep.join(paths)}
        environment |= {"MEASURED": str(marks)}
        code = f"if __name__ == '__main__':\n    {program}{workers})"
        subprocess.run([sys.executable, "-c", code], env=environment, check=True)
        assert marks.read_text().splitlines() == ["0", "1", "2"], (seed, workers)
        assert len(list(kept.iterdir())) == 3
