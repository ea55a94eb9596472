"""Blur estimation: MTF of uncorrupted datasets, Table I, and the gallery of kernel estimates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from pipeline.camera.mtf import DIRECTIONS, FREQUENCIES, SYSTEM
from pipeline.experiments.sharp_curves import NOMINAL_FREQUENCIES, sharp_curves, sharp_errors
from pipeline.report import blur_records, style
from pipeline.report.display_names import ESTIMATORS, in_order, listing, word
from pipeline.report.figures import PAPER, Facet, abstentions, beside_the_paper, lines, small_multiples
from pipeline.report.inputs import (
    ReportInputs,
    blur_estimates,
    blur_summary,
    described,
    mode_note,
    published,
    relative_mtf,
)
from pipeline.report.ledger import LedgerRow
from pipeline.report.ledger_sources import lenses, star_curve
from pipeline.report.sections import blur_amae, kernel_gallery
from pipeline.report.sections.blur_amae import ANY_STAGE, PAGE, STAGE
from pipeline.report.spec import Block, NotRun, Run, Section, missing, overview, single
from pipeline.report.style import Drawing
from pipeline.report.tables import Table, records

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

TITLE = "Blur estimation"
STAR: style.Look = {"color": style.INK, "linewidth": 1.0}


@style.styled
def uncorrupted(
    curves: pd.DataFrame,
    datasets: Sequence[str],
    paper: pd.DataFrame | None = None,
    stars: Mapping[str, tuple[np.ndarray, np.ndarray]] | None = None,
) -> Drawing:
    """The paper's figure of uncorrupted datasets: median and range of the inliers over the eight frequencies.

    Args:
        curves: `pipeline.experiments.sharp_curves.sharp_curves`.
        datasets: rows of the figure; one without numbers is shown as not run.
        paper: columns dataset, estimator, statistic, frequency, mtf: the paper's, horizontal.
        stars: dataset -> (K,) frequency as fraction of Nyquist and (K,) MTF, where a dataset's own is known.
    """
    import pandas as pd

    stars = stars or {}
    theirs = pd.DataFrame({"dataset": [], "estimator": [], "at": [], "mtf": []}) if paper is None else paper
    theirs = theirs[theirs["dataset"].isin(list(datasets))]
    has_paper = len(theirs) > 0
    if has_paper:
        theirs = theirs[(theirs["statistic"] == "median") & (theirs["estimator"] != "ground_truth")]
        theirs = theirs.assign(at=[FREQUENCIES[NOMINAL_FREQUENCIES.index(value)] for value in theirs["frequency"]])
    estimators = in_order(curves["estimator"], ESTIMATORS)
    looks = style.series_looks(in_order([*estimators, *theirs["estimator"]], ESTIMATORS), linestyle="-")

    def panel(axes: Axes, rows: pd.DataFrame, key: str) -> None:
        dataset, axis = key.rsplit(" ", 1)
        if dataset in stars:
            frequency, mtf = (np.asarray(values, dtype=float) for values in stars[dataset])
            inside = frequency <= 0.62
            axes.plot(frequency[inside], mtf[inside], zorder=4, **STAR)
        if axis == "H":
            beside = theirs[theirs["dataset"] == dataset]
            lines(axes, beside, "estimator", looks, "at", "mtf", change=PAPER, zorder=2, part="paper", key=key)
        lines(axes, rows, "estimator", looks, "at", "median", band=("min", "max"), part="median", key=key)
        first = rows[rows["frequency_index"] == 0].set_index("estimator")[["abstained", "count"]]
        counts = {name: (int(first["abstained"][name]), int(first.loc[name].sum())) for name in first.index}
        abstentions(axes, {name: counts[name] for name in estimators if name in counts}, key, at_top=False)

    legend = beside_the_paper(looks, estimators, has_paper)
    if any(name in stars for name in datasets):
        legend.append(("Siemens star", STAR))
    return small_multiples(
        curves.assign(at=FREQUENCIES[curves["frequency_index"].to_numpy(int)]),
        Facet("dataset", datasets), Facet("axis", "HV", lambda axis: DIRECTIONS["HV".index(axis)].capitalize()), panel,
        x="spatial frequency [fraction of Nyquist]", y="MTF", alt=_uncorrupted_alt(curves, estimators, stars),
        axes={"xlim": (0, 0.62), "ylim": (0, 1.03), "xticks": np.arange(0, 0.61, 0.1),
              "yticks": np.arange(0, 1.01, 0.25)},
        legend=legend, values=curves.drop(columns="frequency_index").sort_values(["dataset", "estimator", "axis",
            "frequency"]),
        series=style.switches(looks), panel_in=1.62, margin_in=0.62,
    )  # fmt: skip


def _uncorrupted_alt(
    curves: pd.DataFrame, estimators: Sequence[str], stars: Mapping[str, tuple[np.ndarray, np.ndarray]]
) -> str:
    if curves.empty:
        return "MTF of uncorrupted frames: not run."
    last = curves[(curves["frequency_index"] == curves["frequency_index"].max()) & (curves["axis"] == "H")]
    ends = {name: [f"{value:.2f}" for value in group.agg(["min", "max"])] for name, group in
            last.groupby("estimator")["median"]}  # fmt: skip
    counts = last["estimator"].value_counts()
    words = [f"{word(name)} {' to '.join(ends[name][: 2 if counts[name] > 1 else 1])}" for name in estimators]
    star = [
        f" The Siemens star of {word(dataset)} has {np.interp(FREQUENCIES[-1], frequency, mtf):.2f} there."
        for dataset, (frequency, mtf) in stars.items()
    ]
    return (
        f"MTF estimated on sharp frames of {listing(word(name) for name in curves['dataset'].unique())} over the "
        f"paper's eight frequencies. At the highest, {FREQUENCIES[-1]:.2f} of Nyquist, the horizontal medians are "
        f"{listing(words)}.{''.join(star)}"
    )


def _stages(rows: pd.DataFrame) -> tuple[str, ...]:
    ran = {(str(row["dataset"]), str(row["estimator"])) for row in records(rows[["dataset", "estimator"]])}
    return tuple(STAGE.format(dataset=dataset, estimator=estimator) for dataset, estimator in sorted(ran))


def _uncorrupted(estimates: pd.DataFrame, datasets: list[str], inputs: ReportInputs) -> Block:
    curves = sharp_curves(estimates, draws=0)
    if curves.empty:
        return NotRun("MTF of uncorrupted frames", "stage absent", inputs.line(ANY_STAGE))
    star = star_curve(inputs)
    stars = {"sim": (star["frequency"], star["measured"])} if star is not None and "sim" in datasets else {}
    after = " ".join(filter(None, [PAGE.text("star") if stars else "", mode_note(inputs.modes, curves["estimator"])]))
    drawing = uncorrupted(curves, datasets, published(inputs, "uncorrupted_mtf.csv"), stars)
    return PAGE.figure("uncorrupted_mtf", drawing, _stages(curves) + (("star",) if stars else ()), after=after)


def _table_one(summary: pd.DataFrame, datasets: list[str], inputs: ReportInputs) -> list[Block]:
    paper, relative = published(inputs, "blur_amae.csv"), relative_mtf(summary)
    blocks: list[Block] = blur_amae.figures(summary, datasets, paper, _stages, relative, modes=inputs.modes)
    if not blocks:
        return [NotRun("Table I: AMAE of blur estimators", "stage absent", inputs.line(ANY_STAGE))]
    settings = relative, inputs.modes
    for dataset in datasets:
        for is_calibrated in (False, True):
            if ((summary["dataset"] == dataset) & (summary["calibrated"] == is_calibrated)).any():
                blocks.append(blur_amae.table_one(dataset, summary, paper, is_calibrated, *settings))
    extra = (blur_amae.beside_the_best(summary, paper), unseen(inputs))
    return [*blocks, *(one for one in extra if one is not None)]


def unseen(inputs: ReportInputs) -> Table | None:
    """The table of kernels of a kind that no network was trained on, or None without a record.

    Args:
        inputs: of the report.

    Raises:
        InputError: the record holds something else.
    """
    if inputs.unseen is None:
        return None
    remedy = "make it again: python benchmarks/unseen_kernels.py"
    content = described(inputs.unseen.parent, inputs.unseen.name, ("kernels", "results"), remedy)
    return None if content is None else blur_amae.unseen_kernels(content)


def _runs(summary: pd.DataFrame, inputs: ReportInputs) -> list[Run]:
    ran = {(str(row["dataset"]), str(row["estimator"])) for row in records(summary[["dataset", "estimator"]])}
    planned = {
        member.removeprefix(f"{dataset}-")
        for dataset in inputs.datasets
        for member in inputs.blur_members or ()
        if member.startswith(f"{dataset}-")
    }
    recorded = blur_records.estimators(inputs)
    return [
        run
        for estimator in in_order({*planned, *(name for _, name in ran)}, ESTIMATORS)
        for run in overview(
            f"Blur by {word(estimator)}", f"blur@{{dataset}}-{estimator}",
            [dataset for dataset, name in ran if name == estimator], inputs,
            recorded=[dataset for dataset, names in recorded.items() if estimator in names],
        )
    ]  # fmt: skip


def section(inputs: ReportInputs, ledger: Sequence[LedgerRow] = ()) -> Section:
    """Blur estimation on every dataset."""
    summary, introduction = blur_summary(inputs), PAGE.text("introduction")
    if summary.empty:
        run = single(TITLE, ANY_STAGE, False, inputs)
        return Section("blur", TITLE, (introduction,), [NotRun(PAGE.text("parts"), run.why, run.line)], [run])
    estimates = blur_estimates(inputs)
    datasets = in_order(summary["dataset"], inputs.datasets)
    runs = _runs(summary, inputs)
    # A relative MTF of sharp frames is no curve of theirs.
    absolute = estimates[estimates["relative_to"] == SYSTEM]
    blocks: list[Block] = [_uncorrupted(absolute, datasets, inputs)]
    errors = sharp_errors(absolute, lenses(inputs), inputs.seed)
    blocks += _table_one(blur_amae.without_unknown_lenses(summary, errors), datasets, inputs)
    blocks += [blur_amae.abstentions(summary, estimates), *kernel_gallery.blocks(estimates, datasets, inputs)]
    return Section("blur", TITLE, (introduction,), [*blocks, *missing(TITLE, runs)], runs)
