"""Where estimators find their weights when none are named: the released files, or those of the profile that runs.

A run of a profile other than the default trains weights of its own below its root; its stages, and the worker processes
they start, take them from there. An environment variable carries the folder, so that workers have it too.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

VARIABLE = "CAMERA_CONDITION_WEIGHTS"


def active(released: str | Path) -> Path:
    """The file to load in place of a released one: the same name in the active folder, if there is one.

    Args:
        released: path of the released file.
    """
    folder = os.environ.get(VARIABLE)
    return Path(folder) / Path(released).name if folder else Path(released)


@contextlib.contextmanager
def active_folder(folder: Path | None) -> Iterator[None]:
    """Take weights from a folder within the block.

    Args:
        folder: of weight files; None for the released ones.
    """
    before = os.environ.get(VARIABLE)
    try:
        set_folder(None if folder is None else str(folder.resolve()))
        yield
    finally:
        set_folder(before)


def set_folder(folder: str | None) -> None:
    """Set or unset the active folder of this process and its children."""
    if folder is None:
        os.environ.pop(VARIABLE, None)
    else:
        os.environ[VARIABLE] = folder
