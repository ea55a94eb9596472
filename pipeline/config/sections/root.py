"""The folder of everything a run writes: the project for the profile ``default``, ``runs/PROFILE/`` for others."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

SECTION = Annotated[str, Field(pattern=r"^([\w.-]+/)*$")]
