"""Blur estimation, by stages and on recorded pictures: MTF of uncorrupted datasets, Table I, kernel estimates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from pipeline.camera.mtf import FREQUENCIES, SYSTEM
from pipeline.experiments.recorded import blur as blur_records
from pipeline.experiments.recorded.blur import BlurRecord
from pipeline.experiments.sharp_curves import sharp_curves, sharp_errors
from pipeline.report import style
from pipeline.report.display_names import ESTIMATORS, counted, in_order, listing, word
from pipeline.report.figures import abstentions, beside_the_paper
from pipeline.report.inputs import ReportInputs, at_frequencies, mode_note, mode_of, published
from pipeline.report.ledger.sources import lenses, star_curve
from pipeline.report.sections import blur_amae, kernel_gallery
from pipeline.report.sections.blur_amae import ANY_STAGE, PAGE
from pipeline.report.spec import Block, Run, Section, as_recorded, pairs_of, runs_by_estimator, single
from pipeline.report.tables import records, where

TITLE = "Blur estimation"
STAR: style.Look = {"color": style.INK, "linewidth": 1.0}


def uncorrupted(
    curves: pd.DataFrame,
    datasets: Sequence[str],
    paper: pd.DataFrame,
    stars: Mapping[str, tuple[np.ndarray, np.ndarray]] | None = None,
) -> style.Drawing:
    """The paper's figure of uncorrupted datasets: median and range of the inliers over the eight frequencies.

    ``curves`` as of `sharp_curves`; ``paper`` holds its published curves, horizontal; ``stars``: dataset -> (K,)
    frequency as fraction of Nyquist and (K,) MTF, where its own is known. A dataset without numbers is shown as not
    run.
    """
    stars, theirs = stars or {}, where(paper, statistic="median", dataset=list(datasets))
    theirs = at_frequencies(theirs[theirs["estimator"] != "ground_truth"])
    estimators = in_order(curves["estimator"], ESTIMATORS)
    looks = style.series_looks(in_order([*estimators, *theirs["estimator"]], ESTIMATORS), linestyle="-")

    def star(axes: Axes, rows: pd.DataFrame, key: str) -> None:
        dataset = key.rsplit(" ", 1)[0]
        if dataset in stars:
            frequency, mtf = (np.asarray(values, dtype=float) for values in stars[dataset])
            inside = frequency <= 0.62
            axes.plot(frequency[inside], mtf[inside], zorder=4, **STAR)

    def counts(axes: Axes, rows: pd.DataFrame, key: str) -> None:
        abstentions(axes, where(rows, frequency_index=0), key, estimators, at_top=False)

    is_starred = any(name in stars for name in datasets)
    return PAGE.grid(
        "uncorrupted_mtf", curves.assign(at=FREQUENCIES[curves["frequency_index"].to_numpy(int)]),
        _uncorrupted_alt(curves, estimators, stars), looks,
        down=datasets, across="HV", under=star, beside=theirs.assign(axis="H"), over=counts,
        values=curves.drop(columns="frequency_index"),
        legend=[*beside_the_paper(looks, estimators, len(theirs) > 0), *([("Siemens star", STAR)] * is_starred)],
    )  # fmt: skip


def _uncorrupted_alt(
    curves: pd.DataFrame, estimators: Sequence[str], stars: Mapping[str, tuple[np.ndarray, np.ndarray]]
) -> str:
    last = where(curves, frequency_index=curves["frequency_index"].max(), axis="H")
    medians = last.groupby("estimator")["median"].agg(["min", "max", "size"]).loc[list(estimators)].reset_index()
    ends = [f"{row['min']:.2f}" + (f" to {row['max']:.2f}" if row["size"] > 1 else "") for row in records(medians)]
    at_last = {dataset: np.interp(FREQUENCIES[-1], *star) for dataset, star in stars.items()}
    after = "".join(f" {PAGE.text('star_alt', dataset=dataset, mtf=mtf)}" for dataset, mtf in at_last.items())
    words = {"datasets": listing(map(word, curves["dataset"].unique())), "highest": FREQUENCIES[-1], "after": after}
    return PAGE.alt("uncorrupted_mtf", medians.assign(ends=ends), **words)


def _uncorrupted(estimates: pd.DataFrame, datasets: list[str], inputs: ReportInputs) -> Block | None:
    curves = sharp_curves(estimates, draws=0)
    if curves.empty:
        return None
    star = star_curve(inputs)
    stars = {"sim": (star["frequency"], star["measured"])} if star is not None and "sim" in datasets else {}
    after = " ".join(filter(None, [PAGE.text("star") if stars else "", mode_note(inputs.modes, curves["estimator"])]))
    drawing = uncorrupted(curves, datasets, published(inputs, "uncorrupted_mtf.csv"), stars)
    return PAGE.figure(
        "uncorrupted_mtf", drawing, [*blur_amae.stages_of(curves), *(["star"] if stars else [])], after=after
    )


def _table_one(summary: pd.DataFrame, datasets: list[str], inputs: ReportInputs) -> list[Block | None]:
    paper = published(inputs, "blur_amae.csv")
    figures = blur_amae.figures(summary, datasets, paper, inputs.modes)
    tables = [table for name in datasets for table in blur_amae.tables_one(name, summary, paper, inputs.modes)]
    return [
        *figures,
        *tables,
        blur_amae.beside_the_best(summary, paper),
        inputs.benchmark(blur_amae.UNSEEN, blur_amae.unseen_kernels),
    ]


def _runs(summary: pd.DataFrame, inputs: ReportInputs) -> list[Run]:
    planned = [name for dataset, name in inputs.pairs("blur") if dataset in inputs.datasets]
    ran, recorded = pairs_of(summary), blur_records.estimators(inputs.recorded)
    listed = {*planned, *(name for _, name in ran)}
    known = [(dataset, name) for dataset, names in recorded.items() for name in names if name in listed]
    return runs_by_estimator("Blur", "blur", ran, inputs, recorded=known, names=planned)


def section(inputs: ReportInputs) -> Section:
    """Blur estimation on every dataset."""
    summary = inputs.noiseless("blur_summary")
    if summary.empty:
        run = single(TITLE, ANY_STAGE, False, inputs)
        return PAGE.section([], [run])
    estimates = inputs.noiseless("blur_estimates")
    datasets, runs = in_order(summary["dataset"], inputs.datasets), _runs(summary, inputs)
    # A relative MTF of sharp frames is no curve of theirs.
    absolute = estimates[estimates["relative_to"] == SYSTEM]
    errors = sharp_errors(absolute, lenses(inputs), inputs.seed)
    blocks = [
        _uncorrupted(absolute, datasets, inputs),
        *_table_one(blur_amae.without_unknown_lenses(summary, errors), datasets, inputs),
        blur_amae.abstentions(summary, estimates),
        *kernel_gallery.blocks(estimates, datasets, inputs),
    ]
    return PAGE.section(blocks, runs)


def subsets(record: BlurRecord) -> list[str]:
    """A note on estimators that were run on fewer patches than the others, slow ones; none without them."""
    whole = record.measured_on("")
    fewer = {name: selected for name in record.estimators if (selected := record.measured_on(name)) != whole}
    words = [
        f"{word(name)} on {counted(patches, 'patch', 'patches')} of {counted(frames, 'frame')}"
        for name, (frames, patches) in fewer.items()
    ]
    return [f"{listing(words)}, the others on {whole[1]} of {whole[0]} frames."] if words else []


def recorded(inputs: ReportInputs) -> Section | None:
    """Blur estimation on pictures recorded by ``camera-monitor blur record``, or None without a record."""
    known = blur_records.read(inputs.recorded)
    if not known:
        return None
    datasets = [one.dataset for one in known]
    settings = {name: selected for one in known for name, selected in one.provenance["blur"]["estimators"].items()}
    modes = {name: mode for name, selected in settings.items() if (mode := mode_of(selected))}
    names = {one.dataset: "; ".join(map(word, in_order(one.estimators, ESTIMATORS))) for one in known}
    sources = [{**one.described(), "estimators": names[one.dataset]} for one in known]
    blocks: list[Block | None] = [PAGE.table("recorded_blur_sources", sources)]
    exact = {(one.dataset, paper): name for one in known for paper, name in one.exact.items()}

    def beside_exact(paper: pd.DataFrame) -> pd.DataFrame:
        """The paper's numbers beside our exact programs, on datasets where these were run."""
        pairs = zip(paper["dataset"], paper["estimator"], strict=True)
        return paper.assign(estimator=[exact.get(pair, pair[1]) for pair in pairs])

    curves = [one.sharp for one in known if len(one.sharp)]
    if curves:
        paper = beside_exact(published(inputs, "uncorrupted_mtf.csv"))
        drawing = uncorrupted(pd.concat(curves, ignore_index=True), datasets, paper)
        blocks.append(PAGE.figure("recorded_uncorrupted_mtf", drawing, after=mode_note(modes, settings)))
    summary = pd.concat([one.summary for one in known], ignore_index=True)
    theirs = published(inputs, "blur_amae.csv")
    paper = beside_exact(theirs)
    blocks += map(as_recorded, blur_amae.figures(summary, datasets, paper, modes))
    for one in known:
        blurred, few = blur_amae.without_unknown_lenses(one.summary), len(one.provenance["frames"])
        notes = [*subsets(one), PAGE.text("few_frames", frames=few)]
        blocks += [as_recorded(table, *notes) for table in blur_amae.tables_one(one.dataset, blurred, paper, modes)]
    selected = summary[~summary["estimator"].isin(set(exact.values()))]
    counts = listing(f"{len(one.provenance['frames'])} of {word(one.dataset)}" for one in known)
    beside = blur_amae.beside_the_best(selected, theirs, "")
    blocks.append(beside and as_recorded(beside, PAGE.text("few_frames", frames=counts)))
    return PAGE.section(blocks, key="blur_recorded")
