"""Flags of a frame in words, and the noise of a flagged frame that its noise estimate leaves out."""

from __future__ import annotations

from collections.abc import Mapping
from math import nan
from typing import Any

BANDED, DEAD_LINES, IMPULSES = "banded", "dead_lines", "impulses"


def flag_names(row: Mapping[str, Any]) -> list[str]:
    """Names of the flags of a frame.

    Args:
        row: of `pipeline.cli.analysis.rows.condition_row`.
    """
    return [name for name in row.get("flags", "").split(", ") if name]


def flag_words(row: Mapping[str, Any]) -> list[str]:
    """Flags of a frame in words.

    Args:
        row: of `pipeline.cli.analysis.rows.condition_row`.

    Returns:
        a phrase for each (`words_of_flag`).
    """
    return [words_of_flag(name, row) for name in flag_names(row)]


def left_out_words(row: Mapping[str, Any]) -> list[str]:
    """Noise of a frame that its noise estimate leaves out, in words: of rows or columns, and of single pixels.

    Single dead lines are a fault of the frame, but no noise of it: they hardly touch what a detector sees.

    Args:
        row: of `pipeline.cli.analysis.rows.condition_row`.

    Returns:
        a phrase for each flag that names such noise (`words_of_flag`).
    """
    return [words_of_flag(name, row) for name in flag_names(row) if name in (BANDED, IMPULSES)]


def line_noise_dn(row: Mapping[str, Any]) -> float:
    """Noise of whole rows or columns, the greater of both, DN; NaN where the frame is not flagged for it.

    Args:
        row: of `pipeline.cli.analysis.rows.condition_row`.
    """
    if BANDED not in flag_names(row):
        return nan
    lines = (row["row_noise_dn"], row["column_noise_dn"])
    return float(max(value for value in lines if value == value))  # NaN where it cannot be measured


def words_of_flag(name: str, row: Mapping[str, Any]) -> str:
    """One flag of a frame in words; of noise that the estimate leaves out with its measure.

    Args:
        name: of the flag.
        row: of `pipeline.cli.analysis.rows.condition_row`, with that flag.
    """
    if name == BANDED:
        lines = "rows" if row["row_noise_dn"] == line_noise_dn(row) else "columns"
        return f"banded: {lines} differ by {line_noise_dn(row):.1f} DN, which the noise estimate leaves out"
    if name == DEAD_LINES:
        count = row["dead_lines"]
        lines = "1 row or column stands" if count == 1 else f"{count} rows or columns stand"
        return f"dead lines: {lines} out, which the noise estimate leaves out"
    if name == IMPULSES:
        percent = 100 * row["impulse_fraction"]
        return f"impulses: {percent:.2g} % of the pixels, which the noise estimate leaves out"
    return name.replace("_", "-")
