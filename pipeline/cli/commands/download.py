"""``camera-monitor download``: published pictures and kernels, fetched, verified and unpacked."""

from __future__ import annotations

from pathlib import Path

import click

from pipeline.cli.data_folders import RAW
from pipeline.cli.options.given_paths import GivenPath


@click.command("download")
@click.argument("name", required=False)
@click.option("--to", "folder", type=GivenPath(), help="folder that takes it; data/raw/NAME if left out")
@click.option("--keep-archives", is_flag=True, help="keep archives beside what was unpacked from them")
def command(name: str | None, folder: Path | None, keep_archives: bool) -> None:
    """Download the published data NAME, verify and unpack them; without NAME list what there is.

    An interrupted download goes on where it stopped. What is there already is verified, or, where it came from an
    archive, left as it is. Without a network the message says what to put where; the same command then verifies and
    unpacks it. Mind the licences.
    """
    if name is None:
        if folder is not None or keep_archives:
            raise click.UsageError("--to and --keep-archives need the NAME of what to download")
        _list()
        return
    from shlex import quote

    from tqdm import tqdm

    from pipeline import downloads
    from pipeline.datasets import published

    data = downloads.named(name, published.TABLE, "published data")
    target = RAW / name if folder is None else folder
    click.echo(f"{name}: {data.holds}; licence: {data.licence}")
    with tqdm(unit="B", unit_scale=True, unit_divisor=1000, delay=1, leave=False) as bar:

        def show(label: str, there: int, total: int | None) -> None:
            bar.unit = " files" if label.startswith("unpacking") else "B"
            bar.set_description(label, refresh=False)
            bar.total = total
            bar.n = there
            bar.refresh()

        brought = published.get(name, target, keep_archives=keep_archives, progress=show)
    files = f"{brought.files} file{'s' if brought.files != 1 else ''}"
    checked = "" if brought.first_use else ", SHA-256 as expected"
    click.echo(f"{target}: {files}, {brought.downloaded} downloaded{checked}")
    for kept in brought.kept:
        click.echo(f"{kept} was there and is left as it is")
    for file in brought.first_use:
        click.echo(
            f"no hash is published for {file}: this one is trusted at first use and recorded in "
            f"{target / downloads.LOCK}; compare it with another copy"
        )
    click.echo(f"next: {data.next_step.replace('FOLDER', quote(str(target)))}")


def _list() -> None:
    """Print what can be downloaded: name, size, whether it is here, licence, what it is."""
    from pipeline.datasets import published

    click.echo(f"{'name':14} {'MB':>8}  {'here':5} {'licence':24} holds")
    for name, data in published.TABLE.items():
        size = published.size_bytes(name)
        megabytes = f"{size / 1e6:8.1f}" if size is not None else f"{'?':>8}"
        here = "yes" if published.is_there(name, RAW / name) else "no"
        click.echo(f"{name:14} {megabytes}  {here:5} {data.licence:24} {data.holds}")
