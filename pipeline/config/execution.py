"""How large a run is, where it writes, and where its parallel work runs."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from pipeline.settings import Settings

Profile = Literal["smoke", "default", "paper"]
"""How large a run is."""
Root = Annotated[str, Field(pattern=r"^(runs/\w[\w.-]*/)?$")]
"""The folder of everything a run writes: the project itself, "", for the profile ``default``, ``runs/NAME/`` for
others. No other spelling, so that none can lead back to the project's own weights and report."""


class ExecutorSettings(Settings):
    """Where work runs.

    Attributes:
        backend: of parallel work.
        workers: processes; 0 means one per core. Changes no result.
        address: of the Dask scheduler; None without one.
        device: that networks are trained on, ``cpu`` or a GPU, ``cuda`` or ``cuda:1``; weights that a GPU has trained
            differ in their last digits.
    """

    backend: Literal["processes", "dask"]
    workers: Annotated[int, Field(ge=0, le=1024, strict=True)]
    address: str | None
    device: Annotated[str, Field(pattern=r"^(cpu|cuda(:\d+)?)$")] = "cpu"
