"""Datasets by name."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field

from pipeline.config.schema_base import Count, Name, Section, Share


class DatasetSection(Section):
    """One dataset: which reader, where it lies, how much of it is used."""

    kind: Name
    root: str | None
    watch: str
    limit: Count | None = None
    whitelist: str | None = None
    max_bad_share: Share = 0.05
    options: dict[str, Any] = Field(default_factory=dict)


SECTION = Annotated[dict[Name, DatasetSection], Field(min_length=1)]
