"""The seed of every random stream."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

SECTION = Annotated[int, Field(ge=0, lt=2**63)]
