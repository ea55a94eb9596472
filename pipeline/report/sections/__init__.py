"""The sections of the page, one file each, in the paper's order; beside it, its tables, captions and paragraphs."""

from __future__ import annotations

from importlib import resources
from typing import Any

from pipeline.report.yaml_files import content


def description(section: str) -> Any:
    """The content of a section's YAML file."""
    return content(resources.files(__package__), f"{section}.yaml")
