"""Paths on the command line: empty ones and files of another format are refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from pipeline.errors import InputError

ADDRESS_MARK = "://"


class GivenPath(click.Path):
    """A path that is neither empty nor the address of a stream.

    An unset shell variable (``"$FOLDER"``) would name the current folder.
    """

    def __init__(self, *, dir_okay: bool = True) -> None:
        super().__init__(path_type=Path, dir_okay=dir_okay)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The path, or a usage error where it is empty or an address."""
        if not str(value):
            self.fail("the path is empty; name a file or folder, . for the current folder.", param, ctx)
        if ADDRESS_MARK in str(value) and not Path(value).exists():
            from pipeline.cli.watching.newest_frame import without_credentials

            address = without_credentials(str(value))
            self.fail(f"{address}: an address; name a file or folder. camera-monitor watch reads streams.", param, ctx)
        return super().convert(value, param, ctx)


def refuse_other_format(surface: Path) -> None:
    """Refuse a file that is no ``.npz`` archive, before it is read as a surface of average precision.

    Args:
        surface: the file that the user named; what cannot be opened is left to the reader, which states why.

    Raises:
        InputError: it begins like no such archive.
    """
    try:
        with surface.open("rb") as file:
            start = file.read(2)
    except OSError:
        return
    if start != b"PK":
        raise InputError(
            f"{surface}: not a surface of average precision (.npz); name one that dvc repro or camera-monitor curves "
            "record wrote"
        )
