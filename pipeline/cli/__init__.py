"""``camera-monitor``: the pipeline's tools on your own footage.

Each command is one file; it is imported when it is called, so that ``--help`` answers at once. Exit codes: 0 fine,
2 wrong input or results that cannot be written, 3 alarm (``health``, ``watch``, ``budget``), 130 interrupted.
"""

from __future__ import annotations

import importlib
import signal
import traceback
from collections.abc import Iterable
from types import FrameType
from typing import Any

import click

from pipeline.errors import InputError, printable
from pipeline.signals import handled

COMMANDS = {
    "health": "Estimate blur and noise of pictures or videos together, with intervals and maps.",
    "watch": "Watch a running camera, stream or filling folder: JSON lines and alarms.",
    "calibrate": "Calibrate a camera from sharp pictures or a chart, for --camera NAME.",
    "noise": "Estimate the noise of pictures or videos, over the frame and over time.",
    "corrupt": "Corrupt pictures to a noise level or a blur, with the truth beside them.",
    "dataset": "Check a dataset: what is usable, what would be set aside and why.",
    "render": "Render frames of the procedural dataset Sim.",
    "blur": "Measure blur estimators on recorded pictures: the paper's Table I.",
    "record": "Measure estimators on your frames and photographs, sensors on raw frames.",
    "curves": "Ask measured curves for a detector's average precision at some noise and blur.",
    "advise": "Advise exposure and gain for pictures, and say why.",
    "budget": "Compare the noise of pictures with what their sensor explains, by source.",
    "doctor": "State what is installed, which weights and data are there, what runs.",
    "init": "Make a small project with a dataset, estimator, detector and policy of one's own.",
    "report": "Compare the numbers of two reports.",
    "export": "Export a released network to ONNX.",
    "weights": "List, download and verify published detector weights.",
    "download": "Download and verify published pictures: KITTI, Udacity, real noise, raw frames.",
}

ALARM = 3  # exit code of ``health``, ``watch`` and ``budget``
INTERRUPTED = 130  # exit code after Ctrl-C, SIGTERM or SIGHUP
ENDING_SIGNALS = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))


class _Lazy(click.Group):
    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        if name not in COMMANDS:
            return None
        command: click.Command = importlib.import_module(f"pipeline.cli.commands.{name}").command
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        from pipeline.errors import did_you_mean

        if args and args[0] not in COMMANDS and not args[0].startswith("-"):
            raise click.UsageError(f"no command '{args[0]}'; {did_you_mean(args[0], COMMANDS)}")
        return super().resolve_command(ctx, args)

    def invoke(self, ctx: click.Context) -> Any:
        try:
            with handled(not_ignored(ENDING_SIGNALS), _interrupt):
                return super().invoke(ctx)
        except InputError as error:
            lines = [printable(line) for line in str(error).split("\n")]  # names of files may hold any character
            click.echo("error: " + "\n".join(lines), err=True)
            raise SystemExit(2) from None
        except click.UsageError as error:
            if type(error).__name__ == "NoArgsIsHelpError":  # a group called without a command shows its help
                raise
            hint = f"; see {error.ctx.command_path} --help" if error.ctx is not None else ""
            click.echo(f"error: {printable(error.format_message().rstrip('.'))}{hint}", err=True)
            raise SystemExit(2) from None
        except BrokenPipeError:
            raise  # click ends quietly: whoever read the output has enough
        except OSError as error:
            file = printable(f"{error.filename}: ") if error.filename else ""
            click.echo(f"error: {file}{error.strerror or error}", err=True)
            raise SystemExit(2) from None
        except EOFError as error:  # click takes it for the end of an input, and says "Aborted!"
            *_, (frame, _) = traceback.walk_tb(error.__traceback__)
            compiled = frame.f_locals.get("bytecode_path")  # Python keeps modules that a full disk has cut short
            if compiled is None:
                raise
            click.echo(f"error: {printable(compiled)}: cut short, as by a full disk; delete it", err=True)
            raise SystemExit(2) from None
        except KeyboardInterrupt:
            click.echo("interrupted; what was finished is written", err=True)
            raise SystemExit(INTERRUPTED) from None


def not_ignored(numbers: Iterable[signal.Signals]) -> list[signal.Signals]:
    """Signals without those that the program was started to ignore, as ``nohup`` has SIGHUP ignored."""
    return [number for number in numbers if signal.getsignal(number) is not signal.SIG_IGN]


def _interrupt(number: int, frame: FrameType | None) -> None:
    """End a command as Ctrl-C does, so that results are closed properly."""
    raise KeyboardInterrupt


@click.group(cls=_Lazy, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.version_option(package_name="camera-condition-pipeline")
def main() -> None:
    """Monitor the physical condition of a camera, on your own pictures."""
