"""Numbers as output shows them: in JSON and in text."""

from __future__ import annotations

import math


def json_number(value: float) -> float | None:
    """A number as JSON shows it: four digits; null where it is not finite, since JSON has no NaN."""
    return float(f"{value:.4g}") if math.isfinite(value) else None


def text_number(value: float, decimals: int) -> str:
    """A number as text shows it; ``-`` where it is unknown; ``> 0.59`` beyond the last frequency measured."""
    from pipeline.camera.mtf import FREQUENCIES

    if math.isnan(value):
        return "-"
    return f"> {FREQUENCIES[-1]:.2f}" if math.isinf(value) else f"{value:.{decimals}f}"
