"""Settings of a dataset."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

from pipeline.settings import Count, Fraction, Name, Settings


class DatasetSettings(Settings):
    """One dataset: which reader, where it lies, how much of it is used."""

    kind: Name
    root: str | None
    dvc_dependency: str
    limit: Count | None = None
    whitelist: str | None = None
    max_rejected_fraction: Fraction = 0.05
    options: dict[str, Any] = Field(default_factory=dict)


Datasets = Annotated[dict[Name, DatasetSettings], Field(min_length=1)]
"""Datasets by name."""
