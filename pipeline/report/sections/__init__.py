"""The sections of the page, one file each, in the paper's order; beside it, its tables, captions and paragraphs."""

from __future__ import annotations

from importlib import resources
from typing import Any


def description(section: str) -> Any:
    """The content of a section's YAML file."""
    import yaml

    return yaml.safe_load(resources.files(__package__).joinpath(f"{section}.yaml").read_text(encoding="utf-8"))
