"""The gallery of kernel estimates: one patch under each blur, its true kernel, the kernels estimated, and their MTF.

Kinds of blur stand beside each other, sizes beneath. All kernels of a cell have one scale in pixels, each its own
maximum as white; beneath an estimate stands the AMAE of this patch alone. The curves also show estimators without a
kernel, on the same patch.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas
from matplotlib.gridspec import SubplotSpec
from matplotlib.lines import Line2D

from pipeline.camera import mtf
from pipeline.camera.mtf import GENERIC_LENS
from pipeline.errors import InputError
from pipeline.report import style
from pipeline.report.display_names import BLURS, ESTIMATORS, counted, in_order, listing, word
from pipeline.report.figures import lines, small_mtf_axes
from pipeline.report.inputs import ReportInputs, mode_note, relative_mtf
from pipeline.report.sections.blur_amae import PAGE
from pipeline.report.spec import STAGE_ABSENT, Block, NotRun
from pipeline.report.tables import ordered, where

SHOWN_PX = 96  # side of the middle of a patch that is shown
LARGEST_CELL_IN, CURVES_IN, ROW_GAPS_IN, TOP_IN, BOTTOM_IN = 0.8, 0.56, 0.4, 0.58, 0.3
Gallery = tuple[Mapping[str, Any], Mapping[str, np.ndarray]]
"""Description and arrays that one estimator stored of one patch (`pipeline.experiments.pictures.kernel_gallery`)."""

CURVES = ["kernel", "blur_kind", "kernel_size_px", "estimator", "axis", "frequency", "true_mtf", "mtf"]
"""Columns of curves: MTF of one patch under each kernel, by direction and frequency."""

TRUE: style.Look = {"color": style.INK, "linewidth": 1.2}


def _panels(figure: Canvas, spot: SubplotSpec, pictures: int, cell_in: float) -> tuple[list[Axes], list[Axes]]:
    """Square pictures side by side, and beneath them two panels of curves, in one cell of the figure's grid."""
    grid = spot.subgridspec(2, 2 * pictures, height_ratios=(cell_in, CURVES_IN), hspace=0.47, wspace=0.12)
    spots = [grid[0, 2 * number : 2 * number + 2] for number in range(pictures)]
    return [figure.add_subplot(one) for one in spots], [
        figure.add_subplot(one) for one in (grid[1, :pictures], grid[1, pictures:])
    ]


def _kernel(axes: Axes, kernel: np.ndarray, side_px: int) -> None:
    tall, wide = kernel.shape
    style.picture(
        axes, kernel, highest=max(float(kernel.max()), 1e-12), extent=(-wide / 2, wide / 2, tall / 2, -tall / 2)
    )
    axes.set(xlim=(-side_px / 2, side_px / 2), ylim=(side_px / 2, -side_px / 2), facecolor="black")


def _estimate(axes: Axes, kernel: np.ndarray, entry: Mapping[str, Any], side_px: int) -> None:
    if entry["abstained"]:
        style.bare(axes)
        text = f"abstained:\n{entry['reason']}".replace(" ", "\n")
        axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", fontsize=4.6, color=style.MUTED)
        return
    _kernel(axes, kernel, side_px)
    axes.set_xlabel(f"{entry['amae_percent']:.1f} %", fontsize=5.2, labelpad=1.5)


def _curves(about: Mapping[str, Any]) -> pd.DataFrame:
    """`CURVES` of the patch by the estimator of one gallery."""
    index = pd.MultiIndex.from_product([list("HV"), mtf.FREQUENCIES], names=["axis", "frequency"])
    parts = []
    for entry in about["kernels"]:
        both = {name: np.ravel(np.array(entry[name], dtype=float)) for name in ("true_mtf", "mtf")}  # null is NaN
        head = {name: entry[name] for name in ("kernel", "blur_kind", "kernel_size_px")}
        parts.append(pd.DataFrame(both, index).assign(**head))
    return pd.concat(parts).reset_index().assign(estimator=about["estimator"])[CURVES]


def draw(galleries: Sequence[Gallery], others: pd.DataFrame) -> style.Drawing:
    """One figure of a dataset's galleries, all of the same patch, in the order shown.

    ``others``: `CURVES` of the same patch by estimators without kernels, NaN where abstained.

    Raises:
        InputError: an array is missing, or the galleries are not of the same kernels.
    """
    entries = {about["estimator"]: {one["kernel"]: one for one in about["kernels"]} for about, _ in galleries}
    (first_name, first), arrays = next(iter(entries.items())), galleries[0][1]
    for name, group in entries.items():
        if set(group) != set(first):
            raise InputError(
                f"gallery of '{name}': other kernels than '{first_name}'; run the stage blur again for both"
            )
    kinds = in_order((entry["blur_kind"] for entry in first.values()), BLURS)
    sizes = sorted({float(entry["kernel_size_px"]) for entry in first.values()})
    curves = pd.concat([*(_curves(about) for about, _ in galleries), others])
    names = in_order(curves["estimator"], ESTIMATORS)
    looks = {name: {"color": look["color"], "linewidth": 0.9} for name, look in style.series_looks(names).items()}
    headings = ["corrupted", "true", *map(word, entries)]
    cell_in = min(LARGEST_CELL_IN, (style.TWO_COLUMNS_IN - 1.1) / (len(kinds) * len(headings)))
    height_in = TOP_IN + len(sizes) * (cell_in + CURVES_IN + ROW_GAPS_IN) - 0.24 + BOTTOM_IN
    figure = style.new_figure(style.TWO_COLUMNS_IN, height_in)
    figure.set_layout_engine("none")
    grid = figure.add_gridspec(
        len(sizes), len(kinds), left=0.064, right=0.993, bottom=BOTTOM_IN / height_in, top=1 - TOP_IN / height_in,
        wspace=0.1, hspace=0.16,
    )  # fmt: skip
    for kernel, entry in first.items():
        across, down = kinds.index(entry["blur_kind"]), sizes.index(float(entry["kernel_size_px"]))
        truth = arrays[f"truth_{kernel}"]
        widest = min(stored[f"estimate_{kernel}"].shape[0] for _, stored in galleries)
        side_px = max(min(int(2 * sizes[down]) + 1, widest), 11, truth.shape[0])
        cells, halves = _panels(figure, grid[down, across], len(headings), cell_in)
        style.picture(cells[0], style.middle(arrays[f"patch_{kernel}"], SHOWN_PX, SHOWN_PX))
        _kernel(cells[1], truth, side_px)
        cells[1].set_xlabel(f"{side_px} px", fontsize=5.2, labelpad=1.5)
        for cell, (about, stored) in zip(cells[2:], galleries, strict=True):
            _estimate(cell, stored[f"estimate_{kernel}"], entries[about["estimator"]][kernel], side_px)
        for axis, panel in zip("HV", halves, strict=True):
            rows = where(curves, kernel=kernel, axis=axis)
            of_first = where(rows, estimator=first_name)
            panel.plot(of_first["frequency"], of_first["true_mtf"], zorder=2, **TRUE)
            lines(panel, rows.dropna(), "estimator", looks, "frequency", "mtf", part=kernel, key=axis)
            small_mtf_axes(panel)
            panel.text(0.03, 0.06, axis, transform=panel.transAxes, ha="left", va="bottom", fontsize=5.2)
            if axis == "V" or across:
                panel.set_yticklabels([])
            panel.set_xticklabels([])
            if down + 1 == len(sizes):
                panel.set_xticklabels(["0", "0.3", ""] if axis == "H" else ["", "0.3", "0.6"])
                panel.set_xlabel("f / Nyquist", fontsize=5.5, labelpad=1)
        if across == 0:
            cells[0].set_ylabel(f"{sizes[down]:g} px", fontweight="bold", labelpad=8)
        if down == 0:
            middle = (cells[0].get_position().x0 + cells[-1].get_position().x1) / 2
            heading = word(entry["blur_kind"])
            figure.text(middle, 1 - 0.37 / height_in, heading, ha="center", fontsize=7.5, fontweight="bold")
            for cell, heading in zip(cells, headings, strict=True):
                cell.set_title(heading, fontsize=5.8, fontweight="normal", pad=2.5)
    legend = [("true", TRUE), *((word(name), look) for name, look in looks.items())]
    figure.legend(
        handles=[Line2D([], [], label=label, **look) for label, look in legend], loc="upper center",
        bbox_to_anchor=(0.5, 1.0), ncols=-(-len(legend) // 2), borderpad=0.15, borderaxespad=0.1,
    )  # fmt: skip
    alt = f"One patch under {counted(len(first), 'blur kernel')} with the kernels estimated in it: {_errors(entries)}."
    table = ordered(curves, blur_kind=kinds, kernel_size_px=(), estimator=names)
    return style.Drawing(figure, alt, table, style.switches(names))


def _errors(entries: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> str:
    """Mean AMAE and abstentions of every estimator, in words."""
    words = []
    for name, kernels in entries.items():
        errors = [float(entry["amae_percent"]) for entry in kernels.values() if not entry["abstained"]]
        mean = f"mean AMAE {np.mean(errors):.1f} %" if errors else "no kernel"
        abstained = len(kernels) - len(errors)
        words.append(f"{word(name)} {mean}" + (f", {abstained} abstained" if abstained else ""))
    return listing(words)


def blocks(estimates: pd.DataFrame, datasets: Sequence[str], inputs: ReportInputs) -> Iterator[Block]:
    """One gallery per dataset, or a note on the stage that would make it."""
    stored = inputs.galleries("blur", "gallery", ("frame", "patch"), ("kernels",))
    for dataset in datasets:
        if dataset not in stored:
            line = inputs.line(f"blur@{dataset}-pmp")
            yield NotRun(f"Gallery of kernel estimates on {word(dataset)}", STAGE_ABSENT, line)
            continue
        galleries = {about["estimator"]: (about, arrays) for about, arrays in stored[dataset]}
        names = in_order(galleries, ESTIMATORS)
        # Relative to a generic lens, a network's MTF is nearly that of the system, and curves are many.
        hidden = {*names, *(name for name, to in relative_mtf(estimates).items() if to == GENERIC_LENS)}
        about = stored[dataset][0][0]
        here = where(estimates, dataset=dataset, frame=about["frame"], patch=about["patch"])
        here = where(here, kernel=[entry["kernel"] for entry in about["kernels"]])
        others = here[~here["estimator"].isin(list(hidden))].sort_values(["axis", "frequency"], kind="stable")
        drawn = in_order({*names, *others["estimator"]}, ESTIMATORS)
        stages, after = [f"blur@{dataset}-{name}" for name in drawn], mode_note(inputs.modes, names)
        drawing = draw([galleries[name] for name in names], others[CURVES])
        yield PAGE.figure("kernel_estimates", drawing, stages, after=after, dataset=dataset)
