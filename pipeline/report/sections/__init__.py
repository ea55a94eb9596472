"""The sections of the page, one file each, in the paper's order."""

from __future__ import annotations

from importlib import resources
from importlib.resources.abc import Traversable


def description(section: str) -> Traversable:
    """The file of a section's tables, captions and paragraphs, read by `pipeline.report.descriptions`."""
    return resources.files("pipeline.report.sections").joinpath(f"{section}.yaml")
