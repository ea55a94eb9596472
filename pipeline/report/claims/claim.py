"""A claim of the paper, our measurement of it, and the verdict that the measurement's intervals allow.

A verdict counts cells of a table: a cell supports a claim where its whole 95 % interval lies on the claimed side, and
opposes it where it lies on the other side. Two cells of the same frames are compared by the interval of their paired
difference (`pipeline.report.claims.paired_blur`, `.paired_precision`); where nothing is kept to compute that of, by
whether their intervals overlap, which decides less (`OVERLAP`). Cells share frames, so that their number is not that of
independent tests.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import pandas as pd

from pipeline.report import detection_results
from pipeline.report.claims import paired_blur, paired_precision
from pipeline.report.claims.paired_precision import Sweep
from pipeline.report.detection_results import Results
from pipeline.report.display_names import counted, listing, word
from pipeline.report.inputs import ReportInputs, published_table
from pipeline.report.ledger import sources as ledger_sources
from pipeline.report.tables import where

SUPPORTED, PARTLY, UNDECIDED, CONTRADICTED = "supported", "partly", "not decided", "contradicted"
NOT_MEASURED = "not measured"
CONSISTENT = "consistent"  # the paper's numbers with each other: no measurement of ours
VERDICTS = (SUPPORTED, PARTLY, UNDECIDED, CONTRADICTED, CONSISTENT, NOT_MEASURED)
NEARLY_ALL, HALF = 0.9, 0.5
OVERLAP = "Intervals that do not overlap decide."
"""Rule of claims that compare cells of which no estimates of single frames are kept, for paired differences."""

ENDS = ("low_percent", "high_percent")
PAPER_BLUR = ("cnn", "pmp", "gbb")
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

    ``measure`` gives our measurement, None where what it needs has not run; ``stage`` would produce it, or ``command``
    where no stage does; the reservation is why it might not decide the claim. ``tasks``: of the paper's networks that
    it is about (`pipeline.report.training_budget.names`).
    """

    source: str
    sentence: str
    measure: Measure
    reservation: str = ""
    stage: str = ""
    command: str = ""
    tasks: tuple[str, ...] = ()


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
    def blur(self) -> dict[paired_blur.Key, paired_blur.Cell]:
        """Estimates of the paper's estimators behind Table I, and on sharp frames, for paired differences."""
        estimates = ledger_sources.blur_estimates(self.inputs)
        return {} if estimates is None else paired_blur.cells(where(estimates, estimator=list(PAPER_BLUR)))

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
        """Every detector on every dataset, recorded sweeps among them."""
        recorded = [record.results for record in detection_results.recorded(self.inputs)]
        return [*detection_results.read(self.inputs), *recorded]

    @cached_property
    def sweeps(self) -> list[Sweep]:
        """Average precision of every detector and class under each kind of blur, with its resampled values."""
        return paired_precision.sweeps(self.detection)

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


def lower(first: pd.DataFrame, second: pd.DataFrame, ends: Sequence[str] = ENDS) -> pd.DataFrame:
    """Rows of a first table that the second has, too (by their index), for the claim that the first number is lower.

    A row ``supports`` it where its whole interval (columns ``ends``) lies below that of the second, and ``opposes`` it
    where it lies above: the rule `OVERLAP`, for tables without estimates of single frames.
    """
    low, high = ends
    both = first.join(second[[low, high]], how="inner", rsuffix="_of_second")
    return both.assign(supports=both[high] < both[f"{low}_of_second"], opposes=both[low] > both[f"{high}_of_second"])


def of_cells(cells: pd.DataFrame, what: str, on: Iterable[Any], text: str = "") -> Measurement | None:
    """The measurement of a claim about many cells, of which each ``supports`` or ``opposes`` it; None without cells.

    ``what`` is a cell in words, singular, ``on`` are datasets; ``text`` has more numbers, after the counts.
    """
    if cells.empty:
        return None
    supporting, opposing = (int(cells[side].sum()) for side in ("supports", "opposes"))
    words = f"{supporting} for, {opposing} against, of {counted(len(cells), what)}"
    verdict = verdict_of_counts(supporting, opposing, len(cells))
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
