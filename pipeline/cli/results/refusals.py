"""Files and folders of results that a command must not write, refused before anything is computed."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Sequence
from fnmatch import fnmatchcase
from pathlib import Path

from pipeline.errors import InputError, printable


class OutputError(InputError):
    """Results cannot be written; unlike a bad input, this ends the command."""


def refuse_input(path: Path, option: str, inputs: Sequence[Path]) -> None:
    """Refuse a file of results that is one of the command's inputs.

    Raises:
        OutputError: it is.
    """
    if any(_same_file(path, file) for file in inputs):
        raise OutputError(f"{option} {path}: would overwrite an input; name another file")


def _same_file(first: Path, second: Path) -> bool:
    """Whether two paths lead to one file, by hard links too; by their names where either is absent."""
    try:
        return first.samefile(second)
    except OSError:
        return first.resolve() == second.resolve()


def refuse_foreign_file(path: Path, option: str, start: str | None = None) -> None:
    """Refuse a file of results that would replace one of something else.

    Args:
        path: the file; may be absent or empty.
        option: that named it, for the message.
        start: with which every earlier result begins, and may be replaced; None where none may.

    Raises:
        OutputError: there is such a file.
    """
    if not path.is_file() or path.stat().st_size == 0:
        return
    if start is None:
        raise OutputError(f"{option} {path}: is there already; remove it, or name another file")
    wanted = start.encode()
    try:
        with path.open("rb") as file:
            earlier = file.read(len(wanted)) == wanted
    except OSError as error:
        raise OutputError(f"{option} {path}: cannot be read ({error.strerror}); name another file") from None
    if not earlier:
        raise OutputError(
            f"{option} {path}: would overwrite it, which no earlier run of this command wrote; name another file"
        )


def refuse_unwritable(path: Path, option: str) -> None:
    """Refuse a folder of results that cannot be made, before anything is computed.

    Args:
        path: the folder; what is missing of it is made and removed again.
        option: that named it, for the message.

    Raises:
        OutputError: it cannot be made or written.
    """
    missing = [folder for folder in (path, *path.parents) if not folder.exists()]
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            pass
    except OSError as error:
        raise OutputError(f"{option} {path}: cannot write there ({error.strerror}); name another folder") from None
    finally:
        for folder in missing:
            with contextlib.suppress(OSError):
                folder.rmdir()


def refuse_foreign(path: Path, option: str, results: Sequence[str], inputs: Sequence[Path]) -> None:
    """Refuse a folder that the command would replace although it holds more than an earlier result.

    Args:
        path: the folder; may be absent or empty.
        option: that named it, for the message.
        results: patterns (`fnmatch`) of every file of a result; the first names its provenance, which none lacks.
        inputs: files and folders the command reads, or keeps finished frames in.

    Raises:
        OutputError: it cannot be written, is a link, is, contains or lies inside an input, or holds anything that is
            no earlier result.
    """
    if path.is_symlink():
        raise OutputError(f"{option} {path}: is a link, which cannot be replaced; name the folder itself")
    refuse_unwritable(path, option)
    folder = Path(os.path.realpath(path))
    for file in inputs:
        read = Path(os.path.realpath(file))  # unlike resolve, it takes a link that leads to itself
        if folder == read or folder in read.parents or read in folder.parents:
            raise OutputError(
                f"{option} {path}: is replaced, and it is, contains or lies inside the input {file}; "
                "name another folder"
            )
    names = {file.name: file for file in sorted(path.iterdir())} if path.exists() else {}
    for name, file in names.items():
        if file.is_symlink() or not file.is_file() or not any(fnmatchcase(name, pattern) for pattern in results):
            raise OutputError(
                f"{option} {path}: is replaced, and it holds {printable(name)}, which no earlier run of this command "
                "wrote; name another folder"
            )
    if names and results[0] not in names:
        raise OutputError(
            f"{option} {path}: is replaced, and it is not empty and has no {results[0]} of an earlier run of this "
            "command; name another folder"
        )
