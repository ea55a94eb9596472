"""What lies in a dataset's folder and is no frame: where no picture is read, that tells which folder is meant."""

from __future__ import annotations

import os
from collections import Counter
from pathlib import Path

from pipeline.datasets.pictures import SUFFIXES
from pipeline.errors import printable

_MOST = 3  # folders and suffixes named


def what_lies_there(root: Path, searched: Path) -> str:
    """What a folder without a picture holds, and where else below the dataset's folder there are pictures.

    Args:
        root: the dataset's folder.
        searched: where pictures are read; the same, one below it, or another.

    Returns:
        a part of a sentence, beginning with a comma; files and folders whose names begin with ``.`` do not count.
    """
    names = [path for path in searched.iterdir() if path.name[0] != "."]
    suffixes = Counter(path.suffix.lower() or "unnamed" for path in names if path.is_file())
    held = [f"{count} {suffix} {'file' if count == 1 else 'files'}" for suffix, count in suffixes.most_common(_MOST)]
    rest = suffixes.total() - sum(count for _, count in suffixes.most_common(_MOST))
    text = f", which holds {', '.join(held)}{f' and {rest} more' if rest else ''}" if held else ", which holds no file"
    folders = pictures_by_folder(root)
    if folders:
        listed = ", ".join(f"{printable(folder)} ({count})" for folder, count in folders.most_common(_MOST))
        more = f" and {len(folders) - _MOST} more folders" if len(folders) > _MOST else ""
        text += f"; pictures lie in {listed}{more}, where none is read: move those that are meant"
    return text


def pictures_by_folder(root: Path) -> Counter[Path]:
    """How many pictures lie directly in each folder below one, and in itself; hidden ones do not count."""
    counts: Counter[Path] = Counter()
    for folder, below, files in os.walk(root):
        below[:] = sorted(name for name in below if name[0] != ".")
        count = sum(name[0] != "." and Path(name).suffix.lower() in SUFFIXES for name in files)
        if count:
            counts[Path(folder)] = count
    return counts
