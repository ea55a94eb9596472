"""Descriptions of the report as data: YAML files beside its modules."""

from __future__ import annotations

from importlib.resources.abc import Traversable
from typing import Any

from pipeline import yaml_text


def content(folder: Traversable, name: str) -> Any:
    """The content of a YAML file in the folder of a package (`importlib.resources.files`)."""
    return yaml_text.parse(folder.joinpath(name).read_text(encoding="utf-8"))
