"""Links to folders in what stages depend on: DVC does not look behind them, so that edits there would go unnoticed.

DVC follows a link that is itself the dependency, and links to files; what lies behind a link to a folder further down
is no part of its hash.
"""

from __future__ import annotations

import os
import shlex
from pathlib import Path

from pipeline.errors import InputError


def refuse_linked_folders(folder: str | Path | None, setting: str) -> None:
    """Refuse a folder below which links lead to other folders.

    Args:
        folder: that a stage depends on; it may be a link itself. None, or one that is not there, is passed.
        setting: that names it, for the message.

    Raises:
        InputError: there is such a link; names the first.
    """
    for parent, below, _ in os.walk(folder) if folder is not None else ():
        for name in sorted(below):
            link = Path(parent, name)
            if link.is_symlink():
                here, there = (shlex.quote(str(path)) for path in (link, link.resolve()))
                raise InputError(
                    f"{setting}={folder}: {link} is a link to a folder, behind which DVC notices no edit; make"
                    f" {folder} itself the link or name the real folder, or link the files one by one"
                    f" (rm {here}; cp -rs {there} {here})"
                )
