"""The gallery of kernel estimates: one patch under each blur, its true kernel, the kernels estimated, and their MTF.

Kinds of blur stand beside each other, sizes beneath. All kernels of a cell have one scale in pixels, each its own
maximum as white; beneath an estimate stands the AMAE of this patch alone. The curves also show estimators without a
kernel, on the same patch.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
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
from pipeline.report.figures import small_mtf_axes
from pipeline.report.inputs import ReportInputs, mode_note, relative_mtf
from pipeline.report.sections.blur_amae import PAGE
from pipeline.report.spec import Block, NotRun
from pipeline.report.style import Drawing
from pipeline.report.tables import ordered, where

SHOWN_PX = 96  # side of the middle of a patch that is shown
LARGEST_CELL_IN, CURVES_IN = 0.8, 0.56
# at the top two lines of legend and the headings
LEFT_IN, RIGHT_IN, TOP_IN, BOTTOM_IN = 0.46, 0.05, 0.58, 0.3
GROUP_GAP_IN, CELL_GAP_IN, UNDER_PICTURES_IN, UNDER_ROW_IN = 0.2, 0.04, 0.16, 0.24


@dataclass(frozen=True)
class Gallery:
    """Kernels that one estimator estimates in one patch of a dataset (`pipeline.experiments.kernel_gallery`).

    ``arrays`` holds ``patch_<kernel>``, ``truth_<kernel>`` and ``estimate_<kernel>``.
    """

    estimator: str
    arrays: Mapping[str, np.ndarray]
    kernels: Sequence[Mapping[str, Any]]

    def array(self, part: str, kernel: str) -> np.ndarray:
        """One array.

        Raises:
            InputError: the archive lacks it.
        """
        name = f"{part}_{kernel}"
        if name not in self.arrays:
            raise InputError(f"gallery of '{self.estimator}' lacks the array '{name}'; run the stage blur again")
        return np.asarray(self.arrays[name])


def _panels(figure: Canvas, group: SubplotSpec, pictures: int, cell_in: float) -> tuple[list[Axes], list[Axes]]:
    """Square pictures side by side, and beneath them two panels of curves, in one cell of the figure's grid."""
    wide_in = pictures * cell_in + (pictures - 1) * CELL_GAP_IN
    heights = cell_in, CURVES_IN
    parts = group.subgridspec(2, 1, height_ratios=heights, hspace=2 * UNDER_PICTURES_IN / sum(heights))
    across = parts[0].subgridspec(1, pictures, wspace=CELL_GAP_IN / cell_in)
    halves = parts[1].subgridspec(1, 2, wspace=2 * CELL_GAP_IN / (wide_in - CELL_GAP_IN))
    return [figure.add_subplot(across[n]) for n in range(pictures)], [figure.add_subplot(halves[n]) for n in (0, 1)]


def _kernel(axes: Axes, kernel: np.ndarray, side_px: int) -> None:
    tall, wide = kernel.shape
    style.picture(
        axes, kernel, highest=max(float(kernel.max()), 1e-12), extent=(-wide / 2, wide / 2, tall / 2, -tall / 2)
    )
    axes.set(xlim=(-side_px / 2, side_px / 2), ylim=(side_px / 2, -side_px / 2), facecolor="black")


def _estimate(axes: Axes, gallery: Gallery, entry: Mapping[str, Any], side_px: int) -> None:
    if entry["abstained"]:
        style.bare(axes)
        text = f"abstained:\n{entry['reason']}".replace(" ", "\n")
        axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", fontsize=4.6, color=style.MUTED)
        return
    _kernel(axes, gallery.array("estimate", entry["kernel"]), side_px)
    axes.set_xlabel(f"{entry['amae_percent']:.1f} %", fontsize=5.2, labelpad=1.5)


def _curves(axes: Axes, truth: np.ndarray, estimates: Mapping[str, np.ndarray], key: str) -> None:
    axes.plot(mtf.FREQUENCIES, truth, color=style.INK, linewidth=1.2, zorder=2)
    for position, (name, curve) in enumerate(estimates.items()):
        if np.isfinite(curve).all():
            axes.plot(
                mtf.FREQUENCIES, curve, color=style.series_look(name, position)["color"], linewidth=0.9, zorder=3,
                gid=style.series_id(name, key),
            )  # fmt: skip
    small_mtf_axes(axes)


@style.styled
def draw(galleries: Sequence[Gallery], others: Mapping[str, Mapping[str, np.ndarray]] | None = None) -> Drawing:
    """One figure of a dataset's galleries, all of the same patch, in the order shown.

    ``others``: estimator without kernels -> kernel -> (2, 8) MTF of the same patch, NaN where abstained.

    Raises:
        InputError: no gallery, an array is missing, or the galleries are not of the same kernels.
    """
    if not galleries:
        raise InputError("no gallery of kernel estimates; run the stage blur for a kernel estimator")
    entries = {gallery.estimator: {str(one["kernel"]): one for one in gallery.kernels} for gallery in galleries}
    first = entries[galleries[0].estimator]
    for name, group in entries.items():
        if set(group) != set(first):
            raise InputError(
                f"gallery of '{name}': other kernels than '{galleries[0].estimator}'; run the stage blur again for both"
            )
    kinds = in_order((str(entry["blur_kind"]) for entry in first.values()), BLURS)
    sizes = sorted({float(entry["kernel_size_px"]) for entry in first.values()})
    names = in_order([*entries, *(others or {})], ESTIMATORS)
    headings = ["corrupted", "true", *map(word, entries)]
    gaps_in, groups, cells_in_group = (len(kinds) - 1) * GROUP_GAP_IN, len(kinds), len(headings)
    group_in = (style.TWO_COLUMNS_IN - LEFT_IN - RIGHT_IN - gaps_in) / groups
    cell_in = min(LARGEST_CELL_IN, (group_in - (cells_in_group - 1) * CELL_GAP_IN) / cells_in_group)
    group_in, row_in = cells_in_group * (cell_in + CELL_GAP_IN) - CELL_GAP_IN, cell_in + UNDER_PICTURES_IN + CURVES_IN
    width_in = LEFT_IN + groups * group_in + gaps_in + RIGHT_IN
    height_in = TOP_IN + len(sizes) * row_in + (len(sizes) - 1) * UNDER_ROW_IN + BOTTOM_IN
    figure = style.new_figure(width_in, height_in)
    figure.set_layout_engine("none")
    grid = figure.add_gridspec(
        len(sizes), groups, left=LEFT_IN / width_in, right=1 - RIGHT_IN / width_in, bottom=BOTTOM_IN / height_in,
        top=1 - TOP_IN / height_in, wspace=GROUP_GAP_IN / group_in, hspace=UNDER_ROW_IN / row_in,
    )  # fmt: skip
    rows: list[dict[str, Any]] = []
    for across, kind in enumerate(kinds):
        middle = (LEFT_IN + across * (group_in + GROUP_GAP_IN) + group_in / 2) / width_in
        figure.text(middle, 1 - 0.37 / height_in, word(kind), ha="center", fontsize=7.5, fontweight="bold")
    for kernel, entry in first.items():
        across, down = kinds.index(str(entry["blur_kind"])), sizes.index(float(entry["kernel_size_px"]))
        truth = galleries[0].array("truth", kernel)
        widest = min(gallery.array("estimate", kernel).shape[0] for gallery in galleries)
        side_px = max(min(int(2 * sizes[down]) + 1, widest), 11, truth.shape[0])
        cells, halves = _panels(figure, grid[down, across], len(headings), cell_in)
        patch = galleries[0].array("patch", kernel)
        style.picture(cells[0], style.middle(patch, SHOWN_PX, SHOWN_PX))
        _kernel(cells[1], truth, side_px)
        cells[1].set_xlabel(f"{side_px} px", fontsize=5.2, labelpad=1.5)
        curves = {key: np.asarray(known[kernel], float) for key, known in (others or {}).items() if kernel in known}
        for cell, gallery in zip(cells[2:], galleries, strict=True):
            about = entries[gallery.estimator][kernel]
            _estimate(cell, gallery, about, side_px)
            curves[gallery.estimator] = np.array(about["mtf"], dtype=float)  # null becomes NaN
        curves = {key: curves[key] for key in names if key in curves}
        true_mtf = np.array(entry["true_mtf"], dtype=float)
        for half, (axis, panel) in enumerate(zip("HV", halves, strict=True)):
            _curves(panel, true_mtf[half], {key: curve[half] for key, curve in curves.items()}, f"{kernel} {axis}")
            panel.text(0.03, 0.06, axis, transform=panel.transAxes, ha="left", va="bottom", fontsize=5.2)
            if half or across:
                panel.set_yticklabels([])
            if down + 1 < len(sizes):
                panel.set_xticklabels([])
            else:
                panel.set_xticklabels(["", "0.3", "0.6"] if half else ["0", "0.3", ""])
                panel.set_xlabel("f / Nyquist", fontsize=5.5, labelpad=1)
        if across == 0:
            cells[0].set_ylabel(f"{sizes[down]:g} px", fontweight="bold", labelpad=8)
        if down == 0:
            for cell, heading in zip(cells, headings, strict=True):
                cell.set_title(heading, fontsize=5.8, fontweight="normal", pad=2.5)
        head = {"kernel": kernel, "blur_kind": entry["blur_kind"], "kernel_size_px": sizes[down]}
        rows += [
            {**head, "estimator": name, "axis": "HV"[axis], "frequency": mtf.FREQUENCIES[number],
             "true_mtf": true_mtf[axis, number], "mtf": curve[axis, number]}
            for name, curve in curves.items() for axis, number in np.ndindex(*true_mtf.shape)
        ]  # fmt: skip
    _legend(figure, names)
    values = ordered(pd.DataFrame(rows), blur_kind=kinds, kernel_size_px=())
    alt = f"One patch under {counted(len(first), 'blur kernel')} with the kernels estimated in it: {_errors(entries)}."
    return Drawing(figure, alt, values, style.switches(names))


def _legend(figure: Canvas, names: Sequence[str]) -> None:
    handles = [Line2D([], [], color=style.INK, linewidth=1.2, label="true")]
    for name, look in style.series_looks(names).items():
        handles.append(Line2D([], [], color=look["color"], linewidth=0.9, label=word(name)))
    figure.legend(
        handles=handles, loc="upper center", bbox_to_anchor=(0.5, 1.0), ncols=-(-len(handles) // 2), borderpad=0.15,
        borderaxespad=0.1,
    )  # fmt: skip


def _errors(entries: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> str:
    """Mean AMAE and abstentions of every estimator, in words."""
    words = []
    for name, kernels in entries.items():
        errors = [float(entry["amae_percent"]) for entry in kernels.values() if not entry["abstained"]]
        mean = f"mean AMAE {np.mean(errors):.1f} %" if errors else "no kernel"
        abstained = len(kernels) - len(errors)
        words.append(f"{word(name)} {mean}" + (f", {abstained} abstained" if abstained else ""))
    return listing(words)


def _other_curves(
    estimates: pd.DataFrame, about: Mapping[str, Any], hidden: set[str]
) -> dict[str, dict[str, np.ndarray]]:
    """Estimator -> kernel -> (2, 8) MTF of the gallery's patch, of estimators that are not hidden."""
    here = where(estimates, **{name: about[name] for name in ("dataset", "frame", "patch")})
    here = where(here, kernel=[entry["kernel"] for entry in about["kernels"]])
    here = here[~here["estimator"].isin(list(hidden))].sort_values(["axis", "frequency"])
    curves: dict[str, dict[str, np.ndarray]] = {}
    for (estimator, kernel), rows in here.groupby(["estimator", "kernel"], sort=True):
        curve = rows["mtf"].to_numpy(float).reshape(2, len(mtf.FREQUENCIES))
        curves.setdefault(str(estimator), {})[str(kernel)] = curve
    return curves


def blocks(estimates: pd.DataFrame, datasets: Sequence[str], inputs: ReportInputs) -> list[Block]:
    """One gallery per dataset, or a note on the stage that would make it."""
    stored = inputs.galleries("blur", "gallery", ("frame", "patch"), ("kernels",))
    made: list[Block] = []
    for dataset in datasets:
        if dataset not in stored:
            line = inputs.line(f"blur@{dataset}-pmp")
            made.append(NotRun(f"Gallery of kernel estimates on {word(dataset)}", "stage absent", line))
            continue
        shown = [Gallery(about["estimator"], arrays, about["kernels"]) for about, arrays in stored[dataset]]
        galleries = {gallery.estimator: gallery for gallery in shown}
        names = in_order(galleries, ESTIMATORS)
        # Relative to a generic lens, a network's MTF is nearly that of the system, and curves are many.
        hidden = {*names, *(name for name, to in relative_mtf(estimates).items() if to == GENERIC_LENS)}
        drawing = draw([galleries[name] for name in names], _other_curves(estimates, stored[dataset][0][0], hidden))
        stages = [f"blur@{dataset}-{name}" for name in names]
        after = mode_note(inputs.modes, names)
        made.append(PAGE.figure("kernel_estimates", drawing, stages, after=after, dataset=dataset))
    return made
