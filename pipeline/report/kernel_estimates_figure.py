"""The gallery of kernel estimates: one patch under each blur, its true kernel, the kernels found, and their MTF.

Kinds of blur stand beside each other, sizes beneath. All kernels of a cell have one scale in pixels, each its own
maximum as white; beneath an estimate stands the AMAE of this patch alone. The curves also show estimators that
answer without a kernel, from the same patch.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.camera import mtf
from pipeline.errors import InputError
from pipeline.report import style
from pipeline.report.style import Drawing
from pipeline.report.wording import BLURS, ESTIMATORS, counted, in_order, listing, word

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SHOWN_PX = 96  # side of the middle of a patch that is shown
LARGEST_CELL_IN, CURVES_IN = 0.8, 0.56
LEFT_IN, RIGHT_IN, TOP_IN, BOTTOM_IN = 0.46, 0.05, 0.46, 0.3
GROUP_GAP_IN, CELL_GAP_IN, UNDER_PICTURES_IN, UNDER_ROW_IN = 0.2, 0.04, 0.16, 0.24


@dataclass(frozen=True)
class Gallery:
    """What one estimator found in one patch of a dataset.

    Attributes:
        estimator: its name.
        arrays: ``patch_<kernel>``, ``truth_<kernel>``, ``estimate_<kernel>`` (`pipeline.blur.gallery`).
        kernels: descriptions of the kernels, as the stage wrote them.
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
            raise InputError(f"gallery.npz of '{self.estimator}' lacks the array '{name}'; run the stage blur again")
        return np.asarray(self.arrays[name])


class _Sheet:
    """Places axes: groups of picture cells with two panels of curves beneath, in inches from the upper left."""

    def __init__(self, groups: int, rows: int, cells: int) -> None:
        inner = style.TWO_COLUMNS_IN - LEFT_IN - RIGHT_IN - (groups - 1) * GROUP_GAP_IN
        self.cell_in = min(LARGEST_CELL_IN, (inner / groups - (cells - 1) * CELL_GAP_IN) / cells)
        self.group_in = cells * self.cell_in + (cells - 1) * CELL_GAP_IN
        self.row_in = self.cell_in + UNDER_PICTURES_IN + CURVES_IN + UNDER_ROW_IN
        self.width_in = LEFT_IN + RIGHT_IN + groups * self.group_in + (groups - 1) * GROUP_GAP_IN
        self.height_in = TOP_IN + rows * self.row_in - UNDER_ROW_IN + BOTTOM_IN
        self.figure: Figure = style.new_figure(self.width_in, self.height_in)
        self.figure.set_layout_engine("none")

    def left_in(self, group: int) -> float:
        return LEFT_IN + group * (self.group_in + GROUP_GAP_IN)

    def picture(self, group: int, row: int, cell: int) -> Axes:
        start = self.left_in(group) + cell * (self.cell_in + CELL_GAP_IN)
        return self._axes(start, TOP_IN + row * self.row_in, self.cell_in, self.cell_in)

    def curves(self, group: int, row: int, half: int) -> Axes:
        wide = (self.group_in - CELL_GAP_IN) / 2
        upper = TOP_IN + row * self.row_in + self.cell_in + UNDER_PICTURES_IN
        return self._axes(self.left_in(group) + half * (wide + CELL_GAP_IN), upper, wide, CURVES_IN)

    def _axes(self, left: float, upper: float, wide: float, tall: float) -> Axes:
        place = (
            left / self.width_in, 1 - (upper + tall) / self.height_in, wide / self.width_in, tall / self.height_in
        )  # fmt: skip
        return self.figure.add_axes(place)


def _kernel(axes: Axes, kernel: np.ndarray, side_px: int) -> None:
    tall, wide = kernel.shape
    axes.imshow(kernel, cmap="gray", vmin=0, vmax=max(float(kernel.max()), 1e-12),
                extent=(-wide / 2, wide / 2, tall / 2, -tall / 2))  # fmt: skip
    style.bare(axes)
    axes.set(xlim=(-side_px / 2, side_px / 2), ylim=(side_px / 2, -side_px / 2), facecolor="black")


def _estimate(axes: Axes, gallery: Gallery, entry: Mapping[str, Any], side_px: int) -> None:
    if entry["abstained"]:
        style.bare(axes)
        text = f"abstained:\n{entry['reason']}".replace(" ", "\n")
        axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", fontsize=4.6, color=style.MUTED)
        return
    _kernel(axes, gallery.array("estimate", entry["kernel"]), side_px)
    axes.set_xlabel(f"{entry['amae_percent']:.1f} %", fontsize=5.2, labelpad=1.5)


def _curves(axes: Axes, truth: np.ndarray, found: Mapping[str, np.ndarray], place: str) -> None:
    axes.plot(mtf.FREQUENCIES, truth, color=style.INK, linewidth=1.2, zorder=2)
    for position, (name, curve) in enumerate(found.items()):
        if np.isfinite(curve).all():
            axes.plot(
                mtf.FREQUENCIES, curve, color=style.series_look(name, position)["color"], linewidth=0.9, zorder=3,
                gid=style.series_id(name, place),
            )  # fmt: skip
    axes.set(xlim=(0, 0.62), ylim=(0, 1.03), xticks=[0, 0.3, 0.6], yticks=[0, 0.5, 1])
    axes.tick_params(labelsize=4.8, pad=1, length=1.5)


@style.styled
def draw(galleries: Sequence[Gallery], others: Mapping[str, Mapping[str, np.ndarray]] | None = None) -> Drawing:
    """One figure of a dataset's galleries, all of the same patch.

    Args:
        galleries: of the estimators that find kernels, at least one, in the order shown.
        others: estimator -> kernel -> (2, 8) MTF of the same patch, NaN where abstained: those without kernels.

    Raises:
        InputError: no gallery, an array is missing, or the galleries are not of the same kernels.
    """
    from matplotlib.lines import Line2D

    if not galleries:
        raise InputError("no gallery of kernel estimates; run the stage blur for an estimator that finds kernels")
    described = [{str(entry["kernel"]): entry for entry in gallery.kernels} for gallery in galleries]
    first = described[0]
    for gallery, entries in zip(galleries, described, strict=True):
        if set(entries) != set(first):
            raise InputError(f"gallery of '{gallery.estimator}': other kernels than '{galleries[0].estimator}'; run "
                             "the stage blur again for both")  # fmt: skip
    kinds = in_order((str(entry["kind"]) for entry in first.values()), BLURS)
    sizes = sorted({float(entry["size_px"]) for entry in first.values()})
    placed = {(str(entry["kind"]), float(entry["size_px"])): name for name, entry in first.items()}
    names = in_order([*(gallery.estimator for gallery in galleries), *(others or {})], ESTIMATORS)
    sheet = _Sheet(len(kinds), len(sizes), 2 + len(galleries))
    headings = ["seen", "true", *(word(gallery.estimator) for gallery in galleries)]
    rows: list[dict[str, Any]] = []
    for across, kind in enumerate(kinds):
        for down, size in enumerate(sizes):
            name = placed.get((kind, size))
            if name is None:
                continue
            truth = galleries[0].array("truth", name)
            widest = min(gallery.array("estimate", name).shape[0] for gallery in galleries)
            side_px = max(min(int(2 * size) + 1, widest), 11, truth.shape[0])
            cells = [sheet.picture(across, down, cell) for cell in range(len(headings))]
            patch = galleries[0].array("patch", name)
            top, left = (max(0, (side - SHOWN_PX) // 2) for side in patch.shape)
            cells[0].imshow(patch[top : top + SHOWN_PX, left : left + SHOWN_PX], cmap="gray", vmin=0, vmax=255)
            style.bare(cells[0])
            _kernel(cells[1], truth, side_px)
            cells[1].set_xlabel(f"{side_px} px", fontsize=5.2, labelpad=1.5)
            found = {key: np.asarray(curves[name], float) for key, curves in (others or {}).items() if name in curves}
            for cell, gallery, entries in zip(cells[2:], galleries, described, strict=True):
                _estimate(cell, gallery, entries[name], side_px)
                found[gallery.estimator] = np.array(entries[name]["mtf"], dtype=float)  # null becomes NaN
            found = {key: found[key] for key in names if key in found}
            true_mtf = np.array(first[name]["true_mtf"], dtype=float)
            for half, axis in enumerate("HV"):
                panel = sheet.curves(across, down, half)
                _curves(panel, true_mtf[half], {key: curve[half] for key, curve in found.items()}, f"{name} {axis}")
                panel.text(0.03, 0.06, axis, transform=panel.transAxes, ha="left", va="bottom", fontsize=5.2)
                if half or across:
                    panel.set_yticklabels([])
                if down + 1 < len(sizes):
                    panel.set_xticklabels([])
                else:
                    panel.set_xticklabels(["", "0.3", "0.6"] if half else ["0", "0.3", ""])
                    panel.set_xlabel("f / Nyquist", fontsize=5.5, labelpad=1)
            if across == 0:
                cells[0].set_ylabel(f"{size:g} px", fontweight="bold", labelpad=8)
            if down == 0:
                for cell, heading in zip(cells, headings, strict=True):
                    cell.set_title(heading, fontsize=5.8, fontweight="normal", pad=2.5)
            rows += _values(name, kind, size, true_mtf, found)
        middle = (sheet.left_in(across) + sheet.group_in / 2) / sheet.width_in
        sheet.figure.text(middle, 1 - 0.25 / sheet.height_in, word(kind), ha="center", fontsize=7.5, fontweight="bold")
    handles = [Line2D([], [], color=style.INK, linewidth=1.2, label="true")]
    handles += [
        Line2D([], [], color=style.series_look(key, position)["color"], linewidth=0.9, label=word(key))
        for position, key in enumerate(names)
    ]
    sheet.figure.legend(
        handles=handles, loc="upper center", bbox_to_anchor=(0.5, 1.0), ncols=len(handles), borderpad=0.15,
        borderaxespad=0.1,
    )  # fmt: skip
    return _drawing(sheet.figure, rows, galleries, described, names)


def _values(
    kernel: str, kind: str, size_px: float, truth: np.ndarray, found: Mapping[str, np.ndarray]
) -> list[dict[str, Any]]:
    return [
        {
            "kernel": kernel, "kind": kind, "size_px": size_px, "estimator": name, "axis": "HV"[axis],
            "frequency": mtf.FREQUENCIES[place], "true_mtf": truth[axis, place], "mtf": curve[axis, place],
        }
        for name, curve in found.items() for axis, place in np.ndindex(*truth.shape)
    ]  # fmt: skip


def _drawing(
    figure: Figure,
    rows: list[dict[str, Any]],
    galleries: Sequence[Gallery],
    described: Sequence[Mapping[str, Mapping[str, Any]]],
    names: Sequence[str],
) -> Drawing:
    import pandas as pd

    words = []
    for gallery, entries in zip(galleries, described, strict=True):
        errors = [float(entry["amae_percent"]) for entry in entries.values() if not entry["abstained"]]
        abstained = len(entries) - len(errors)
        said = f"mean AMAE {np.mean(errors):.1f} %" if errors else "no kernel"
        words.append(f"{word(gallery.estimator)} {said}" + (f", {abstained} abstained" if abstained else ""))
    alt = f"One patch under {counted(len(described[0]), 'blur kernel')} with the kernels found in it: {listing(words)}."
    return Drawing(figure, alt, pd.DataFrame(rows), style.switches(names))
