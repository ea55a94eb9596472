"""How much of the paper's training its two networks have had here, for every place where their name stands.

    percent = 100 * (steps * samples of a step) / samples that the paper's training saw

The blur network saw 51 epochs of 160,500 samples less 15 % held out (log of its training). Of the noise network a lower
bound is known: 99 epochs of at least one patch of each of the 4,744 pictures of the Waterloo Exploration Database
(Ma et al. 2017), so that its percentage is an upper bound.
"""

from __future__ import annotations

import math

from pipeline.learning.learning_curve import read
from pipeline.report.display_names import ESTIMATORS
from pipeline.report.inputs import ReportInputs
from pipeline.report.tables import format_number

PAPER_SAMPLES = {"mtf_cnn": 51 * 136_425, "sigma_cnn": 99 * 4_744}
NETWORK = "cnn"
"""Registry name of the paper's networks, of blur and of noise."""


def percents(inputs: ReportInputs) -> dict[str, float]:
    """Network -> percent of the paper's samples that its training here saw; without those of no record."""
    return {
        one.name: 100 * one.steps * one.samples / PAPER_SAMPLES[one.name]
        for one in read(inputs.weights)
        if one.name in PAPER_SAMPLES and one.samples is not None
    }


def in_words(percent: float) -> str:
    """``"at most 0.7 % of the paper's samples"``: rounded up, to one significant digit below 10 %, else to 1 %."""
    step = 10.0 ** math.floor(math.log10(percent)) if 0 < percent < 10 else 1.0
    rounded = round(step * math.ceil(round(percent / step, 6)), 10)
    return f"at most {format_number(rounded)} % of the paper’s samples"


def names(inputs: ReportInputs) -> dict[str, str]:
    """Display names of the paper's networks with their share of the paper's training; empty without a record of it.

    Both networks have one name, so that the larger share counts; full training needs no words.
    """
    shares = percents(inputs)
    if not shares or max(shares.values()) >= 100:
        return {}
    return {NETWORK: f"{ESTIMATORS[NETWORK]} ({in_words(max(shares.values()))})"}
