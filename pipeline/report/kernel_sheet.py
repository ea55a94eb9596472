"""The contact sheet of the PSF bank: every kernel with its horizontal and vertical MTF beneath, rotations across."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from pipeline.errors import InputError
from pipeline.report import style
from pipeline.report.style import Drawing
from pipeline.report.wording import BLURS, counted, in_order, listing, word

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

AXES = {"H": "horizontal", "V": "vertical"}
KEYS = ["kind", "angle_deg", "size_px"]


def _curves(axes: Axes, rows: pd.DataFrame) -> None:
    for axis, dash in (("H", "-"), ("V", (0, (3, 1.2)))):
        line = rows[rows["axis"] == axis].sort_values("frequency")
        axes.plot(
            line["frequency"], line["mtf"], color=style.series_look(axis)["color"], linestyle=dash, linewidth=0.9,
            gid=style.series_id(axis, str(rows["kernel"].iloc[0])),
        )  # fmt: skip
    axes.set(xlim=(0, 0.62), ylim=(0, 1.03), xticks=[0, 0.3, 0.6], yticks=[0, 0.5, 1])
    axes.tick_params(labelsize=4.8, pad=1, length=1.5)


@style.styled
def draw(table: pd.DataFrame, kernels: Mapping[str, np.ndarray], source: str) -> Drawing:
    """Sizes down, kinds and rotations across; each kernel scaled to its own maximum, in a frame of common size.

    Args:
        table: `pipeline.tables.KERNELS`.
        kernels: kernel name -> (k, k), unit sum.
        source: which rows of the table to show, ``"generated"`` or ``"paper"``.

    Raises:
        InputError: the table has no such rows, or names a kernel without a picture.
    """
    table = table[table["source"] == source]
    if table.empty:
        raise InputError(f"kernels.parquet: no kernel with source '{source}'; expected 'generated' or 'paper'")
    absent = sorted(set(table["kernel"]) - set(kernels))
    if absent:
        raise InputError(f"kernels.npz: no array for kernel '{absent[0]}'; run dvc repro psf_bank")
    names = table.drop_duplicates("kernel").set_index(KEYS)["kernel"]
    kinds = in_order(table["kind"], BLURS)
    columns = [(kind, angle) for kind in kinds for angle in sorted(set(names.xs(kind).index.get_level_values(0)))]
    sizes = sorted(set(table["size_px"]))
    shape = {"left_in": 0.42, "right_in": 0.06, "gap_in": 0.07}
    cell_in = style.sheet_cell_in(len(columns), margins_in=0.48, gap_in=0.07)
    cell_in = min(cell_in, 1.0)
    figure, axes = style.sheet(
        len(columns), [cell_in, 0.6 * cell_in] * len(sizes), top_in=0.4, bottom_in=0.3,
        row_gaps_in=([0.05, 0.12] * len(sizes))[:-1], **shape,
    )  # fmt: skip
    for across, (kind, angle) in enumerate(columns):
        heading = word(kind) if kind == "defocus" else f"{word(kind)}, {angle:g}°".replace(" motion", "\nmotion")
        axes[0, across].set_title(heading, fontsize=5.8, pad=3)
        for down, size in enumerate(sizes):
            picture, curve = axes[2 * down, across], axes[2 * down + 1, across]
            name = names.get((kind, angle, size))
            if not isinstance(name, str):
                picture.set_axis_off()
                curve.set_axis_off()
                continue
            kernel = np.asarray(kernels[name], dtype=float)
            # A kernel is shown in a frame a little larger than its nominal size, whatever its array's margin.
            frame = max(int(size * 1.6) | 1, *(side for side in kernel.shape if side <= 1.6 * size), 7)
            picture.imshow(_framed(kernel, frame), cmap="gray", vmin=0, vmax=max(kernel.max(), 1e-12))
            style.bare(picture)
            _curves(curve, table[table["kernel"] == name])
            if across:
                curve.set_yticklabels([])
            if down + 1 < len(sizes):
                curve.set_xticklabels([])
            if across == 0:
                picture.set_ylabel(f"{size} px", fontweight="bold")
                curve.set_ylabel("MTF", fontsize=5.5, labelpad=1)
            if down + 1 == len(sizes):
                curve.set_xlabel("f / Nyquist", fontsize=5.5, labelpad=1)
    first = table[(table["size_px"] == sizes[0]) & (table["kind"] == kinds[0])]["mtf"]
    last = table[(table["size_px"] == sizes[-1]) & (table["kind"] == kinds[0])]["mtf"]
    alt = (
        f"{counted(table['kernel'].nunique(), 'blur kernel')} ({source}): "
        f"{listing(word(kind).lower() for kind in kinds)} "
        f"in sizes {listing(f'{size} px' for size in sizes)} with MTF curves. Mean MTF over the sampled frequencies of "
        f"{word(kinds[0]).lower()}: {first.mean():.2f} at {sizes[0]} px, {last.mean():.2f} at {sizes[-1]} px."
    )
    values = table.drop(columns="source").sort_values([*KEYS, "axis", "frequency"])
    series = [(axis, title, str(style.series_look(axis)["color"])) for axis, title in AXES.items()]
    return Drawing(figure, alt, values, tuple(series))


def _framed(kernel: np.ndarray, side: int) -> np.ndarray:
    """The middle ``side`` x ``side`` of a kernel, padded with zeros where the kernel is smaller."""
    out = np.zeros((side, side))
    take = [min(side, length) for length in kernel.shape]
    source = tuple(
        slice((length - part) // 2, (length - part) // 2 + part)
        for length, part in zip(kernel.shape, take, strict=True)
    )
    target = tuple(slice((side - part) // 2, (side - part) // 2 + part) for part in take)
    out[target] = kernel[source]
    return out
