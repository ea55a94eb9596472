"""The results of one command: a folder checked before anything is computed, unique names, rows written as they come.

A folder remembers in a small list which files the last run of each command wrote into it. Its next run removes
exactly these, so that no old picture lies beside a new table, and refuses to overwrite anything else.
"""

from __future__ import annotations

import contextlib
import csv
import io
import json
import os
import tempfile
from collections.abc import Collection, Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from pipeline.errors import InputError, printable

LIST_NAME = ".camera-monitor-files"
FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r")  # a spreadsheet runs text that begins with one of these


class OutputError(InputError):
    """Results cannot be written; unlike a bad input, this ends the command."""


class OutputFolder:
    """A folder for the results of one run, checked and locked when it is made; entering it removes earlier results.

    Args:
        path: the folder; made if it is absent.
        command: that writes there, e.g. ``"health"``; the results of others are kept.
        option: the command-line option that named it, for messages.
        inputs: files the command reads; none of them may be an earlier result, which is removed.

    Raises:
        OutputError: the folder cannot be made or written, another run writes there, or an input would be removed.
    """

    def __init__(self, path: Path, command: str, option: str = "--out", inputs: Sequence[Path] = ()) -> None:
        self.path, self.command, self.option = path, command, option
        self._taken: set[str] = set()
        try:
            path.mkdir(parents=True, exist_ok=True)
            self._list = (path / LIST_NAME).open("a+", encoding="utf-8")
        except OSError as error:
            raise OutputError(f"{option} {path}: cannot write there ({error.strerror}); name another folder") from None
        try:
            self._lock()
            self._read_list(inputs)
        except BaseException:
            self._list.close()
            raise

    def __enter__(self) -> OutputFolder:
        self._remove_earlier()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._list.close()

    def refuse_foreign_files(self, names: Sequence[str]) -> None:
        """Refuse results that would overwrite a file which no earlier run of this command wrote.

        Args:
            names: of the results.

        Raises:
            OutputError: one would.
        """
        for target in (self.path / name for name in names):
            if target.exists() and target not in self._earlier:
                raise OutputError(
                    f"{self.option} {self.path}: would overwrite {target}, which no earlier run of this command wrote; "
                    "name another folder"
                )

    @property
    def any_claimed(self) -> bool:
        """Whether this run has results."""
        return bool(self._taken)

    def claim(self, stem: str, suffix: str) -> Path:
        """A file of this folder that no other result of this run has.

        Args:
            stem: wanted name without its suffix; ``-2``, ``-3`` ... is added where it is taken.
            suffix: e.g. ``".png"``.

        Raises:
            OutputError: a file of that name is there that no earlier run wrote.
        """
        name, number = f"{stem}{suffix}", 1
        while name.casefold() in self._taken:
            number += 1
            name = f"{stem}-{number}{suffix}"
        self._taken.add(name.casefold())
        self.refuse_foreign_files([name])
        try:
            self._list.write(_line(self.command, name))
            self._list.flush()
        except OSError as error:
            raise OutputError(f"{self.option} {self.path}: cannot write there ({error.strerror})") from None
        return self.path / name

    def claim_all(self, stem: str, suffixes: Sequence[str], reserved: Collection[str] = ()) -> list[Path]:
        """Files of one stem and several suffixes, none of which another result of this run has.

        Args:
            stem: wanted name; ``-2``, ``-3`` ... is added where it is taken.
            suffixes: e.g. ``".png"``.
            reserved: stems, case folded, that are left to others (`stems_kept`).

        Raises:
            OutputError: a file of such a name is there that no earlier run wrote.
        """
        number, wanted = 1, stem
        while wanted.casefold() in reserved or self._taken & {f"{wanted}{suffix}".casefold() for suffix in suffixes}:
            number += 1
            wanted = f"{stem}-{number}"
        return [self.claim(wanted, suffix) for suffix in suffixes]

    def _lock(self) -> None:
        try:
            import fcntl
        except ImportError:  # Windows has no such locks
            return
        try:
            fcntl.flock(self._list, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise OutputError(f"{self.option} {self.path}: another run writes there; name another folder") from None

    def _read_list(self, inputs: Sequence[Path]) -> None:
        self._list.seek(0)
        listed = [_listed(line.rstrip("\n")) for line in self._list]
        listed = [(command, name) for command, name in listed if name and Path(name).name == name]
        self._others = [(command, name) for command, name in listed if command not in ("", self.command)]
        self._earlier = [self.path / name for command, name in listed if command in ("", self.command)]
        read = {file.resolve() for file in inputs}
        for file in self._earlier:
            if file.resolve() in read:
                raise OutputError(
                    f"{self.option} {self.path}: would overwrite its input {file}, a result of the last run; "
                    "name another folder"
                )

    def _remove_earlier(self) -> None:
        for file in self._earlier:
            if file.is_file() or file.is_symlink():
                file.unlink()
        self._earlier = []
        self._list.truncate(0)
        self._list.writelines(_line(command, name) for command, name in self._others if (self.path / name).exists())
        self._list.flush()


def stems_kept(files: Sequence[Path], suffix: str) -> frozenset[str]:
    """Stems, case folded, of the inputs whose results have their own names, since they have the results' suffix.

    Args:
        files: inputs.
        suffix: of the results, e.g. ``".png"``.
    """
    return frozenset(file.stem.casefold() for file in files if file.suffix == suffix)


def _line(command: str, name: str) -> str:
    """A line of the list of files, as JSON since a name may hold line breaks."""
    return f"{json.dumps([command, name])}\n"


def _listed(line: str) -> tuple[str, str]:
    """Command and name in a line of the list of files.

    Earlier versions wrote the name alone, as JSON text or as it is: the command is then empty, and may be any.
    """
    with contextlib.suppress(ValueError):
        match json.loads(line):
            case [str(command), str(name)]:
                return command, name
            case str(name):
                return "", name
    return "", line


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


def plain_text(text: str) -> str:
    """Text that no spreadsheet takes for a formula: an apostrophe is put before ``=``, ``+``, ``-``, ``@`` and tabs."""
    return f"'{text}" if text.startswith(FORMULA_STARTS) else text


class _GrowingFile:
    """A file that is written entry by entry, so that an interrupted run keeps every finished one.

    Args:
        path: the file; replaced.

    Raises:
        OutputError: the file cannot be made or written.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.count = path, 0
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file = path.open("wb", buffering=0)
        except OSError as error:
            raise OutputError(f"{path}: cannot be written ({error.strerror}); name another file") from None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    def _append(self, text: str) -> None:
        """Append text in full, or name the reason and how many rows the file holds."""
        content = text.encode("utf-8", errors="backslashreplace")
        try:
            while content:
                content = content[self._file.write(content) :]
        except OSError as error:
            raise OutputError(f"{self.path}: {error.strerror}; the {self.count} rows before are written") from None


class RowFile(_GrowingFile):
    """A CSV table that is written row by row.

    Args:
        path: the file; replaced.
        columns: its header.

    Raises:
        OutputError: the file cannot be made or written.
    """

    def __init__(self, path: Path, columns: Sequence[str]) -> None:
        super().__init__(path)
        self.columns = tuple(columns)
        self._append(_csv(columns))

    def write(self, row: Mapping[str, Any]) -> None:
        """Append the declared columns of a row; others are left out."""
        self._append(_csv([row[name] for name in self.columns]))
        self.count += 1


class LineFile(_GrowingFile):
    """A file of JSON lines, written line by line like `RowFile`.

    Args:
        path: the file; replaced.

    Raises:
        OutputError: the file cannot be made or written.
    """

    def write(self, line: str) -> None:
        """Append one line."""
        self._append(f"{line}\n")
        self.count += 1


def _csv(values: Sequence[Any]) -> str:
    text = io.StringIO()
    plain = [plain_text(value) if isinstance(value, str) else value for value in values]
    csv.writer(text, lineterminator="\n").writerow(plain)
    return text.getvalue()
