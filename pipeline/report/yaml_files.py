"""Descriptions of the report as data: YAML files beside its modules."""

from __future__ import annotations

from importlib import resources
from typing import Any


def content(file: str) -> Any:
    """The content of a YAML file of this package, e.g. ``"sections/blur.yaml"``."""
    import yaml

    return yaml.safe_load(resources.files(__package__).joinpath(file).read_text(encoding="utf-8"))
