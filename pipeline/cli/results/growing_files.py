"""Tables and JSON lines that are written entry by entry, so that an interrupted run keeps every finished one."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from pipeline.cli.results.refusals import OutputError

FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r")  # a spreadsheet runs text that begins with one of these


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
