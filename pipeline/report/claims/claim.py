"""A claim of the paper, our measurement of it, and the verdict that the measurement's intervals allow.

A verdict counts cells of a table: a cell supports a claim where its whole 95 % interval lies on the claimed side, and
opposes it where it lies on the other side. Cells share frames, so that their number is no number of independent tests.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import pandas as pd

from pipeline.report import detection_results, ledger_sources
from pipeline.report.detection_results import Results
from pipeline.report.display_names import counted, listing, word
from pipeline.report.inputs import ReportInputs, published_table
from pipeline.report.tables import where

SUPPORTED, PARTLY, UNDECIDED, CONTRADICTED = "supported", "partly", "not decided", "contradicted"
NOT_MEASURED = "not measured"
VERDICTS = (SUPPORTED, PARTLY, UNDECIDED, CONTRADICTED, NOT_MEASURED)
NEARLY_ALL, HALF = 0.9, 0.5
SAME_EXPERIMENT = {"linear_motion_dcsn": "linear_dcsn"}
"""Name of an experiment of improved estimation -> that of blur and noise at once, whose blur and noise are the same."""


@dataclass(frozen=True)
class Measurement:
    """What we measured of a claim: in words, and the number that decides with its 95 % interval, where there is one.

    ``verdict`` is one of `VERDICTS`, ``on`` names the datasets in words.
    """

    text: str
    verdict: str
    value: float = math.nan
    low: float = math.nan
    high: float = math.nan
    on: str = ""


Measures = dict[str, Callable[..., Measurement | None]]
"""Name in ``claims.yaml`` -> function of the evidence and options."""


def measures(*functions: Callable[..., Measurement | None]) -> Measures:
    """Functions by the names that ``claims.yaml`` has for them, which are their own without the underscore."""
    return {function.__name__.removeprefix("_"): function for function in functions}


Measure = Callable[["Evidence"], Measurement | None]


@dataclass(frozen=True)
class Claim:
    """A sentence of the paper in our words, and the section, table or figure it is from.

    ``measure`` gives our measurement, None where what it needs has not run; ``stage`` would produce it; the reservation
    is why it might not decide the claim.
    """

    source: str
    sentence: str
    measure: Measure
    reservation: str = ""
    stage: str = ""


class Evidence:
    """The result tables that claims are evaluated on, each read once."""

    def __init__(self, inputs: ReportInputs) -> None:
        self.inputs = inputs

    @cached_property
    def amae(self) -> pd.DataFrame:
        """Raw AMAE of Table I (`pipeline.experiments.tables.BLUR_SUMMARY`), ``measured_on``; ``paper``: the paper's."""
        ours = ledger_sources.blur_amae(self.inputs)
        keys = ["dataset", "estimator", "blur_kind", "kernel_size_px"]
        paper = published_table(self.inputs.paper / "blur_amae.csv").rename(columns={"amae_percent": "paper"})
        paper = paper.astype({"kernel_size_px": float})
        if ours is None:
            return paper.iloc[:0].assign(amae_percent=0.0, low_percent=0.0, high_percent=0.0, measured_on="")
        return ours.merge(paper, how="left", on=keys)

    @cached_property
    def sharp(self) -> pd.DataFrame:
        """Horizontal MTF of sharp frames: medians with their interval."""
        table = ledger_sources.uncorrupted(self.inputs)
        return pd.DataFrame() if table is None else table[table["statistic"] == "median"]

    @cached_property
    def combined(self) -> pd.DataFrame:
        """Raw blur cells under noise (`pipeline.experiments.tables.BLUR_CELLS`), improved estimation among them."""
        ran, smoothed = map(self.inputs.result_with_records, ("combined_blur", "denoised_blur"))
        smoothed = smoothed.assign(experiment=smoothed["experiment"].replace(SAME_EXPERIMENT))
        cells = where(pd.concat([ran, smoothed], ignore_index=True), calibrated=False)
        return cells.drop_duplicates(
            ["dataset", "estimator", "experiment", "kernel_size_px", "target_sigma_dn", "filter_px"]
        )

    @cached_property
    def detection(self) -> list[Results]:
        """Every detector on every dataset."""
        return detection_results.read(self.inputs)

    @cached_property
    def run_times(self) -> dict[str, float]:
        """Published name of an estimator -> seconds of the processor, in the paper's unit; empty without a record."""
        times = ledger_sources.run_times(self.inputs)
        return {} if times is None else dict(zip(times["estimator"], times["seconds"], strict=True))


def names_of(datasets: Iterable[Any]) -> str:
    """Datasets in words, without repeats."""
    names = [word(str(name)) for name in dict.fromkeys(datasets)]
    return listing(names) if names else ""


def verdict_of_counts(supporting: int, opposing: int, total: int) -> str:
    """Verdict of a claim about many cells, by how many lie with their whole interval on the claimed or the other side.

    Supported or contradicted where nine cells of ten are; contradicted too where half are and none supports; not
    decided where fewer than half are either, else partly.
    """
    if supporting >= NEARLY_ALL * total:
        return SUPPORTED
    if opposing >= (NEARLY_ALL if supporting else HALF) * total > 0:
        return CONTRADICTED
    return UNDECIDED if supporting + opposing < HALF * total else PARTLY


def sides(first: Any, second: Any, ends: tuple[str, str] = ("low_percent", "high_percent")) -> tuple[bool, bool]:
    """Whether the interval of a first row lies wholly below that of a second one, and whether wholly above."""
    low, high = ends
    return bool(first[high] < second[low]), bool(first[low] > second[high])


def of_cells(cells: Iterable[tuple[bool, bool]], what: str, on: Iterable[Any], text: str = "") -> Measurement | None:
    """The measurement of a claim about many cells; None without cells.

    Args:
        cells: of each, whether it supports and whether it opposes the claim.
        what: a cell in words, singular.
        on: datasets.
        text: more numbers, after the counts.
    """
    pairs = list(cells)
    if not pairs:
        return None
    supporting, opposing = (sum(bool(pair[number]) for pair in pairs) for number in (0, 1))
    words = f"{supporting} for, {opposing} against, of {counted(len(pairs), what)}"
    verdict = verdict_of_counts(supporting, opposing, len(pairs))
    return Measurement(f"{words}. {text}".strip(), verdict, on=names_of(on))


def of_number(
    value: float, low: float, high: float, threshold: float, text: str, on: Iterable[Any], *, above: bool = True
) -> Measurement:
    """The measurement of a claim that a number is above (or below) a threshold: decided where its interval is.

    A number without an interval is both its ends.
    """
    sides = (low > threshold, high < threshold) if above else (high < threshold, low > threshold)
    verdict = SUPPORTED if sides[0] else CONTRADICTED if sides[1] else UNDECIDED
    return Measurement(text, verdict, value, low, high, names_of(on))
