"""Where parallel work runs."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from pipeline.config.schema_base import Section


class ExecutorSection(Section):
    """Where parallel work runs; changes no result. ``workers: 0`` means one per core."""

    backend: Literal["processes", "dask"]
    workers: Annotated[int, Field(ge=0, le=1024)]
    address: str | None


SECTION = ExecutorSection
