"""The folder of one command's results, checked before anything is computed, with unique names.

It remembers in a small list which files the last run of each command wrote into it. The command's next run removes
exactly these, so that no old picture lies beside a new table, and refuses to overwrite anything else.
"""

from __future__ import annotations

import contextlib
import json
from collections.abc import Collection, Sequence
from pathlib import Path
from types import TracebackType

from pipeline.cli.results.refusals import OutputError

LIST_NAME = ".camera-monitor-files"


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
