"""Kept results of a recording: computed once, the same when read again, nothing kept where none is wanted."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.cli.kept_results import keeping

CALLS: list[int] = []


def columns(item: int) -> dict[str, np.ndarray]:
    CALLS.append(item)
    return {"frame": np.array([f"f{item}", "b"], object), "value": np.array([item / 3, np.nan])}


def count(item: int) -> int:
    CALLS.append(item)
    return item + 1


@pytest.fixture(autouse=True)
def no_calls() -> None:
    CALLS.clear()


def test_a_frame_is_measured_once_and_read_again_as_it_was(tmp_path: Path) -> None:
    first = keeping(tmp_path / "kept")(columns, [1, 2])
    again = keeping(tmp_path / "kept")(columns, [2, 3, 1])
    assert CALLS == [1, 2, 3] and len(list((tmp_path / "kept").iterdir())) == 3
    for before, after in zip(first, (again[2], again[0]), strict=True):
        assert list(before) == list(after)
        assert before["frame"].tolist() == after["frame"].tolist()
        assert np.array_equal(before["value"], after["value"], equal_nan=True)


def test_what_is_no_table_is_computed_again(tmp_path: Path) -> None:
    assert keeping(tmp_path)(count, [1]) == keeping(tmp_path)(count, [1]) == [2]
    assert CALLS == [1, 1] and not list(tmp_path.iterdir())


def test_without_a_folder_nothing_is_kept(tmp_path: Path) -> None:
    assert keeping(None)(count, [1, 2]) == [2, 3]
