"""Configurations for tests of something else: each is composed once a process, which takes most of a second."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any

from pipeline import yaml_text
from pipeline.config.compose import compose
from pipeline.config.schema import Config, validate

ROOT = Path(__file__).resolve().parents[1]


@functools.cache
def _text(*overrides: str) -> str:
    return compose(overrides, ROOT / "conf")


def content(*overrides: str) -> dict[str, Any]:
    """What ``conf/`` gives with these overrides, as nested mappings of the caller's own."""
    return yaml_text.parse(_text(*overrides))


def config(*overrides: str) -> Config:
    """What ``conf/`` gives with these overrides, checked against the schema."""
    return validate(content(*overrides), "conf/")


def graph() -> dict[str, Any]:
    """What ``dvc.yaml`` holds."""
    return yaml_text.parse((ROOT / "dvc.yaml").read_text(encoding="utf-8"))
