"""What the sections of the page say, one file for each: its tables, figures, captions and paragraphs."""

from __future__ import annotations

from importlib import resources
from typing import Any

from pipeline.report.yaml_files import content


def description(section: str) -> Any:
    """The content of a section's YAML file."""
    return content(resources.files(__package__), f"{section}.yaml")
