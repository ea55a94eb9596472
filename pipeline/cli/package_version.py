"""Versions of installed packages."""

from __future__ import annotations

DISTRIBUTION = "camera-condition-pipeline"


def version(distribution: str = DISTRIBUTION, absent: str = "unknown") -> str:
    """Version of an installed package.

    Args:
        distribution: its name; this one by default.
        absent: what is returned where it is not installed, as where this one runs from a checkout.
    """
    from importlib import metadata

    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return absent
