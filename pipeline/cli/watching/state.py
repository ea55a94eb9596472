"""The state of a watched source: medians of the last frames, their words, and the share of flagged ones."""

from __future__ import annotations

from collections import Counter, deque
from typing import Any

WINDOW = 30


class RollingState:
    """Summarises the last frames.

    Args:
        window: how many.
    """

    def __init__(self, window: int = WINDOW) -> None:
        self._rows: deque[dict[str, Any]] = deque(maxlen=window)

    def add(self, row: dict[str, Any]) -> dict[str, Any]:
        """Take a frame's row (`pipeline.cli.analysis.frame.FrameAnalysis.analyse`).

        Returns:
            ``frames`` summarised, medians ``sigma_dn``, ``sigma_at_most_dn``, ``white_sigma_dn``,
            ``noise_correlation``, ``mtf50_horizontal``, ``mtf50_vertical`` and ``ap_percent`` (infinite
            MTF50: above the range; NaN: unknown, noise and precision also where a codec hides the noise of most
            frames), ``words``, and ``flags`` with the share of frames.
        """
        from pipeline.cli.analysis.flag_words import flag_names
        from pipeline.cli.analysis.medians import (
            directed_shares,
            known_median,
            median_mtf,
            median_noise,
            median_noise_parts,
            median_precision,
        )
        from pipeline.condition.summary import half_contrast
        from pipeline.condition.verdict import grade

        self._rows.append(row)
        rows = list(self._rows)
        mtf, low, high = (median_mtf(rows, name) for name in ("mtf", "mtf_low", "mtf_high"))
        sigma, _, at_most = median_noise(rows)
        white, correlation = median_noise_parts(rows)
        level = known_median(part["median_dn"] for part in rows)
        horizontal, vertical = (float(value) for value in half_contrast(mtf))
        flags = Counter(name for part in rows for name in flag_names(part))
        return {
            "frames": len(rows), "sigma_dn": sigma, "sigma_at_most_dn": at_most, "mtf50_horizontal": horizontal,
            "mtf50_vertical": vertical, "ap_percent": median_precision(rows),
            "words": "; ".join(grade(sigma, mtf, level, (low, high), directed_shares(rows)).words()),
            "flags": {name: count / len(rows) for name, count in sorted(flags.items())},
            "white_sigma_dn": white, "noise_correlation": correlation,
        }  # fmt: skip
