"""``camera-monitor dataset``: look at a dataset before a run does."""

from __future__ import annotations

from pathlib import Path

import click


@click.command("dataset")
@click.argument("kind")
@click.argument("root", required=False, type=click.Path(path_type=Path))
@click.option("--max-bad-share", default=0.05, show_default=True, help="fail when more than this share is unusable")
def command(kind: str, root: Path | None, max_bad_share: float) -> None:
    """Check the dataset at ROOT, of KIND sim, photos, kitti, udacity or folder.

    Prints how many frames and objects are usable, what was mended, and each file that would be set aside and why.
    """
    from pipeline.datasets import open_dataset
    from pipeline.datasets.quarantine import scan

    dataset = open_dataset(kind, kind, root)
    found = scan(dataset, 1.0)
    objects = sum(not box.ignore for frame in found.usable for box in frame.boxes)
    click.echo(f"{len(found.usable)} usable frames, {objects} objects, {len(found.quarantined)} set aside")
    for note, count in sorted(found.notes.items()):
        click.echo(f"  {count:6d}  {note}")
    for row in found.quarantined:
        click.echo(f"  set aside  {row.file}: {row.reason}")
    scan(dataset, max_bad_share)
