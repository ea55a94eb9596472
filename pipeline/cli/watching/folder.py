"""Pictures of a folder that fills, in the order in which they come, each read once it is whole."""

from __future__ import annotations

import os
import stat
import threading
import time
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

from pipeline.cli.watching.source_frame import SourceFrame
from pipeline.errors import InputError

POLL_S = 0.2
SETTLED_LOOKS, EMPTY_LOOKS = 2, 5  # in a row with the same size; a file that is begun is empty for a moment
REPLACED_LOOKS = 2  # at which there was another file or a smaller one, more than looks at which it had grown
KEPT_IN_VIEW_S = 60.0  # after it was read a file is looked at every time: a camera may write to it again and again
LEAST_REST = 19.0  # times the processor time of a look at every file that pass before the next: a twentieth of a core


def filling_folder(folder: Path, stop: threading.Event) -> Iterator[SourceFrame]:
    """Pictures of a folder in the order in which they come; a file is read once its size no longer changes.

    One that is replaced faster than that, as by a camera that renames each picture to one name, is read as it is; a
    file that is written slowly grows, which tells it from such.

    A file that is written again, or removed and written again under its name, is a new frame: its size or its time of
    modification has changed. So a picture that was read half-written, or empty, is read again when it is whole.
    Pictures of the same time come in `pipeline.cli.frames.given_files.natural_order`. Files of formats that are not
    read (`pipeline.cli.frames.formats.UNREAD`), videos, and files that stay empty come as problems; so does, once, a
    folder with folders and no picture in it.

    Every look lists the names, so that a new file is noticed at once. Files that were read more than `KEPT_IN_VIEW_S`
    ago are looked at again, all of them together, as often as a twentieth of a core allows (`LEAST_REST`): at every
    look of a folder of 4,000, every two to three seconds of one of 50,000. The time of modification of the folder would
    not show a file that is overwritten, and is coarse on network folders.

    Args:
        folder: watched; a ``None`` frame without a problem is yielded at every look that brings nothing. Where it
            disappears (a disk or share that is gone), that is reported once, and it is watched again when it is back.
        stop: ends it.
    """
    hinted, view = Counter[int](), _View(folder)
    lost, folders_named = False, False
    while not stop.is_set():
        try:
            with os.scandir(folder) as listing:
                entries = list(listing)
        except OSError as error:
            problem = "" if lost else f"the folder cannot be listed ({error.strerror}); trying again"
            yield SourceFrame(str(folder), None, problem, signal_lost=not lost)
            lost = True
            stop.wait(POLL_S)
            continue
        lost = False
        ready = view.ready(entries)
        for name in ready:
            if stop.is_set():
                return
            view.mark_read(name)
            yield _picture(folder / name, hinted)
        if not ready:
            problem = "" if folders_named or view.has_files else _not_watched(folder, entries)
            folders_named = folders_named or bool(problem)
            yield SourceFrame(str(folder), None, problem)
        stop.wait(POLL_S)


class _View:
    """What is known of the files of a folder, from look to look.

    Args:
        folder: watched.
    """

    def __init__(self, folder: Path) -> None:
        from pipeline.cli.frames.formats import PICTURES, UNREAD, VIDEOS

        self._folder, self._formats = folder, tuple(PICTURES | UNREAD | VIDEOS)
        self._waiting: dict[str, _Waiting] = {}
        self._done: dict[str, tuple[int, int]] = {}
        self._in_view: dict[str, float] = {}  # names of `_done`, and until when they are looked at every time
        self._all_due_s = 0.0

    @property
    def has_files(self) -> bool:
        """Whether a file was read or waits."""
        return bool(self._waiting or self._done)

    def ready(self, entries: Sequence[os.DirEntry[str]]) -> list[str]:
        """Names of the files that are to be read now, in the order in which they came.

        Args:
            entries: of the folder, at this look.
        """
        from pipeline.cli.frames.given_files import natural_order

        now_s, began_s = time.monotonic(), time.thread_time()
        every_one = now_s >= self._all_due_s
        self._forget({entry.name for entry in entries}, now_s)
        ready: list[tuple[int, str]] = []
        for entry in entries:
            name = entry.name
            is_old = name in self._done and name not in self._in_view
            if is_old and not every_one:
                continue
            if name[0] == "." or not name.lower().endswith(self._formats):
                continue
            status = _status(entry if is_old else self._folder / name)  # of many, without making a path
            if status is None or _version(status) == self._done.get(name):
                continue
            if self._waiting.setdefault(name, _Waiting()).settled(status):
                ready.append((status.st_mtime_ns, name))
            elif name in self._done:
                self._in_view[name] = now_s + KEPT_IN_VIEW_S
        if every_one:
            self._all_due_s = time.monotonic() + LEAST_REST * (time.thread_time() - began_s)
        return [name for _, name in sorted(ready, key=lambda item: (item[0], natural_order(item[1])))]

    def _forget(self, listed: Collection[str], now_s: float) -> None:
        """Forget files that are gone, and the time of those that need not be looked at every time any more."""
        for known in (self._waiting, self._done, self._in_view):
            for name in known.keys() - listed:
                del known[name]
        self._in_view = {name: until_s for name, until_s in self._in_view.items() if until_s > now_s}

    def mark_read(self, name: str) -> None:
        """Note that a file is read now."""
        status = _status(self._folder / name)  # as it is read: earlier frames may have taken long
        if status is not None:
            self._done[name] = _version(status)
            self._in_view[name] = time.monotonic() + KEPT_IN_VIEW_S
        self._waiting.pop(name)


def _not_watched(folder: Path, entries: Sequence[os.DirEntry[str]]) -> str:
    """That folders inside of a folder without pictures are not watched, with the first of them; else empty."""
    from pipeline.cli.frames.given_files import shown_folders

    inside = shown_folders(entries)
    hint = "no pictures yet; sub-folders are not watched: give one as SOURCE, as"
    return f"{hint} {folder / inside[0]}" if inside else ""


def _picture(file: Path, hinted: Counter[int]) -> SourceFrame:
    """A picture of any size (`watch` knows how large pictures must be), or why the file cannot be used."""
    from pipeline.cli.frames.formats import VIDEOS
    from pipeline.cli.frames.pictures import read

    if file.suffix.lower() in VIDEOS:
        reason = "a video; of a folder only pictures are watched: give the video as SOURCE, or to camera-monitor health"
        return SourceFrame(str(file), None, f"{file}: {reason}")
    try:
        ((name, image, coding),) = read(file, hinted=hinted, least_px=1)
    except InputError as error:
        return SourceFrame(str(file), None, str(error))
    return SourceFrame(name, image, coding=coding)


class _Waiting:
    """A file that is not read yet, from look to look."""

    def __init__(self) -> None:
        self._inode, self._size, self._looks, self._replaced = -1, -1, 0, 0

    def settled(self, status: os.stat_result) -> bool:
        """Whether it is to be read: it has not changed, or is replaced time and again and would never settle.

        A file that was renamed is whole and has another inode, unless the file system gives that of the file before
        last again: then every other one is smaller. One that is written in place grows at later looks.

        Args:
            status: as of this look.
        """
        inode, size = status.st_ino, status.st_size
        if self._looks and (inode != self._inode or size < self._size):
            self._replaced += 1
        elif size > self._size:
            self._replaced = max(self._replaced - 1, 0)
        self._looks = self._looks + 1 if size == self._size else 1
        self._inode, self._size = inode, size
        replaced = size > 0 and self._replaced >= REPLACED_LOOKS
        return replaced or self._looks >= (SETTLED_LOOKS if size else EMPTY_LOOKS)


def _status(file: Path | os.DirEntry[str]) -> os.stat_result | None:
    """None where a file is gone, no regular file or a link to nothing."""
    try:
        status = file.stat()
    except OSError:
        return None
    return status if stat.S_ISREG(status.st_mode) else None


def _version(status: os.stat_result) -> tuple[int, int]:
    """Size and time of modification (ns)."""
    return status.st_size, status.st_mtime_ns
