"""Files and frames that a command cannot use: named as they occur, and in its error at the end."""

from __future__ import annotations

import click

from pipeline.cli.frames.names import named
from pipeline.errors import InputError, printable


class SetAside:
    """Collects what cannot be used, so that a command goes on with the rest.

    Attributes:
        names: of the files or frames, in order.
        reasons: each with the name, what was expected and how to mend it.
    """

    def __init__(self) -> None:
        self.names: list[str] = []
        self.reasons: list[str] = []

    def add(self, name: str, error: InputError) -> None:
        """Name a file or frame on standard error.

        Args:
            name: of it.
            error: why it cannot be used.
        """
        self.names.append(name)
        self.reasons.append(named(name, error))
        click.echo(f"set aside: {printable(self.reasons[-1])}", err=True)

    def refuse(self) -> None:
        """The end of a command.

        Raises:
            InputError: something could not be used.
        """
        if self.names:
            first = printable(self.names[0])
            which = first if len(self.names) == 1 else f"{len(self.names)} files or frames, the first {first},"
            raise InputError(f"{which} could not be used, or not in full; see above")
