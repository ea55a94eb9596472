"""Weight files that an estimator was made from, with their SHA-256, and the version of the package."""

from __future__ import annotations

import hashlib
import sys
from pathlib import Path
from typing import Any

DISTRIBUTION = "camera-condition-pipeline"
_DEPTH = 3  # an estimator, its members, theirs


def weight_hashes(*estimators: Any) -> dict[str, str]:
    """SHA-256 of the weight files of estimators and of the estimators they are made of.

    Args:
        estimators: blur and noise estimators of the registries. A module states its files in constants whose names
            begin with ``RELEASED``; those that are there count.

    Returns:
        file name -> SHA-256, sorted.
    """
    files: set[Path] = set()
    for estimator in estimators:
        _collect(estimator, files, _DEPTH)
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(files) if path.is_file()}


def version() -> str:
    """Version of the installed package; ``unknown`` where it runs without being installed."""
    from importlib import metadata

    try:
        return metadata.version(DISTRIBUTION)
    except metadata.PackageNotFoundError:
        return "unknown"


def _collect(estimator: Any, files: set[Path], depth: int) -> None:
    from pipeline.weight_files import active

    module = sys.modules.get(type(estimator).__module__)
    for name, value in vars(module).items() if module else ():
        if name.startswith("RELEASED") and isinstance(value, Path):
            files.add(active(value))
    if depth:
        members = list(getattr(estimator, "__dict__", {}).values())
        for member in members:
            for part in member.values() if isinstance(member, dict) else [member]:
                if type(part).__module__.startswith("pipeline."):
                    _collect(part, files, depth - 1)
