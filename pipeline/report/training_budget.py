"""How much of the paper's training the released weights of its two networks have had, wherever their name stands.

    percent = 100 * (steps up to the released weights * samples of a step) / samples that the paper's training saw

Weights are released from the step with the lowest error on held-out samples, which is before the training's end. The
paper's samples are those of its whole training; which of its weights it evaluated is not known. Its blur network saw 51
epochs of 160,500 samples less 15 % held out (log of its training). Of its noise network a lower bound is known: 99
epochs of at least one patch of each of the 4,744 pictures of the Waterloo Exploration Database (Ma et al. 2017), so
that its percentage is an upper bound.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager

from pipeline.learning.learning_curve import LearningCurve, read
from pipeline.report.display_names import ESTIMATORS, qualified
from pipeline.report.inputs import ReportInputs
from pipeline.report.tables import format_number

PAPER_SAMPLES = {"mtf_cnn": 51 * 136_425, "sigma_cnn": 99 * 4_744}
TASKS = {"mtf_cnn": "blur", "sigma_cnn": "noise"}
NETWORK = "cnn"
"""Registry name of the paper's networks, of blur and of noise."""


def percents(inputs: ReportInputs) -> dict[str, float]:
    """Network -> percent of the paper's samples that its released weights saw; without those of no record."""
    each = {curve.name: percent_of(curve) for curve in read(inputs.weights)}
    return {name: percent for name, percent in each.items() if percent is not None}


def percent_of(curve: LearningCurve) -> float | None:
    """Percent of the paper's samples that released weights saw; None for other networks, and without a record."""
    samples = released_samples(curve)
    if curve.name not in PAPER_SAMPLES or samples is None:
        return None
    return 100 * samples / PAPER_SAMPLES[curve.name]


def released_samples(curve: LearningCurve) -> int | None:
    """Samples that the released weights saw, one shown twice counted twice; None without a record.

    Where the released step is not known it is the last.
    """
    return None if curve.samples is None else (curve.chosen or curve.steps) * curve.samples


def in_words(percent: float) -> str:
    """``"at most 0.7 % of the paper's samples"``, see `rounded_up`; from 100 % on that there are no fewer."""
    if percent >= 100:
        return "as many as the paper’s, as far as is known"
    return f"at most {rounded_up(percent)} % of the paper’s samples"


def rounded_up(percent: float) -> str:
    """A percentage rounded up, to one significant digit below 10 %, else to 1 %."""
    step = 10.0 ** math.floor(math.log10(percent)) if 0 < percent < 10 else 1.0
    return format_number(round(step * math.ceil(round(percent / step, 6)), 10))


def names(inputs: ReportInputs, *tasks: str) -> dict[str, str]:
    """The one name of the paper's two networks with their shares of the paper's training.

    ``"NAME (blur: at most 45 %; noise: at most 86 % of the paper's samples)"``, with a semicolon between both: a comma
    separates the parts of the ledger's quantities; of a single task ``"NAME (at most 45 % of the paper's samples)"``.
    Empty without a record of them; a network that saw no fewer samples than the paper's needs no words.

    Args:
        inputs: with the released networks.
        tasks: that the name stands for, values of `TASKS`; both if none is given.
    """
    partial = {TASKS[name]: percent for name, percent in percents(inputs).items() if percent < 100}
    chosen = {task: percent for task, percent in partial.items() if task in (tasks or TASKS.values())}
    if not chosen:
        return {}
    parts = [f"{'' if len(tasks) == 1 else f'{task}: '}at most {rounded_up(chosen[task])} %" for task in chosen]
    return {NETWORK: f"{ESTIMATORS[NETWORK]} ({'; '.join(parts)} of the paper’s samples)"}


@contextmanager
def named(inputs: ReportInputs, *tasks: str) -> Iterator[None]:
    """While something of these tasks is made, `names` stand for the paper's networks."""
    with qualified(names(inputs, *tasks)):
        yield
