"""The profile: how large a run is."""

from __future__ import annotations

from typing import Literal

SECTION = Literal["smoke", "default", "paper"]
