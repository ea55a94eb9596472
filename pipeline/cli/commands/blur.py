"""``camera-monitor blur``: measure blur estimators on recorded pictures."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import click

from pipeline.cli.options.given_paths import GivenPath
from pipeline.cli.recording import options

_PER_FRAME = re.compile(r"[+~]*(blur\.estimators\.[^.=]+\.per_frame)(=.*)?", re.DOTALL)


@click.group("blur")
def command() -> None:
    """Measure blur estimators on pictures of one's own; ``camera-monitor health`` asks one of them."""


@command.command("record", epilog=options.IN_CHECKOUT)
@options.overrides_argument
@options.dataset_option
@click.option(
    "--estimator",
    "estimators",
    multiple=True,
    help="name of an estimator of the configuration; may be repeated, by default all",
)
@options.to_option
@click.option("--join", is_flag=True, help="keep what the folder has of other estimators, measured on the same")
@click.option("--frames", "frame_count", type=click.IntRange(min=2), help="of the frames with patches, this many only")
@click.option(
    "--patches",
    "patches_per_frame",
    type=click.IntRange(min=1),
    help="of each frame, this many only; per_frame in conf/ is for the stages",
)
@options.keep_option
@options.source_option
@options.workers_option
def record_command(
    overrides: tuple[str, ...],
    dataset: str,
    estimators: tuple[str, ...],
    out: Path,
    join: bool,
    frame_count: int | None,
    patches_per_frame: int | None,
    keep: Path | None,
    source: str,
    workers: int,
) -> None:
    """Measure Table I on recorded pictures and keep numbers and provenance; no picture is kept.

    OVERRIDES are of conf/, as for ``dvc exp run -S``: +dataset@datasets.kitti=kitti datasets.kitti.root=/path
    psf=paper psf.folder=/path blur.patches_per_frame=4; PMP and GBB as the paper ran them:
    +estimator/blur@blur.estimators.gbb_exact=gbb_exact
    """
    from pipeline.cli.recording.config import recording_config
    from pipeline.recording.blur import RESULTS, record
    from pipeline.recording.frames import Request
    from pipeline.recording.kept_results import keeping

    _refuse_per_frame(overrides)
    config = recording_config(overrides, out, dataset, RESULTS, keep, estimators=estimators)
    metrics = record(
        Request(config, dataset, out, source, keeping(keep, workers)),
        list(dict.fromkeys(estimators)) or list(config.blur.estimators),
        join=join,
        frame_count=frame_count,
        patches_per_frame=patches_per_frame,
    )
    for name, variants in metrics.items():
        numbers = [f"{variant} {row['mean_amae_percent']:.2f} %" for variant, row in sorted(variants.items())]
        click.echo(f"{name}: mean AMAE {', '.join(numbers)}")
    click.echo(f"written to {out}")


def _refuse_per_frame(overrides: Sequence[str]) -> None:
    """Raises InputError for an override of how many patches the stages take of a frame, which a record ignores."""
    from pipeline.errors import InputError

    for override in overrides:
        if setting := _PER_FRAME.fullmatch(override):
            raise InputError(
                f"{setting[1]}: a setting of the stages, without effect on a record; --patches measures fewer patches "
                "of each frame"
            )


@command.command("summarise")
@click.argument("folder", type=GivenPath())
@click.option("--kept", type=GivenPath(), help="finished frames that --keep stored while it was measured")
def summarise_command(folder: Path, kept: Path | None) -> None:
    """Compute the statistics of the record in FOLDER again from the estimates behind it; nothing is measured.

    For a record that was measured before a change of intervals. The provenance names the estimators.
    """
    from pipeline.cli.results.refusals import refuse_unwritable
    from pipeline.recording.blur_statistics import summarise_again

    refuse_unwritable(folder, "FOLDER")
    changed = summarise_again(folder, kept)
    click.echo(f"changed: {', '.join(changed)}" if changed else "nothing changed")
    click.echo(f"written to {folder}")
