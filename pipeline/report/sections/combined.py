"""The section of blur and noise at once: the order of the physics, what estimators read, and smoothing before."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from pipeline.errors import InputError
from pipeline.report import (
    combined_amae_figure,
    combined_example_figure,
    combined_noise_figure,
    combined_order_figure,
    combined_tables,
)
from pipeline.report.combined_tables import DENOISED_STAGE, ORDER, STAGE
from pipeline.report.inputs import (
    ReportInputs,
    any_table,
    combined_folders,
    denoised_cells,
    existing,
    optional_arrays,
    optional_json,
)
from pipeline.report.inputs import combined_tables as read_tables
from pipeline.report.ledger import LedgerRow
from pipeline.report.sections import published
from pipeline.report.sections.base import Block, Section, ShownFigure, missing, overview
from pipeline.report.wording import EXPERIMENTS, in_order, word

if TYPE_CHECKING:
    import pandas as pd

TEXT = (
    "Each source enters at its own place: photon noise is in the light and passes the optics, so the blur softens it; "
    "dark current and readout come after the optics and stay sharp. The paper gives up on blur from noise of 10 DN on, "
    "unless the patch is smoothed by a known disc before, whose MTF is divided out after.",
)


def _paper(inputs: ReportInputs, name: str) -> pd.DataFrame | None:
    path = existing(inputs.paper / name)
    return None if path is None else any_table(path)


def _examples(dataset: str, curves: pd.DataFrame, inputs: ReportInputs) -> list[ShownFigure]:
    folder = combined_folders(inputs).get(dataset)
    said, arrays = optional_json(folder, "example.json"), optional_arrays(folder, "example.npz")
    if said is None:
        return []
    if not isinstance(said, dict) or not set(said) >= {"dataset", "size_px", "experiments"}:
        raise InputError(f"{folder}/example.json: expected dataset, size_px and experiments; run the stage again")
    if not said["experiments"]:
        return []
    stages = (STAGE.format(dataset=dataset),)
    caption = (
        f"The order of the physics. The middle of a patch of {word(dataset)} after each step, for noise that the "
        "optics blur and for noise that they do not."
    )
    figures = [ShownFigure(f"combined_order_{dataset}", combined_order_figure.draw(arrays, said), caption, stages)]
    estimator = in_order(curves["estimator"], ORDER)[:1]
    own = curves[curves["estimator"].isin(estimator) & ~curves["calibrated"]]
    if len(own):
        paper = _paper(inputs, "photon_linear_motion_mtf.csv")
        theirs = {} if paper is None else {"photon_linear": paper}
        caption = (
            f"A blur of {said['size_px']:g} px under growing noise on {word(dataset)}. The middle of one patch, and "
            f"the MTF that {word(estimator[0])} reads (median over all patches, mean of horizontal and vertical), as "
            "recorded and smoothed before."
        )
        drawing = combined_example_figure.draw(own, arrays, said, theirs)
        figures.append(ShownFigure(f"combined_example_{dataset}", drawing, caption, stages))
    return figures


def _figures(blur: pd.DataFrame, noise: pd.DataFrame, datasets: Sequence[str], inputs: ReportInputs) -> list[Block]:
    stages = tuple(STAGE.format(dataset=dataset) for dataset in datasets)
    blocks: list[Block] = []
    for dataset in datasets:
        if (noise["dataset"] == dataset).any():
            caption = (
                f"Noise read from blurred frames of {word(dataset)}: medians, coloured by the size of the blur. "
                "Dashed: the noise really there before clipping, photon noise as the optics pass it on; the "
                "cell-wise estimator leaves out, by design, what the optics have blurred."
            )
            drawing = combined_noise_figure.draw(noise, dataset)
            blocks.append(ShownFigure(f"combined_noise_{dataset}", drawing, caption, (STAGE.format(dataset=dataset),)))
    estimator = in_order(blur["estimator"], ORDER)[:1]
    paper = _paper(inputs, "photon_defocus_amae.csv")
    theirs = {} if paper is None else {"photon_defocus": paper}
    for is_calibrated in (False, True):
        own = blur[blur["estimator"].isin(estimator) & (blur["calibrated"] == is_calibrated)]
        if own.empty:
            continue
        how = ", calibrated" if is_calibrated else ""
        caption = (
            f"Error of {word(estimator[0])} over the noise level{how}, coloured by the size of the blur; band: "
            "bootstrap 95 % interval. Dashed: the paper's CNN on Udacity, where it prints numbers."
        )
        name = "combined_amae_calibrated" if is_calibrated else "combined_amae"
        blocks.append(ShownFigure(name, combined_amae_figure.draw(own, datasets, theirs), caption, stages))
    return blocks


def section(chapter: published.Chapter, rows: Sequence[LedgerRow], inputs: ReportInputs) -> Section:
    """Blur and noise at once on every dataset, and the supplement's smoothing.

    Args:
        chapter: its heading and the paper's numbers.
        rows: the whole ledger.
        inputs: of the report.
    """
    blur, noise, curves = read_tables(inputs)
    cells = denoised_cells(inputs)
    ran = in_order(blur["dataset"], inputs.datasets)
    smoothed = in_order(cells["dataset"], inputs.datasets)
    runs = overview("Blur and noise at once", STAGE, ran, inputs)
    denoised_runs = overview("Denoised blur", DENOISED_STAGE, smoothed, inputs)
    blocks: list[Block] = []
    for place, dataset in enumerate(ran):
        figures = _examples(dataset, curves[curves["dataset"] == dataset], inputs)
        blocks += figures if place == 0 else figures[1:]  # the order is the same on every dataset
    if ran:
        blocks += [*_figures(blur, noise, ran, inputs), combined_tables.overview(blur)]
    theirs = combined_tables.published_photon_defocus(_paper(inputs, "photon_defocus_amae.csv"))
    for dataset in ran:
        for experiment in in_order(blur.loc[blur["dataset"] == dataset, "experiment"], EXPERIMENTS):
            known = theirs if experiment == "photon_defocus" else None
            blocks.append(combined_tables.amae(dataset, experiment, blur, known))
    paper = _paper(inputs, "improved_blur.csv")
    blocks += [combined_tables.denoised(dataset, cells, paper) for dataset in smoothed]
    if ran:
        blocks.append(combined_tables.abstentions(blur, noise))
    beside = published.section(chapter, rows, inputs)
    blocks += beside.blocks
    own = [*runs, *denoised_runs]
    blocks += [*missing("Blur and noise at once", runs), *missing("Denoised blur", denoised_runs)]
    return Section(chapter.key, chapter.title, TEXT, blocks, [*own, *beside.runs])
