"""The files that paths on the command line stand for: themselves, or the pictures and videos in folders, in order."""

from __future__ import annotations

import os
import re
import stat
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

import click

from pipeline.cli.frames.formats import PICTURES, UNREAD, VIDEOS, is_unread
from pipeline.errors import InputError, printable

_DIGITS = re.compile("([0-9]+)")


def expand(paths: Sequence[Path]) -> list[Path]:
    """Files named, and the pictures and videos directly inside folders named, each folder's in `natural_order`.

    A line on standard error counts what a folder has of formats that are not read (`UNREAD`); others name what has the
    name of a picture or video and is a folder, pipe or device, of which a pipe would be waited for without end.

    Raises:
        InputError: a path does not exist, or nothing is left.
    """
    results: list[Path] = []
    for path in paths:
        if path.is_dir():
            formats = PICTURES | VIDEOS | UNREAD
            inside = [file for file in path.iterdir() if file.name[0] != "." and file.suffix.lower() in formats]
            irregular = {file for file in inside if _is_irregular(file)}
            inside = [file for file in inside if file not in irregular]
            unread = {file for file in inside if is_unread(file)}
            results += sorted(set(inside) - unread, key=lambda file: natural_order(file.name))
            _warn_of_unread(path, Counter(file.suffix.lower() for file in unread))
            _warn_of_irregular(sorted(file for file in irregular if file.suffix.lower() not in UNREAD))
        elif path.is_file():
            results.append(path)
        elif path.exists():
            raise InputError(f"{path}: a pipe or device; expected a file or folder, camera-monitor watch reads cameras")
        else:
            raise InputError(f"{path}: no such file or folder")
    if not results:
        where = f"{', '.join(map(str, paths))}{_not_searched(paths)}"
        raise InputError(f"no pictures in {where}; expected {' '.join(sorted(PICTURES | VIDEOS))}")
    return results


def _not_searched(folders: Sequence[Path]) -> str:
    """That folders inside of folders are not searched, with the first of them; empty where there is none."""
    inside = sorted(str(folder / name) for folder in folders for name in shown_folders(folder.iterdir()))
    return f", whose sub-folders are not searched: name them, as {inside[0]}" if inside else ""


def shown_folders(entries: Iterable[Path | os.DirEntry[str]]) -> list[str]:
    """Names of the folders among the entries of a folder, sorted, without hidden ones."""
    return sorted(entry.name for entry in entries if entry.name[0] != "." and entry.is_dir())


def _warn_of_unread(folder: Path, unread: Counter[str]) -> None:
    if unread:
        counts = ", ".join(f"{count} {suffix}" for suffix, count in sorted(unread.items()))
        click.echo(
            f"warning: {printable(folder)}: left out {counts}; these formats are not read, convert them, for example "
            "to PNG",
            err=True,
        )


def _is_irregular(file: Path) -> bool:
    """Whether a path leads to a folder, pipe or device; not where it leads nowhere, whose reason its reader states."""
    try:
        return not stat.S_ISREG(file.stat().st_mode)
    except OSError:
        return False


def _warn_of_irregular(files: Sequence[Path]) -> None:
    for file in files:
        click.echo(f"warning: {printable(file)}: left out, it is a folder, pipe or device and no file", err=True)


def natural_order(name: str) -> tuple[list[str | int], str]:
    """Sorting key of names: numbers in them by value, so that ``9.png`` comes before ``10.png``.

    Args:
        name: of a file; of those that differ in leading zeros only, the more zeros come first.
    """
    parts = _DIGITS.split(name)  # text and digits in turn
    return [int(part) if index % 2 else part for index, part in enumerate(parts)], name
