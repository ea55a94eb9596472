"""The version of the installed package."""

from __future__ import annotations

DISTRIBUTION = "camera-condition-pipeline"


def version() -> str:
    """Version of the installed package; ``unknown`` where it runs without being installed."""
    from importlib import metadata

    try:
        return metadata.version(DISTRIBUTION)
    except metadata.PackageNotFoundError:
        return "unknown"
