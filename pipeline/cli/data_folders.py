"""Folders of a project that downloads go to and are looked for in."""

from __future__ import annotations

from pathlib import Path

RAW = Path("data/raw")
"""Published pictures, each in a folder of its name."""

DETECTOR_WEIGHTS = RAW / "weights"
