"""``camera-monitor weights``: published detector weights, fetched and verified."""

from __future__ import annotations

from pathlib import Path

import click

from pipeline.cli.data_folders import DETECTOR_WEIGHTS
from pipeline.cli.options.given_paths import GivenPath


@click.group("weights")
def command() -> None:
    """Get published detector weights. Only this and `download` use the network."""


@command.command("list")
@click.option("--to", "folder", default=DETECTOR_WEIGHTS, show_default=True, type=GivenPath(), help="look here")
def list_weights(folder: Path) -> None:
    """List what can be got: name, detector, size, whether its hash is published, licence, whether it is here."""
    from pipeline.detection.weights_table import TABLE

    click.echo(f"{'name':20} {'detector':12} {'MB':>6}  {'SHA-256':12} {'here':5} licence")
    for name, entry in TABLE.items():
        size = f"{entry.size_bytes / 1e6:6.1f}" if entry.size_bytes else f"{'?':>6}"
        digest = entry.sha256[:12] if entry.sha256 else "unpublished"
        here = "yes" if (folder / entry.file).is_file() else "no"
        click.echo(f"{name:20} {entry.detector:12} {size}  {digest:12} {here:5} {entry.licence}")


@command.command("get")
@click.argument("name")
@click.option("--to", "folder", default=DETECTOR_WEIGHTS, show_default=True, type=GivenPath(), help="into here")
@click.option("--sha256", help="expected hash, for a file whose hash is not published")
def get_weights(name: str, folder: Path, sha256: str | None) -> None:
    """Download NAME and verify it, or verify it if it is there. An interrupted download goes on where it stopped."""
    from tqdm import tqdm

    from pipeline import downloads
    from pipeline.detection.weights_table import TABLE

    entry = downloads.named(name, TABLE, "weights")
    with tqdm(desc=entry.file, unit="B", unit_scale=True, unit_divisor=1000, delay=1, leave=False) as bar:

        def show(there: int, total: int | None) -> None:
            bar.total = total
            bar.update(there - bar.n)

        result = downloads.get(entry, folder, sha256, show)
    label = "downloaded" if result.downloaded else "already there"
    click.echo(f"{result.path}: {label}, SHA-256 {result.sha256}")
    if result.trust == "first use":
        click.echo(
            f"no hash is published for {entry.file}: this one is trusted at first use and recorded in"
            f" {folder / downloads.LOCK}; compare it with another copy, or give --sha256"
        )
    else:
        click.echo(f"equals the {result.trust} hash")
    if entry.note:
        click.echo(entry.note)
