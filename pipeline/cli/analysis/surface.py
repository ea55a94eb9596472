"""The measured surface of average precision: the file that the user names, else that of the checkout."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.errors import InputError

if TYPE_CHECKING:
    from pipeline.control.performance import Performance

SURFACE = "data/control_surface/all.npz"


def find_surface(named: Path | None) -> tuple[Performance | None, str]:
    """The surface of average precision.

    Args:
        named: by the user; None for that of the checkout.

    Returns:
        it, or None with the reason why there is none.

    Raises:
        InputError: the file that was named is missing or broken.
    """
    from pipeline.control.performance import Performance
    from pipeline.project_files import located

    if named is not None:
        refuse_other_format(named)
        return Performance.load(named), ""
    for path in (Path(SURFACE), located(SURFACE)):
        if path.is_file():
            return Performance.load(path), ""
    return None, f"no measured surface {SURFACE} (dvc repro makes it; --surface FILE names another)"


def refuse_other_format(surface: Path) -> None:
    """Refuse a file that is no ``.npz`` archive, before it is read as a surface of average precision.

    Args:
        surface: the file that the user named; what cannot be opened is left to the reader, which states why.

    Raises:
        InputError: it begins like no such archive.
    """
    try:
        with surface.open("rb") as file:
            start = file.read(2)
    except OSError:
        return
    if start != b"PK":
        raise InputError(
            f"{surface}: not a surface of average precision (.npz); name one that dvc repro or camera-monitor curves "
            "record wrote"
        )
