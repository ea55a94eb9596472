"""The group of commands: each is imported when it is called, and every mistake is one line and an exit code."""

from __future__ import annotations

import importlib
import traceback
from collections.abc import Mapping
from types import FrameType
from typing import Any

import click

from pipeline.cli.addresses import without_credentials
from pipeline.cli.ending_signals import ENDING_SIGNALS, not_ignored
from pipeline.cli.exit_codes import INTERRUPTED, REFUSED
from pipeline.errors import InputError, did_you_mean, printable
from pipeline.signals import handled


class LazyGroup(click.Group):
    """A group whose commands are the modules of a package.

    Args:
        package: whose module NAME holds the command NAME as ``command``.
        descriptions: names of the commands, and what each does, in the order of the help.
        settings: of `click.Group`.
    """

    def __init__(self, *, package: str, descriptions: Mapping[str, str], **settings: Any) -> None:
        super().__init__(**settings)
        self._package, self._descriptions = package, descriptions

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(self._descriptions)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        if name not in self._descriptions:
            return None
        command: click.Command = importlib.import_module(f"{self._package}.{name}").command
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(list(self._descriptions.items()))

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if args and args[0] not in self._descriptions and not args[0].startswith("-"):
            raise click.UsageError(f"no command '{args[0]}'; {did_you_mean(args[0], self._descriptions)}")
        return super().resolve_command(ctx, args)

    def invoke(self, ctx: click.Context) -> Any:
        try:
            with handled(not_ignored(ENDING_SIGNALS), _interrupt):
                return super().invoke(ctx)
        except InputError as error:
            lines = [_shown(line) for line in str(error).split("\n")]
            click.echo("error: " + "\n".join(lines), err=True)
            raise SystemExit(REFUSED) from None
        except click.UsageError as error:
            if type(error).__name__ == "NoArgsIsHelpError":  # a group called without a command shows its help
                raise
            hint = f"; see {error.ctx.command_path} --help" if error.ctx is not None else ""
            click.echo(f"error: {_shown(error.format_message().rstrip('.'))}{hint}", err=True)
            raise SystemExit(REFUSED) from None
        except BrokenPipeError:
            raise  # click ends quietly: whoever read the output has enough
        except OSError as error:
            file = printable(f"{error.filename}: ") if error.filename else ""
            click.echo(f"error: {file}{error.strerror or error}", err=True)
            raise SystemExit(REFUSED) from None
        except EOFError as error:  # click takes it for the end of an input, and says "Aborted!"
            *_, (frame, _) = traceback.walk_tb(error.__traceback__)
            compiled = frame.f_locals.get("bytecode_path")  # Python keeps modules that a full disk has cut short
            if compiled is None:
                raise
            click.echo(f"error: {printable(compiled)}: cut short, as by a full disk; delete it", err=True)
            raise SystemExit(REFUSED) from None
        except KeyboardInterrupt:
            click.echo("interrupted; what was finished is written", err=True)
            raise SystemExit(INTERRUPTED) from None


def _shown(line: str) -> str:
    """A line of an error: names of files may hold any character, and any argument may be an address by mistake."""
    return printable(without_credentials(line))


def _interrupt(number: int, frame: FrameType | None) -> None:
    """End a command as Ctrl-C does, so that results are closed properly."""
    raise KeyboardInterrupt
