"""``camera-monitor watch FOLDER`` with many pictures in the folder: old ones are looked at seldom, none is missed."""

from __future__ import annotations

import os
import threading
from collections import Counter
from types import SimpleNamespace

import pytest

from pipeline.cli.watching import folder
from pipeline.cli.watching.folder import KEPT_IN_VIEW_S, LEAST_REST, filling_folder
from pipeline.cli.watching.source_frame import SourceFrame

LOOK_S = 0.25  # processor time that a look at every file is said to take
OLD = [f"{number:03}.png" for number in range(20)]


class Clock:
    """Time that passes between looks only."""

    def __init__(self) -> None:
        self.now_s = 1000.0
        self.processor_s = 0.0

    def monotonic(self) -> float:
        return self.now_s

    def thread_time(self) -> float:
        self.processor_s += LOOK_S
        return self.processor_s


@pytest.fixture
def watched(tmp_path, monkeypatch):
    """A folder of 20 pictures that were read long ago: ``next_look`` gives names read and names looked at."""
    clock, asked, stop = Clock(), Counter(), threading.Event()
    status = folder._status

    def counted(file):
        asked[file.name] += 1
        return status(file)

    monkeypatch.setattr(folder, "time", clock)
    monkeypatch.setattr(folder, "_status", counted)
    monkeypatch.setattr(folder, "_picture", lambda file, hinted: SourceFrame(file.name, None, "read"))
    monkeypatch.setattr(stop, "wait", lambda seconds: setattr(clock, "now_s", clock.now_s + seconds))
    for name in OLD:
        (tmp_path / name).write_bytes(b"old")
    source = filling_folder(tmp_path, stop)

    def next_look():
        asked.clear()
        frame = next(source)
        return frame.name if frame.problem else "", dict(asked)

    assert next_look()[0] == ""
    assert [next_look()[0] for _ in OLD] == OLD
    clock.now_s += KEPT_IN_VIEW_S
    assert next_look() == ("", dict.fromkeys(OLD, 1))  # a look at every file is due
    return SimpleNamespace(folder=tmp_path, next_look=next_look, clock=clock)


def test_files_that_were_read_long_ago_are_looked_at_as_often_as_a_twentieth_of_a_core_allows(watched):
    began_s = watched.clock.now_s
    while not (asked := watched.next_look()[1]):
        pass
    assert asked == dict.fromkeys(OLD, 1)
    assert LEAST_REST * LOOK_S <= watched.clock.now_s - began_s < LEAST_REST * LOOK_S + 1


def test_a_new_file_is_noticed_at_the_next_look(watched):
    (watched.folder / "new.png").write_bytes(b"new")
    assert watched.next_look() == ("", {"new.png": 1})
    assert watched.next_look()[0] == "new.png"
    assert watched.next_look() == ("", {"new.png": 1})  # it may be written again


def test_an_old_file_that_is_written_again_is_read_once_every_file_was_looked_at_and_stays_in_view(watched):
    path = watched.folder / OLD[3]
    path.write_bytes(b"newer")
    names = [watched.next_look()[0] for _ in range(28)]
    assert [name for name in names if name] == [OLD[3]]
    os.utime(path, (1, 1))
    assert [watched.next_look()[0] for _ in range(2)] == ["", OLD[3]]


def test_a_removed_file_that_comes_again_is_new(watched):
    (watched.folder / OLD[0]).unlink()
    assert watched.next_look() == ("", {})
    (watched.folder / OLD[0]).write_bytes(b"old")
    assert [watched.next_look()[0] for _ in range(2)] == ["", OLD[0]]


def test_a_folder_of_folders_says_once_that_those_are_not_watched(tmp_path):
    for name in ("b", "a", ".hidden"):
        (tmp_path / name).mkdir()
    source = filling_folder(tmp_path, threading.Event())
    assert next(source).problem.endswith(f"sub-folders are not watched: give one as SOURCE, as {tmp_path / 'a'}")
    assert [next(source).problem for _ in range(2)] == ["", ""]


def test_folders_beside_pictures_are_no_problem(watched):
    (watched.folder / "thumbnails").mkdir()
    assert watched.next_look() == ("", {})
