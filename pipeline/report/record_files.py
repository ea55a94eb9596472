"""How the tables of a record of measurements on other people's pictures are written."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pipeline import store

if TYPE_CHECKING:
    import pandas as pd


def write_csv(path: Path, table: pd.DataFrame) -> None:
    """A table as CSV with six digits: enough to compare, and the same on every machine but for rounding."""
    store.write_text(path, table.to_csv(index=False, float_format="%.6g", lineterminator="\n"))
