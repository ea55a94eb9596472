"""The datasets: sample frames, pixel statistics, sizes, and files in quarantine."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from pipeline import tables
from pipeline.datasets.power_spectrum import power_spectrum
from pipeline.grouped_statistics import robust_by
from pipeline.report import style
from pipeline.report.descriptions import Descriptions
from pipeline.report.display_names import word
from pipeline.report.inputs import ReportInputs
from pipeline.report.spec import Section, overview
from pipeline.report.tables import Table, estimate, pivot, records, where

PAGE = Descriptions("datasets")
STAGE = "index@{dataset}"
PREFIX = "frame_"
SHOWN_PX = 300  # longest side of a picture inside the figure
MAX_FRAMES = 4
STATISTICS = (
    "mean_dn", "std_dn", "spectrum_slope", "gradient_mean_dn", "gradient_p99_dn", "flat_fraction", "saturated_fraction",
)  # fmt: skip
"""Columns of the table of frames."""


@dataclass(frozen=True)
class DatasetSample:
    """Sample frames of one dataset by their name: (H, W) uint8; and their boxes, ``{label, x1, y1, x2, y2, ignore}``.

    ``patches`` is a `pipeline.tables.PATCHES`, None where there is none.
    """

    name: str
    frames: Mapping[str, np.ndarray]
    boxes: Mapping[str, Sequence[Mapping[str, Any]]] = field(default_factory=dict)
    patches: pd.DataFrame | None = None


def _picture(axes: Axes, sample: DatasetSample, frame: str) -> None:
    picture, scale = style.shrunk(sample.frames[frame], SHOWN_PX)
    style.picture(axes, picture)
    axes.set(xlim=(-0.5, picture.shape[1] - 0.5), ylim=(picture.shape[0] - 0.5, -0.5))

    def outline(left: float, top: float, right: float, bottom: float, **look: Any) -> None:
        style.outline(axes, [scale * edge - 0.5 for edge in (left, top, right, bottom)], **look)

    if sample.patches is not None:
        for patch in records(where(sample.patches, frame=frame, purpose="blur")):
            x, y, side = patch["x_px"], patch["y_px"], patch["size_px"]
            outline(x, y, x + side, y + side, edgecolor=style.PALETTE[5], lw=0.7, ls=(0, (2.5, 1.5)))
    for box in sample.boxes.get(frame, ()):
        colour, dash = (style.MUTED, ":") if box.get("ignore") else (style.PALETTE[4], "-")
        outline(*(box[edge] for edge in ("x1", "y1", "x2", "y2")), edgecolor=colour, lw=0.8, linestyle=dash)


def samples_figure(samples: Sequence[DatasetSample]) -> style.Drawing:
    """One row of frames per dataset (boxes solid, blur patches dashed), then spectrum and histogram of all.

    Every sample has at least one frame.
    """
    across = max(1, min(MAX_FRAMES, max(len(sample.frames) for sample in samples)))
    width = style.TWO_COLUMNS_IN
    heights = []
    for sample in samples:
        shapes = [frame.shape for frame in list(sample.frames.values())[:across]]
        heights.append(max(height / long for height, long in shapes) * width / across + 0.12)
    figure = style.new_figure(width, sum(heights) + 2.0)
    upper, lower = np.ravel(np.asarray(figure.subfigures(2, 1, height_ratios=[sum(heights), 2.0])))
    pictures = upper.subplots(len(samples), across, squeeze=False, height_ratios=heights)
    spectrum_axes, histogram_axes = lower.subplots(1, 2)
    curves = []
    for number, sample in enumerate(samples):
        names = list(sample.frames)[:across]
        for axes in pictures[number][len(names) :]:
            axes.set_axis_off()
        for axes, frame in zip(pictures[number], names, strict=False):
            _picture(axes, sample, frame)
        pictures[number][0].set_title(word(sample.name), loc="left", pad=3)
        look = style.series_look(sample.name, number) | {"label": word(sample.name)}
        spectra = [power_spectrum(sample.frames[frame]) for frame in names]
        frequency, power = spectra[0][0], np.exp(np.log(np.maximum([one for _, one in spectra], 1e-9)).mean(axis=0))
        counts = np.sum([np.bincount(sample.frames[frame].ravel(), minlength=256) for frame in names], axis=0)
        percent = 100 * counts.astype(float).reshape(64, 4).sum(axis=1) / max(int(counts.sum()), 1)
        spectrum_axes.loglog(frequency, power, **look | {"marker": ""}, gid=style.series_id(sample.name, "spectrum"))
        histogram_axes.stairs(
            percent, np.arange(0, 257, 4), color=look["color"], label=look["label"], linewidth=1.0,
            gid=style.series_id(sample.name, "histogram"),
        )  # fmt: skip
        for curve, x, y in (("spectrum", frequency, power), ("histogram_percent", np.arange(0, 256, 4), percent)):
            curves.append(pd.DataFrame({"dataset": sample.name, "curve": curve, "x": x.astype(float), "y": y}))
    spectrum_axes.set(xlabel="spatial frequency [cycles/px]", ylabel="power [DN²]", title="Power spectrum")
    histogram_axes.set(xlabel="grey level [DN]", ylabel="share of pixels [%]", title="Histogram", xlim=(0, 256))
    spectrum_axes.legend()
    boxes = sum(len(list(sample.boxes.get(frame, ()))) for sample in samples for frame in sample.frames)
    words = [{"dataset": sample.name, "frames": len(sample.frames)} for sample in samples]
    alt = PAGE.alt("datasets", words, boxes=boxes)
    series = style.switches(sample.name for sample in samples) if len(samples) > 1 else ()
    return style.Drawing(figure, alt, pd.concat(curves), series)


def _samples(inputs: ReportInputs) -> list[DatasetSample]:
    samples = []
    for dataset, arrays in inputs.each("index", "samples.npz").items():
        frames = {name.removeprefix(PREFIX): array for name, array in arrays.items() if name.startswith(PREFIX)}
        if frames:
            patches = inputs.read(f"index/{dataset}/patches.parquet", tables.PATCHES)
            boxes = inputs.read(f"index/{dataset}/samples.json") or {}
            samples.append(DatasetSample(dataset, frames, boxes, patches))
    return samples


def _sizes(frames: Mapping[str, pd.DataFrame], inputs: ReportInputs) -> Table:
    rows = []
    for dataset, group in frames.items():
        patches, quarantine = (
            inputs.read(f"index/{dataset}/{name}.parquet", schema)
            for name, schema in (("patches", tables.PATCHES), ("quarantine", tables.QUARANTINE))
        )
        purposes = Counter[str]() if patches is None else Counter(patches["purpose"])
        sizes = group.groupby(["width_px", "height_px"]).size().sort_values(ascending=False, kind="stable")
        size = "\u00a0×\u00a0".join(str(side) for side in sizes.index[0]) if len(sizes) else ""
        rows.append({
            "dataset": dataset, "frames": len(group), "size_px": size + (" and others" if len(sizes) > 1 else ""),
            "objects": int(group["objects"].sum()), "ignored": int(group["objects_ignored"].sum()),
            "blur_patches": purposes["blur"], "noise_patches": purposes["noise"],
            "quarantined": None if quarantine is None else len(quarantine),
        })  # fmt: skip
    return PAGE.table("dataset_sizes", rows)


def _statistics(frames: Mapping[str, pd.DataFrame], seed: int) -> Table:
    long = pd.concat([group.melt(["dataset"], list(STATISTICS), "statistic") for group in frames.values()])
    cells = robust_by(long, ["dataset", "statistic"], "value", seed, "report", "frames")
    rows = pivot(cells, ["dataset"], "statistic", estimate("median", "low", "high", "count"))
    return PAGE.table("dataset_statistics", rows)


def _quarantine(quarantined: Mapping[str, pd.DataFrame]) -> Table | None:
    rows = []
    for dataset, selected in quarantined.items():
        for reason, files in selected.groupby("reason", sort=True)["file"]:
            names = sorted(PurePath(str(name)).name for name in files)
            examples = ", ".join(names[:3]) + (" …" if len(names) > 3 else "")
            rows.append({"dataset": dataset, "reason": str(reason), "files": len(names), "examples": examples})
    return PAGE.table("quarantine", rows) if rows else None


def section(inputs: ReportInputs) -> Section:
    """Datasets: figure, sizes, statistics, quarantine."""
    frames = inputs.each("index", "frames.parquet", tables.FRAMES)
    quarantined = inputs.each("index", "quarantine.parquet", tables.QUARANTINE)
    runs, samples = overview("Datasets", STAGE, frames, inputs), _samples(inputs)
    stages, quarantine = [STAGE.format(dataset=sample.name) for sample in samples], _quarantine(quarantined)
    blocks = [
        PAGE.figure("datasets", samples_figure(samples), stages) if samples else None,
        *((_sizes(frames, inputs), _statistics(frames, inputs.seed)) if frames else ()),
        quarantine,
    ]
    text = [PAGE.text("none_in_quarantine")] if quarantined and quarantine is None else []
    return PAGE.section(blocks, runs, text=text)
