"""``camera-monitor dataset``: look at a dataset before a run does."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from pipeline.cli.options.given_paths import GivenPath
from pipeline.cli.options.numbers import FiniteRange
from pipeline.errors import InputError, printable

if TYPE_CHECKING:
    from pipeline.datasets.frame import Box
    from pipeline.detection.classes import ClassMap

FLAT_KINDS = frozenset({"sim", "kitti", "udacity", "folder"})
"""Kinds of datasets whose pictures lie directly in one folder; others may use its sub-folders."""


@click.command("dataset")
@click.argument("kind")
@click.argument("root", required=False, type=GivenPath())
@click.option(
    "--max-rejected-fraction", default=0.05, show_default=True, type=FiniteRange(0, 1),
    help="fail when more than this share is unusable",
)  # fmt: skip
def command(kind: str, root: Path | None, max_rejected_fraction: float) -> None:
    """Check the dataset at ROOT, of KIND sim, photos, kitti, udacity or folder.

    Prints how many frames and objects are usable, the objects of each class with the range of their sizes and what they
    are to detectors (objects, ignored or left out), what was mended, how many pictures are no frames, and each file
    that would be set aside and why.
    """
    from pipeline.datasets import open_dataset
    from pipeline.datasets.decoding.pictures import SUFFIXES
    from pipeline.datasets.passed_over import files_below
    from pipeline.datasets.quarantine import scan
    from pipeline.experiments.class_maps import mistaken_words

    dataset = open_dataset(kind, kind, root)
    checked = scan(dataset, 1.0)
    boxes = [box for frame in checked.usable for box in frame.boxes]
    objects = sum(not box.ignore for box in boxes)
    click.echo(f"{len(checked.usable)} usable frames, {objects} objects, {len(checked.quarantined)} set aside")
    words = words_of(kind)
    for line in class_table(boxes, words):
        click.echo(f"  {line}")
    counts = Counter(box.label for box in boxes)
    for word, right in mistaken_words(counts, kind).items() if words else ():
        click.echo(f"  {counts[word]:6d}  boxes of '{word}' are no '{right}' to detectors: write the word exactly so")
    for note, count in sorted(checked.notes.items()):
        click.echo(f"  {count:6d}  {note}")
    for suffix, count in sorted(other_formats(dataset.root).items()):
        click.echo(
            f"  {count:6d}  {suffix} files are no frames: datasets hold PNG, JPEG, TIFF and the like; convert them"
        )
    for folder in {frame.path.parent for frame in checked.usable} if kind in FLAT_KINDS else ():
        below = [path for path in files_below(folder, SUFFIXES) if path.parent != folder]
        if below:
            example = printable(below[0].parent.relative_to(dataset.root))
            click.echo(f"  {len(below):6d}  pictures in sub-folders such as {example} are no frames: move them up")
    beside = pictures_beside(dataset.root, dataset.searched) if kind == "folder" else []
    if beside:
        first, images = (printable(path.relative_to(dataset.root)) for path in (beside[0], dataset.searched))
        click.echo(f"  {len(beside):6d}  pictures beside the folder {images} such as {first} are no frames")
    for row in checked.quarantined:
        click.echo(f"  set aside  {row.file}: {row.reason}")
    scan(dataset, max_rejected_fraction)


def other_formats(root: Path) -> Counter[str]:
    """How many pictures below a dataset's folder are of formats that datasets pass over, by suffix.

    Args:
        root: the folder; see `pipeline.datasets.passed_over.files_below`.
    """
    from pipeline.cli.frames.formats import PICTURES, UNREAD
    from pipeline.datasets.decoding.pictures import SUFFIXES
    from pipeline.datasets.passed_over import files_below

    return Counter(path.suffix.lower() for path in files_below(root, (PICTURES | UNREAD) - SUFFIXES))


def pictures_beside(root: Path, searched: Path) -> list[Path]:
    """Pictures of a dataset's folder that are not in the sub-folder that its frames are read from; none without one."""
    from pipeline.datasets.decoding.pictures import SUFFIXES
    from pipeline.datasets.passed_over import files_below

    return [path for path in files_below(root, SUFFIXES) if not path.is_relative_to(searched)]


def words_of(kind: str) -> ClassMap | None:
    """What the words of a dataset's labels mean to detectors; None where its kind defines nothing."""
    from pipeline.experiments.class_maps import class_map

    try:
        return class_map(kind)
    except InputError:
        return None


def class_table(boxes: Iterable[Box], words: ClassMap | None = None) -> Iterator[str]:
    """A text table of the classes: objects, ignored ones, and minimum, median and maximum of width and height.

    Args:
        boxes: of any number of frames.
        words: what the classes are to detectors, for a last column; without it there is none.

    Returns:
        its lines, none where there is no box; most frequent class first.
    """
    from statistics import median

    from pipeline.experiments.class_maps import role_of

    by_class: dict[str, list[Box]] = {}
    for box in boxes:
        by_class.setdefault(box.label, []).append(box)
    if not by_class:
        return
    width = max(len("class"), *map(len, by_class))
    yield f"{'class':{width}} {'objects':>8} {'ignored':>8}  {'width px: min':>14} {'med':>6} {'max':>6}" + (
        f"  {'height px: min':>14} {'med':>6} {'max':>6}{'  to detectors' if words else ''}"
    )
    for label, members in sorted(by_class.items(), key=lambda item: (-len(item[1]), item[0])):
        ignored = sum(box.ignore for box in members)
        sides = ([box.width_px for box in members], [box.height_px for box in members])
        ranges = "".join(f"  {min(side):14.1f} {median(side):6.1f} {max(side):6.1f}" for side in sides)
        role = f"  {role_of(label, members, words)}" if words else ""
        yield f"{label:{width}} {len(members) - ignored:8d} {ignored:8d}{ranges}{role}"
