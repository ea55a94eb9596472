"""``camera-monitor``: the pipeline's tools on your own footage.

Each command is one file; it is imported when it is called, so that ``--help`` answers at once.
"""

from __future__ import annotations

import importlib
from typing import Any

import click

from pipeline.errors import InputError

COMMANDS = {
    "health": "Estimate blur and noise of pictures or videos together, with intervals and maps.",
    "noise": "Estimate the noise of pictures or videos, over the frame and over time.",
    "corrupt": "Corrupt pictures to a noise level or a blur, with the truth beside them.",
    "dataset": "Check a dataset: what is usable, what would be set aside and why.",
    "render": "Render frames of the procedural dataset Sim.",
    "blur": "Measure blur estimators on recorded pictures: the paper's Table I.",
    "curves": "Ask measured curves for a detector's average precision at some noise and blur.",
    "weights": "List, download and verify published detector weights.",
}


class _Lazy(click.Group):
    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        if name not in COMMANDS:
            return None
        command: click.Command = importlib.import_module(f"pipeline.cli.{name}").command
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
            return super().invoke(ctx)
        except InputError as error:
            click.echo(f"error: {error}", err=True)
            raise SystemExit(2) from None


@click.group(cls=_Lazy, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.version_option(package_name="camera-condition-pipeline")
def main() -> None:
    """Monitor the physical condition of a camera, on your own pictures."""
