"""Frames from good to bad: which of a run are shown as its worst, and which count as bad."""

from __future__ import annotations

from math import isfinite
from typing import Any

from pipeline.cli.analysis.rows import is_beyond

BAD_NOISE = ("high", "very high")


def badness(row: dict[str, Any]) -> tuple[float, ...]:
    """Order of frames from good to bad: by alarms, flags, the worse grade, then lost contrast and noise.

    What is unknown counts 0, and so does a grade of blur that is uncertain; noise beyond what is measured is very high.
    """
    import numpy as np

    from pipeline.condition.verdict import BLUR_GRADES, HIGHEST_NOISE, NOISE_GRADES
    from pipeline.noise.abstentions import LARGEST_DN

    blur = ["", *(name for _, name in reversed(BLUR_GRADES))]
    noise = ["", *(name for _, name in NOISE_GRADES[2:]), HIGHEST_NOISE]
    noise_grade = HIGHEST_NOISE if is_beyond(row) else row["noise"]
    grades = (
        blur.index(row["blur"]) if row["blur"] in blur and not row["blur_range"] else 0,
        noise.index(noise_grade) if noise_grade in noise else 0,
    )
    lost, sigma = 1 - float(np.mean(row["mtf"])), (LARGEST_DN if is_beyond(row) else row["sigma_dn"]) / 25
    rest = sum(part for part in (lost, sigma) if isfinite(part))
    return float(bool(row["alarms"])), float(bool(row["flags"])), float(max(grades)), rest


def is_bad(row: dict[str, Any]) -> bool:
    """Whether a frame is at least moderately blurred, and surely so, or highly noisy."""
    from pipeline.condition.verdict import BAD_BLUR

    return (row["blur"] in BAD_BLUR and not row["blur_range"]) or row["noise"] in BAD_NOISE or is_beyond(row)
