"""What lies in a dataset's folder and is no frame: where no picture is read, that tells which folder is meant."""

from __future__ import annotations

from collections import Counter
from collections.abc import Set
from pathlib import Path

from pipeline.datasets.decoding.pictures import SUFFIXES
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
    names = [path for path in sorted(searched.iterdir()) if path.name[0] != "."]
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
    return Counter(sorted(path.parent for path in files_below(root, SUFFIXES)))


def files_below(folder: Path, suffixes: Set[str]) -> list[Path]:
    """Files in a folder and its sub-folders, sorted; hidden ones and those of hidden sub-folders do not count.

    Args:
        folder: the folder.
        suffixes: in lower case.
    """
    files = (path for path in folder.rglob("[!.]*") if path.suffix.lower() in suffixes and path.is_file())
    return sorted(path for path in files if not any(part[0] == "." for part in path.relative_to(folder).parts))
