"""The paper's sentences beside our measurements: `claim` defines a claim, a file for each field lists its claims."""

from __future__ import annotations

from importlib import resources
from typing import Any

from pipeline.report.yaml_files import content


def descriptions() -> list[dict[str, Any]]:
    """The entries of ``claims.yaml``: fields of `Claim`, ``measure`` by name, with its ``options``."""
    return list(content(resources.files(__package__), "claims.yaml"))
