"""Image formation: the chain step by step, noise sources at their levels, the levels reached, and photon transfer.

Photon transfer: Janesick, *Photon Transfer* (SPIE 2007); EMVA Standard 1288.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from pipeline import tables
from pipeline.errors import InputError
from pipeline.grouped_statistics import robust_by
from pipeline.report import style
from pipeline.report.descriptions import Descriptions
from pipeline.report.display_names import EFFECTS, in_order, listing, word
from pipeline.report.inputs import ReportInputs
from pipeline.report.spec import Block, Section, overview, single
from pipeline.report.tables import Row, Table
from pipeline.stage_files import described, existing

PAGE = Descriptions("formation")
STAGE, SENSOR_STAGE = "corrupt@{dataset}", "sensor"
CHAIN_PX, EFFECTS_PX = 144, 96  # side of the square shown from a picture's middle, pixel for pixel
CURVE_KEYS = ("mean_dn", "variance_dn2", "slope_dn_per_e", "offset_dn2", "gain_dn_per_e")


def _crop(arrays: Mapping[str, np.ndarray], entry: Mapping[str, Any], side_px: int) -> np.ndarray:
    """The middle of the picture that an entry names, in DN. Shrinking it instead would average the noise away."""
    picture = style.middle(arrays[entry["array"]], side_px, side_px)
    return picture.astype(float) * (255.0 if picture.dtype.kind == "f" else 1.0)


def chain(arrays: Mapping[str, np.ndarray], entries: Sequence[Mapping[str, Any]]) -> style.Drawing:
    """The chain of image formation in its configured order, each step with its change against the step before.

    ``entries`` are ``{"array", "title", "caption"}`` in order, the first the input; ``arrays`` are (H, W), uint8 or
    float in [0, 1].
    """
    pictures = [_crop(arrays, entry, CHAIN_PX) for entry in entries]
    changes = [after - before for before, after in itertools.pairwise(pictures)]
    span = max([float(np.percentile(np.abs(change), 99.5)) for change in changes if change.size] + [1.0])
    figure, axes = style.sheet(len(entries), [1, 1], bottom_in=0.2, row_gap_in=0.08)
    axes[1, 0].set_axis_off()
    axes[1, 0].text(
        0.5, 0.5, f"change against\nthe step before,\ngrey = none,\n±{span:.3g} DN", ha="center", va="center",
        transform=axes[1, 0].transAxes, fontsize=6.2, color=style.MUTED,
    )  # fmt: skip
    rows = []
    for number, (entry, picture) in enumerate(zip(entries, pictures, strict=True)):
        title = str(entry["title"])[:1].upper() + str(entry["title"])[1:]
        style.picture(axes[0, number], picture)
        axes[0, number].set_title(f"{number}  {title}" if number else title, pad=3)
        change = float(changes[number - 1].std()) if number else float("nan")
        if number:
            style.picture(axes[1, number], changes[number - 1], -span, span)
            axes[1, number].set_xlabel(f"std {change:.2f} DN", fontsize=6.2, labelpad=2)
        rows.append({"step": number, "title": title, "mean_dn": picture.mean(), "change_std_dn": change})
    return style.Drawing(figure, PAGE.alt("formation_chain", rows[1:]), pd.DataFrame(rows))


def effects(arrays: Mapping[str, np.ndarray], entries: Sequence[Mapping[str, Any]]) -> style.Drawing:
    """Noise sources down, levels across; beneath each patch the standard deviation present in this part of the frame.

    ``entries`` are ``{"array", "noise_source", "target_sigma_dn"}``; ``arrays`` are (H, W), uint8 or float in [0, 1].
    """
    sources = in_order((entry["noise_source"] for entry in entries), EFFECTS)
    levels = sorted({float(entry["target_sigma_dn"]) for entry in entries})
    crops = {(entry["noise_source"], entry["target_sigma_dn"]): _crop(arrays, entry, EFFECTS_PX) for entry in entries}
    figure, axes = style.sheet(len(levels), [1] * len(sources), left_in=0.22, bottom_in=0.16, row_gap_in=0.19)
    rows = []
    for (across, level), (down, noise_source) in itertools.product(enumerate(levels), enumerate(sources)):
        spot, picture = axes[down, across], crops.get((noise_source, level))
        style.bare(spot)
        if down == 0:
            spot.set_title(f"σ = {level:g} DN", pad=3)
        if across == 0:
            spot.set_ylabel(word(noise_source), fontweight="bold", color=style.INK)
        if picture is None:
            spot.text(0.5, 0.5, "not run", ha="center", va="center", transform=spot.transAxes, color=style.MUTED)
            continue
        style.picture(spot, picture)
        clean = crops.get((noise_source, 0.0))
        present = float("nan") if clean is None or clean.shape != picture.shape else float((picture - clean).std())
        if level > 0 and np.isfinite(present):
            spot.set_xlabel(f"{present:.1f} DN present", fontsize=5.8, labelpad=1.5)
        numbers = {"mean_dn": picture.mean(), "present_std_dn": present}
        rows.append({"noise_source": noise_source, "target_sigma_dn": level, **numbers})
    shown = listing(f"{level:g}" for level in levels)
    alt = PAGE.alt("formation_effects", [{"noise_source": name} for name in sources], levels=shown)
    return style.Drawing(figure, alt, pd.DataFrame(rows))


def photon_transfer(curve: Mapping[str, Any]) -> style.Drawing:
    """Variance over mean of evenly lit frames: points, the fitted line, and the line that the sensor's gain implies.

    ``curve`` has equally long ``mean_dn`` and ``variance_dn2``, ``slope_dn_per_e`` and ``offset_dn2`` of the fit, and
    ``gain_dn_per_e`` of the sensor.

    Raises:
        InputError: the two lists differ in length.
    """
    if len(curve["mean_dn"]) != len(curve["variance_dn2"]):
        raise InputError("photon_transfer.json: mean_dn and variance_dn2 must be equally long; run the stage sensor")
    mean, variance = np.asarray(curve["mean_dn"], dtype=float), np.asarray(curve["variance_dn2"], dtype=float)
    slope, offset, gain = (float(curve[key]) for key in CURVE_KEYS[2:])
    figure = style.new_figure(style.ONE_COLUMN_IN * 1.4, 2.5)
    axes = figure.subplots()
    ends = np.array([0.0, mean.max() * 1.05])
    axes.plot(ends, gain * ends + offset, color=style.INK, linewidth=0.9, label=f"sensor: {gain:.5f} DN/e⁻")
    dashed: style.Look = {"color": style.PALETTE[1], "linestyle": (0, (4, 2))}
    axes.plot(ends, slope * ends + offset, label=f"fit: {slope:.5f} DN/e⁻", **dashed)
    axes.plot(mean, variance, color=style.PALETTE[0], marker="o", linestyle="none", label="simulated frames")
    axes.set(xlabel="mean [DN]", ylabel="variance [DN²]", xlim=(0, None), ylim=(0, None))
    axes.legend(loc="upper left")
    deviation = 100 * (slope / gain - 1)
    alt = PAGE.alt("photon_transfer", [], exposures=len(mean), slope=slope, gain=gain, deviation=deviation)
    return style.Drawing(figure, alt, pd.DataFrame({"mean_dn": mean, "variance_dn2": variance}))


def _galleries(dataset: str, inputs: ReportInputs) -> Iterator[Block]:
    gallery = described(inputs.folders("corrupt")[dataset], "gallery.json", ("chain", "effects"))
    arrays = inputs.arrays(f"corrupt/{dataset}/gallery.npz")
    if gallery is not None and gallery["chain"]:
        steps = " ".join(str(entry.get("caption", "")) for entry in gallery["chain"]).strip()
        yield PAGE.figure("formation_chain", chain(arrays, gallery["chain"]), after=steps, dataset=dataset)
    if gallery is not None and gallery["effects"]:
        yield PAGE.figure("formation_effects", effects(arrays, gallery["effects"]), dataset=dataset)


def _levels(dataset: str, corruption: pd.DataFrame, seed: int) -> Table:
    """Noise present after clipping at each target level; by how much the noise added misses the level."""
    selected = corruption.assign(dataset=dataset).sort_values("target_sigma_dn", kind="stable")
    keys = ["dataset", "noise_source", "target_sigma_dn"]
    cells = robust_by(selected, keys, "clipped_sigma_dn", seed, "report", "levels")
    cells = cells.assign(frames=cells["count"].where(cells["count"] > 0))
    missed = (selected["unclipped_sigma_dn"] / selected["target_sigma_dn"] - 1.0).abs()
    largest = 100.0 * missed.groupby(selected["target_sigma_dn"]).max()

    def deviation(row: Row) -> float | None:
        return float(largest[row["target_sigma_dn"]]) if row["target_sigma_dn"] > 0 else None

    return PAGE.table("noise_levels", cells, cells={"off_percent": deviation}, dataset=dataset)


def section(inputs: ReportInputs) -> Section:
    """Image formation: galleries, the table of levels per dataset, and the sensor."""
    corruption = inputs.each("corrupt", "corruption.parquet", tables.CORRUPTION)
    runs = overview("Image formation", STAGE, corruption, inputs)
    curve = described(inputs.folder("sensor"), "photon_transfer.json", CURVE_KEYS)
    sensor = single("Sensor", SENSOR_STAGE, existing(inputs.folder("sensor")) is not None, inputs)
    blocks = [
        *(block for dataset in corruption for block in _galleries(dataset, inputs)),
        *(_levels(dataset, group, inputs.seed) for dataset, group in corruption.items()),
        None if curve is None else PAGE.figure("photon_transfer", photon_transfer(curve)),
    ]
    return PAGE.section(blocks, [sensor, *runs])
