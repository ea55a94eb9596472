"""Kept results of a recording: computed once by the same code and weights, nothing kept where none is wanted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.dependencies import closure
from pipeline.recording import kept_results
from pipeline.recording.kept_results import keeping, keyed

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
