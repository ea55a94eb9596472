"""How large a run is, where it writes, and where its parallel work runs."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from pipeline.settings import Settings

Profile = Literal["smoke", "default", "paper"]
"""How large a run is."""
Root = Annotated[str, Field(pattern=r"^([\w.-]+/)*$")]
"""The folder of everything a run writes: the project for the profile ``default``, ``runs/PROFILE/`` for others."""


class ExecutorSettings(Settings):
    """Where parallel work runs; changes no result. ``workers: 0`` means one per core."""

    backend: Literal["processes", "dask"]
    workers: Annotated[int, Field(ge=0, le=1024)]
    address: str | None
