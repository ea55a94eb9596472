"""The optics: the bank of blur kernels with their MTF, and the MTF of Sim measured on its Siemens star."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from pipeline import tables
from pipeline.errors import InputError
from pipeline.report import style
from pipeline.report.descriptions import Descriptions
from pipeline.report.display_names import BLURS, counted, in_order, listing, word
from pipeline.report.figures import small_mtf_axes
from pipeline.report.inputs import ReportInputs, published
from pipeline.report.ledger.sources import sharp_mtf, star_curve
from pipeline.report.spec import Block, Section, overview, single
from pipeline.report.tables import where
from pipeline.stage_files import existing

PAGE = Descriptions("optics")
BANK_STAGE, STAR_STAGE = "psf_bank", "star"
SOURCES = {"generated": "generated here", "paper": "the paper's own"}
AXES = {"H": "horizontal", "V": "vertical"}
KEYS = ["blur_kind", "angle_deg", "kernel_size_px"]


def _mtf(axes: Axes, rows: pd.DataFrame) -> None:
    for axis, dash in (("H", "-"), ("V", (0, (3, 1.2)))):
        line = rows[rows["axis"] == axis].sort_values("frequency")
        axes.plot(
            line["frequency"], line["mtf"], color=style.series_look(axis)["color"], linestyle=dash, linewidth=0.9,
            gid=style.series_id(axis, str(rows["kernel"].iloc[0])),
        )  # fmt: skip
    small_mtf_axes(axes)


def kernel_sheet(bank: pd.DataFrame, kernels: Mapping[str, np.ndarray], source: str) -> style.Drawing:
    """Sizes down, kinds and rotations across; each kernel scaled to its maximum, with its MTF beneath.

    ``bank`` is a `pipeline.tables.KERNELS`, ``kernels`` its pictures by name; ``source`` is ``"generated"`` or
    ``"paper"``.

    Raises:
        InputError: the table has no such rows.
    """
    bank = where(bank, source=source)
    if bank.empty:
        raise InputError(f"kernels.parquet: no kernel with source '{source}'; expected 'generated' or 'paper'")
    names = bank.drop_duplicates("kernel").set_index(KEYS)["kernel"]
    kinds, sizes = in_order(bank["blur_kind"], BLURS), sorted(set(bank["kernel_size_px"]))
    columns = [(kind, angle) for kind in kinds for angle in sorted(set(names.xs(kind).index.get_level_values(0)))]
    figure, axes = style.sheet(
        len(columns), [1, 0.6] * len(sizes), left_in=0.42, right_in=0.06, top_in=0.4, bottom_in=0.3, gap_in=0.07,
        row_gap_in=0.08,
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
            style.picture(picture, _framed(kernel, frame), highest=max(kernel.max(), 1e-12))
            _mtf(curve, bank[bank["kernel"] == name])
            if across:
                curve.set_yticklabels([])
            else:
                picture.set_ylabel(f"{size} px", fontweight="bold")
                curve.set_ylabel("MTF", fontsize=5.5, labelpad=1)
            if down + 1 < len(sizes):
                curve.set_xticklabels([])
            else:
                curve.set_xlabel("f / Nyquist", fontsize=5.5, labelpad=1)
    means = bank[bank["blur_kind"] == kinds[0]].groupby("kernel_size_px")["mtf"].mean()
    alt = PAGE.alt(
        "kernels", [{"kind": kind} for kind in kinds], count=counted(bank["kernel"].nunique(), "blur kernel"),
        source=source, sizes=listing(f"{size} px" for size in sizes), first=kinds[0], least=sizes[0], most=sizes[-1],
        least_mtf=means[sizes[0]], most_mtf=means[sizes[-1]],
    )  # fmt: skip
    values = bank.drop(columns="source").sort_values([*KEYS, "axis", "frequency"])
    series = [(axis, title, str(style.series_look(axis)["color"])) for axis, title in AXES.items()]
    return style.Drawing(figure, alt, values, tuple(series))


def _framed(kernel: np.ndarray, side: int) -> np.ndarray:
    """The middle ``side`` x ``side`` of a kernel, padded with zeros where the kernel is smaller."""
    middle = style.middle(kernel, side, side)
    return np.pad(middle, [((side - length) // 2, (side - length + 1) // 2) for length in middle.shape])


def star_figure(
    image: np.ndarray, curves: Mapping[str, np.ndarray], paper: pd.DataFrame | None = None
) -> style.Drawing:
    """The star beside its MTF: measured, by formula, as published.

    ``image`` is (H, W), uint8 or float in [0, 1]; ``curves`` as of `star_curve`; ``paper``: frequency and MTF of its
    Sim.
    """
    figure = style.new_figure(style.TWO_COLUMNS_IN, 2.7)
    left, right = figure.subplots(1, 2, width_ratios=[1, 1.5])
    picture, _ = style.shrunk(np.asarray(image), 512)
    style.picture(left, picture, highest=1 if picture.dtype.kind == "f" else 255)
    blue, red = style.PALETTE[:2]
    formula: style.Look = {"color": style.INK, "linewidth": 0.9}
    measured: style.Look = {"color": blue, "marker": "o", "linestyle": "none"}
    of_paper: style.Look = {"color": red, "marker": "s", "linestyle": (0, (3, 2)), "linewidth": 0.8}
    shown = [
        ("formula", "formula", "line", formula, curves["frequency"], curves["formula"]),
        ("measured", "measured on the star", "points", measured, curves["frequency"], curves["measured"]),
    ]
    if paper is not None and not paper.empty:
        frequency, mtf = (paper[name].to_numpy(float) for name in ("frequency", "mtf"))
        shown.append(("published", "the paper's Sim", "line", of_paper, frequency, mtf))
    for name, label, part, look, frequency, mtf in shown:
        right.plot(frequency, mtf, label=label, gid=style.series_id(name, part), **look)
    right.set(xlabel="spatial frequency [fraction of Nyquist]", ylabel="MTF", ylim=(0, 1.05), xlim=(0, None))
    right.legend(loc="lower left")
    error = np.abs(curves["measured"] - curves["formula"])
    worst = int(np.nanargmax(error))
    half = np.interp(0.5, curves["frequency"], curves["measured"])
    alt = PAGE.alt("sim_star", [], half=half, error=error[worst], frequency=curves["frequency"][worst])
    series = tuple((name, label.removesuffix(" on the star"), str(look["color"])) for name, label, _, look, *_ in shown)
    return style.Drawing(figure, alt, pd.DataFrame(dict(curves)), series)


def _bank(inputs: ReportInputs) -> list[Block]:
    bank = inputs.read("psf/kernels.parquet", tables.KERNELS)
    if bank is None:
        return []
    kernels = inputs.arrays("psf/kernels.npz")
    return [
        PAGE.figure("kernels", kernel_sheet(bank, kernels, source), source=source, origin=SOURCES.get(source, source))
        for source in sorted(set(bank["source"]))
    ]


def _star(inputs: ReportInputs) -> list[Block]:
    curves = star_curve(inputs)
    if curves is None:
        return []
    paper = where(published(inputs, "uncorrupted_mtf.csv"), dataset="sim", estimator="ground_truth")
    theirs = dict(zip(paper["frequency"], paper["mtf"], strict=True))
    drawing = star_figure(inputs.arrays("star/star.npz")["image"], curves, paper)
    cells = {"paper": lambda row: theirs.get(row["frequency"])}
    return [PAGE.figure("sim_star", drawing), PAGE.table("sim_sharpness", sharp_mtf(curves), cells=cells)]


def section(inputs: ReportInputs) -> Section:
    """Optics: kernels and star."""
    runs = [
        single("Blur kernels", BANK_STAGE, existing(inputs.folder("psf")) is not None, inputs),
        *overview("Siemens star", STAR_STAGE, ["sim"] if existing(inputs.folder("star")) else [], inputs, ["sim"]),
    ]
    return PAGE.section([*_bank(inputs), *_star(inputs)], runs)
