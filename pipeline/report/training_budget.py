"""How much of the paper's training its two networks have had here, for every place where their name stands.

    percent = 100 * (steps * samples of a step) / samples that the paper's training saw

The blur network saw 51 epochs of 160,500 samples less 15 % held out (log of its training). Of the noise network a lower
bound is known: 99 epochs of at least one patch of each of the 4,744 pictures of the Waterloo Exploration Database
(Ma et al. 2017), so that its percentage is an upper bound.
"""

from __future__ import annotations

import math

from pipeline.learning.learning_curve import LearningCurve, read
from pipeline.report.display_names import ESTIMATORS
from pipeline.report.inputs import ReportInputs
from pipeline.report.tables import format_number

PAPER_SAMPLES = {"mtf_cnn": 51 * 136_425, "sigma_cnn": 99 * 4_744}
TASKS = {"mtf_cnn": "blur", "sigma_cnn": "noise"}
NETWORK = "cnn"
"""Registry name of the paper's networks, of blur and of noise."""


def percents(inputs: ReportInputs) -> dict[str, float]:
    """Network -> percent of the paper's samples that its training here saw; without those of no record."""
    each = {curve.name: percent_of(curve) for curve in read(inputs.weights)}
    return {name: percent for name, percent in each.items() if percent is not None}


def percent_of(curve: LearningCurve) -> float | None:
    """Percent of the paper's samples that a training saw; None for other networks, and without a record."""
    if curve.name not in PAPER_SAMPLES or curve.samples is None:
        return None
    return 100 * curve.steps * curve.samples / PAPER_SAMPLES[curve.name]


def in_words(percent: float) -> str:
    """``"at most 0.7 % of the paper's samples"``, see `rounded_up`; from 100 % on that there are no fewer."""
    if percent >= 100:
        return "as many as the paper’s, as far as is known"
    return f"at most {rounded_up(percent)} % of the paper’s samples"


def rounded_up(percent: float) -> str:
    """A percentage rounded up, to one significant digit below 10 %, else to 1 %."""
    step = 10.0 ** math.floor(math.log10(percent)) if 0 < percent < 10 else 1.0
    return format_number(round(step * math.ceil(round(percent / step, 6)), 10))


def names(inputs: ReportInputs) -> dict[str, str]:
    """The one name of the paper's two networks with their shares of the paper's training.

    ``"NAME (blur: at most 48 % of the paper's samples)"``, with a semicolon between both where both had fewer: a comma
    separates the parts of the ledger's quantities. Empty without a record of them; a network trained in full needs no
    words.
    """
    partial = {TASKS[name]: percent for name, percent in percents(inputs).items() if percent < 100}
    if not partial:
        return {}
    words = "; ".join(f"{task}: at most {rounded_up(percent)} %" for task, percent in partial.items())
    return {NETWORK: f"{ESTIMATORS[NETWORK]} ({words} of the paper’s samples)"}
