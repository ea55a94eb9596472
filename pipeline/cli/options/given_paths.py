"""Paths on the command line: empty ones, and addresses of streams, are refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from pipeline.cli.addresses import ADDRESS_MARK, begins_as_address, without_credentials


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
        if (ADDRESS_MARK in str(value) or begins_as_address(str(value))) and not Path(value).exists():
            address = without_credentials(str(value))
            self.fail(f"{address}: an address; name a file or folder. camera-monitor watch reads streams.", param, ctx)
        return super().convert(value, param, ctx)
