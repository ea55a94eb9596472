"""The section of blur estimation: uncorrupted datasets, Table I, its curves, and the kernels found."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.blur.evaluation import SHARP
from pipeline.camera import mtf
from pipeline.errors import InputError
from pipeline.report import blur_tables, kernel_estimates_figure, sharp_curves_figure, unseen_kernels
from pipeline.report.blur_tables import ANY_STAGE, STAGE
from pipeline.report.inputs import (
    ReportInputs,
    blur_estimates,
    blur_summary,
    members,
    optional_arrays,
    optional_json,
    records,
)
from pipeline.report.kernel_estimates_figure import Gallery
from pipeline.report.ledger_sources import sharp_curves, star_curve
from pipeline.report.sections import blur_amae
from pipeline.report.sections.base import Block, NotRun, Run, Section, ShownFigure
from pipeline.report.wording import ESTIMATORS, in_order, word

if TYPE_CHECKING:
    import pandas as pd

TEXT = (
    "Frames are blurred by known kernels, and each estimator reads the modulation transfer function (MTF) from patches "
    "on objects. The average mean absolute error (AMAE) is the distance between the median of its answers and the "
    "kernel's own MTF, averaged over eight frequencies, horizontal and vertical, and over rotations."
)
PARTS = (
    "MTF of uncorrupted frames, Table I (AMAE of blur estimators), AMAE over the size of the blur, gallery of kernels"
)


def _stages(table: pd.DataFrame) -> tuple[str, ...]:
    ran = {(str(row["dataset"]), str(row["estimator"])) for row in records(table[["dataset", "estimator"]])}
    return tuple(STAGE.format(dataset=dataset, estimator=estimator) for dataset, estimator in sorted(ran))


def _sharp(estimates: pd.DataFrame, datasets: list[str], inputs: ReportInputs) -> list[Block]:
    curves = sharp_curves(estimates)
    if curves.empty:
        return [NotRun("MTF of uncorrupted frames", "stage absent", inputs.line(ANY_STAGE))]
    star = star_curve(inputs)
    truths = {"sim": (star["frequency"], star["measured"])} if star is not None and "sim" in datasets else {}
    drawing = sharp_curves_figure.draw(curves, datasets, blur_tables.paper_table(inputs, "uncorrupted_mtf.csv"), truths)
    caption = (
        "Uncorrupted datasets. Median (line) and range of the inliers (band) of the MTF over patches of sharp frames. "
        "Dashed: the paper's medians, which it publishes for the horizontal direction; its Sim is another renderer's."
    )
    if truths:
        caption += " Black: the MTF of Sim, measured on its Siemens star."
    return [ShownFigure("uncorrupted_mtf", drawing, caption, _stages(curves) + (("star",) if truths else ()))]


def _amae(summary: pd.DataFrame, datasets: list[str], inputs: ReportInputs) -> list[Block]:
    table = blur_tables.paper_table(inputs, "blur_amae.csv")
    published = blur_tables.published_amae(table)
    blurred = summary[summary["kind"] != SHARP]
    if blurred.empty:
        return [NotRun("Table I: AMAE of blur estimators", "stage absent", inputs.line(ANY_STAGE))]
    figures = blur_amae.figures(blurred, datasets, table, _stages)
    tables: list[Block] = []
    for dataset in datasets:
        for is_calibrated in (False, True):
            if ((summary["dataset"] == dataset) & (summary["calibrated"] == is_calibrated)).any():
                tables.append(blur_tables.amae(dataset, summary, published, is_calibrated))
    beside = blur_tables.beside_the_best(summary, published)
    extra = (beside, unseen_kernels.table(inputs.unseen))
    return [*figures, *tables, *(one for one in extra if one is not None)]


def _galleries(inputs: ReportInputs) -> dict[str, list[tuple[Gallery, dict[str, Any]]]]:
    """Dataset -> galleries found, with their descriptions, in the estimators' order."""
    found: dict[str, list[tuple[Gallery, dict[str, Any]]]] = {}
    for folder in members(inputs.blur, inputs.blur_members):
        said = optional_json(folder, "gallery.json")
        if said is None:
            continue
        if not isinstance(said, dict) or not set(said) >= {"dataset", "estimator", "frame", "patch", "kernels"}:
            raise InputError(f"{folder / 'gallery.json'}: expected dataset, estimator, frame, patch and kernels; "
                             "run the stage blur again")  # fmt: skip
        gallery = Gallery(said["estimator"], optional_arrays(folder, "gallery.npz"), said["kernels"])
        found.setdefault(said["dataset"], []).append((gallery, said))
    order = list(ESTIMATORS)
    for dataset, pairs in found.items():
        if len({(said["frame"], said["patch"]) for _, said in pairs}) > 1:
            raise InputError(
                f"galleries of '{dataset}' show different patches; run the stage blur again for all of them"
            )
        pairs.sort(key=lambda pair: order.index(pair[0].estimator) if pair[0].estimator in order else len(order))
    return found


def _other_curves(estimates: pd.DataFrame, said: dict[str, Any], shown: set[str]) -> dict[str, dict[str, np.ndarray]]:
    """Estimator -> kernel -> (2, 8) MTF of the gallery's patch, for estimators without a gallery."""
    here = estimates[
        (estimates["dataset"] == said["dataset"])
        & (estimates["frame"] == said["frame"])
        & (estimates["patch"] == said["patch"])
        & estimates["kernel"].isin([entry["kernel"] for entry in said["kernels"]])
        & ~estimates["estimator"].isin(list(shown))
    ].sort_values(["axis", "frequency"])
    found: dict[str, dict[str, np.ndarray]] = {}
    for (estimator, kernel), rows in here.groupby(["estimator", "kernel"], sort=True):
        curves = rows["mtf"].to_numpy(float).reshape(2, len(mtf.FREQUENCIES))
        found.setdefault(str(estimator), {})[str(kernel)] = curves
    return found


def _kernels(estimates: pd.DataFrame, datasets: list[str], inputs: ReportInputs) -> list[Block]:
    found = _galleries(inputs)
    blocks: list[Block] = []
    for dataset in datasets:
        pairs = found.get(dataset)
        if not pairs:
            line = inputs.line(STAGE.format(dataset=dataset, estimator="pmp"))
            blocks.append(NotRun(f"Gallery of kernels found on {word(dataset)}", "stage absent", line))
            continue
        galleries, said = [gallery for gallery, _ in pairs], pairs[0][1]
        names = {gallery.estimator for gallery in galleries}
        others = _other_curves(estimates, said, names | {"typical"})  # nearly the network's own, and curves are many
        drawing = kernel_estimates_figure.draw(galleries, others)
        caption = (
            f"Kernels found in one patch of {word(dataset)}. Seen: the middle of the blurred patch. True and found "
            "kernels share a scale, its width in pixels beneath the true one; beneath a found one, the AMAE of this "
            "patch alone. Curves: MTF, horizontal (H) and vertical (V), the truth in black."
        )
        stages = tuple(STAGE.format(dataset=dataset, estimator=name) for name in in_order(names, ESTIMATORS))
        blocks.append(ShownFigure(f"kernel_estimates_{dataset}", drawing, caption, stages))
    return blocks


def _runs(summary: pd.DataFrame, inputs: ReportInputs) -> list[Run]:
    ran = {(str(row["dataset"]), str(row["estimator"])) for row in records(summary[["dataset", "estimator"]])}
    named = {
        member.removeprefix(f"{dataset}-")
        for dataset in inputs.datasets
        for member in inputs.blur_members or ()
        if member.startswith(f"{dataset}-")
    }
    lines = []
    for dataset in inputs.datasets:
        for estimator in in_order({*named, *(name for _, name in ran)}, ESTIMATORS):
            done = (dataset, estimator) in ran
            absent = None if done else inputs.absent.get(dataset)
            why = "" if done else "data absent" if absent else "stage absent"
            line = absent or inputs.line(STAGE.format(dataset=dataset, estimator=estimator))
            lines.append(Run(f"Blur by {word(estimator)}", dataset, done, why, line))
    return lines


def section(inputs: ReportInputs) -> Section:
    """Blur estimation on every dataset."""
    title, line = "Blur estimation", inputs.line(ANY_STAGE)
    summary = blur_summary(inputs)
    if summary.empty:
        run = Run(title, "", False, "stage absent", line)
        return Section("blur", title, (TEXT,), [NotRun(PARTS, "stage absent", line)], [run])
    estimates = blur_estimates(inputs)
    datasets = in_order(summary["dataset"], inputs.datasets)
    runs = _runs(summary, inputs)
    # An answer of what was added to sharp frames is no curve of theirs.
    absolute = set(summary.loc[~summary["calibrated"], "estimator"]) - blur_tables.ADDED
    blocks = [
        *_sharp(estimates[estimates["estimator"].isin(absolute)], datasets, inputs),
        *_amae(summary, datasets, inputs),
    ]
    blocks += [blur_tables.abstentions(summary, estimates), *_kernels(estimates, datasets, inputs)]
    noted: set[tuple[str, str]] = set()
    for run in runs:
        if not run.ran and (run.dataset, run.line) not in noted:
            noted.add((run.dataset, run.line))
            what = "Blur estimation" if run.why == "data absent" else run.experiment
            blocks.append(NotRun(f"{what} on {word(run.dataset)}", run.why, run.line))
    return Section("blur", title, (TEXT,), blocks, runs)
