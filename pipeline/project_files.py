"""Released files that code needs at run time: beside the package in a checkout, inside it once it is installed.

Weights are tracked by git in ``data/weights`` as outputs of their training stages. Building a wheel copies them into
the package (``setup.py``), so that an installed ``camera-monitor`` works in any folder.
"""

from __future__ import annotations

from pathlib import Path

PACKAGE = Path(__file__).resolve().parent
WEIGHTS = Path("data/weights")
INSTALLED_WEIGHTS = PACKAGE / "released_weights"


def located(path: str) -> Path:
    """Where a released file lies.

    Args:
        path: its path in a checkout, ``data/weights/NAME``.

    Returns:
        that file of this checkout, whatever the current folder; without a checkout, the installed copy.
    """
    relative = Path(path)
    checkout = PACKAGE.parent
    if relative.parent == WEIGHTS and not (checkout / WEIGHTS).is_dir():
        return INSTALLED_WEIGHTS / relative.name
    return checkout / relative
