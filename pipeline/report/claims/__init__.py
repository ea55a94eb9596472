"""The paper's sentences beside our measurements: `claim` defines a claim, a file for each field lists its claims."""

from __future__ import annotations

from importlib import resources
from typing import Any


def descriptions() -> list[dict[str, Any]]:
    """The entries of ``claims.yaml``: fields of `Claim`, ``measure`` by name, with its ``options``."""
    import yaml

    return list(yaml.safe_load(resources.files(__package__).joinpath("claims.yaml").read_text(encoding="utf-8")))
