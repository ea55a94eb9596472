"""Noise of real cameras: estimates beside the measured truth, behind codecs, and the constants of a sensor."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from pipeline.experiments.real_noise import bounds as real_noise_bounds
from pipeline.experiments.real_noise import records as real_noise_records
from pipeline.experiments.real_noise.records import Examples, Recording, Sensor
from pipeline.grouped_statistics import share_interval
from pipeline.noise.real_noise import shared_errors
from pipeline.report import style
from pipeline.report.descriptions import Descriptions
from pipeline.report.display_names import listing, word
from pipeline.report.figures import add_legend
from pipeline.report.inputs import Benchmark, ReportInputs
from pipeline.report.spec import Block, Run, Section, of_benchmark
from pipeline.report.tables import Row, Table, ordered, records, where

STAGE = "real_noise@{name}"
SENSOR = "flea3"
"""Name of the recording that has raw frames of a sensor instead of pairs of pictures."""

TITLE = "Noise of real cameras"
PAGE = Descriptions("real_noise")
ORDER = ("adaptive", "correlated", "cellwise", "pca", "pca_stride_2", "bf", "wavelet")
BEFORE, NOW = "cellwise", "adaptive"
LABELS = {BEFORE: "white noise only", NOW: "default"}
REASONS = {"compressed": "codec traces"}
"""Reason of an estimator to abstain -> plain words, where they differ."""
SHOWN = ("adaptive", "cellwise", "pca", "pca_stride_2", "bf")
CODED = Benchmark("coded_noise", "python benchmarks/coded_noise.py", ("datasets", "frames", "patches"))
VIDEOS = Benchmark("video_codecs", "python benchmarks/video_codecs.py", ("datasets", "by_codec"))
HIDING = "Noise behind codecs that hide it"
KNOWN = {"unknown": "no", "named": "by name", "file": "with quantiser"}
CODECS = {
    "none": "as it is",
    "jpeg": "JPEG",
    "mjpeg": "Motion JPEG",
    "mpeg4": "MPEG-4",
    "h264": "H.264",
    "hevc": "HEVC (H.265)",
    "vp8": "VP8",
    "vp9": "VP9",
    "av1": "AV1",
    "scaled": "scaled by",
    "aliased": "scaled, no low-pass, by",
    "turned": "turned by 2 degrees",
    "demosaiced": "demosaiced, bilinear",
    "sharpened": "sharpened",
    "gaussian": "smoothed, 0.8 px",
    "median": "median filter, 3 px",
    "bilateral": "bilateral filter",
    "nlm": "non-local means",
    "photons": "photon noise, then gamma",
    "readout": "readout noise, then gamma",
}
UNITS = {"frames": "whole frames", "patches": "patches"}
ADDED = ("0", "2", "5", "10", "25")
"""DN."""
BOUNDED = ADDED[:-1]
"""Of them those with frames that have no estimate."""


def scatter(parts: Sequence[Recording], estimators: Sequence[str]) -> style.Drawing:
    """Estimate over cleaned truth, patch by patch: recordings down, estimators across."""
    names, looks = [part.name for part in parts], style.series_looks(estimators)
    patches = pd.concat([part.patches.assign(recording=part.name) for part in parts], ignore_index=True)
    patches = ordered(where(patches, estimator=list(estimators)), recording=names, estimator=estimators)
    patches = patches.assign(error=(patches["sigma_dn"] - patches["cleaned_sigma_dn"]).abs())
    first = where(patches, estimator=estimators[0]).groupby("recording")["sigma_dn"].quantile(0.99)
    tops = 1.05 * np.maximum(patches.groupby("recording")["cleaned_sigma_dn"].max(), first)

    def dots(axes: Axes, rows: pd.DataFrame, key: str) -> None:
        recording, estimator = rows[["recording", "estimator"]].iloc[0]
        top, colour = tops[recording], looks[estimator]["color"]
        axes.plot([0, top], [0, top], color=style.MUTED, linewidth=0.6, zorder=1)
        beyond = rows["sigma_dn"] > top
        axes.scatter(
            rows["cleaned_sigma_dn"][~beyond], rows["sigma_dn"][~beyond], s=2.5, linewidths=0, alpha=0.55, color=colour,
            zorder=2, rasterized=True,
        )  # fmt: skip
        axes.scatter(
            rows["cleaned_sigma_dn"][beyond], np.full(beyond.sum(), 0.97 * top), marker="^", s=11, facecolors="none",
            edgecolors=colour, linewidths=0.5, zorder=3,
        )  # fmt: skip
        note = f"error {rows['error'].mean():.2f} DN, {100 * rows['sigma_dn'].notna().mean():.0f} % estimated"
        # above the panel, since every corner inside has points in some panel
        axes.text(0, 1.03, note, transform=axes.transAxes, va="bottom", fontsize=5, color=style.INK)
        axes.set(xlim=(0, top), ylim=(0, top))

    words = patches.groupby(["recording", "estimator"], sort=False, as_index=False)["error"].mean()
    return PAGE.grid("real_noise", patches, PAGE.alt("real_noise", words), {}, down=names, across=estimators, over=dots)


def errors(parts: Sequence[Recording]) -> Table:
    """Errors, coverage and abstentions of every estimator on every recording."""
    each = [part.summary.merge(shared_errors(part.patches, NOW), how="left", on="estimator") for part in parts]
    rows = pd.concat([rows.assign(recording=part.name) for rows, part in zip(each, parts, strict=True)])
    rows = ordered(rows, recording=[part.name for part in parts], estimator=ORDER)
    return PAGE.table("real_noise_errors", rows)


def white_and_correlation(parts: Sequence[Recording]) -> Table:
    """Errors of the white part and of the correlation, of the estimators that take noise apart."""
    rows = pd.concat([part.summary.assign(recording=part.name) for part in parts])
    rows = ordered(rows, recording=[part.name for part in parts], estimator=ORDER)
    return PAGE.table("real_noise_parts", rows[np.isfinite(rows["white_mae_dn"])])


def picture_bounds(parts: Sequence[Recording]) -> Table:
    """Whole pictures without an estimate of the default estimator, and how much noise there is at most in them."""
    rows = [
        {"recording": part.name, **row}
        for part in parts
        for row in records(real_noise_bounds.picture_bounds(where(part.patches, estimator=NOW)))
        if row["bounded"]
    ]
    return PAGE.table("real_noise_picture_bounds", rows)


def sensor_figure(made: Sensor) -> style.Drawing:
    """Photon transfer and dark current of a sensor's colour planes."""
    planes = list(made.transfer["plane"])
    looks = style.series_looks(planes)
    figure = style.new_figure(style.TWO_COLUMNS_IN, 2.3)
    transfer, dark = figure.subplots(1, 2)
    for axes, points, (x, y), fits, (offset, slope) in (
        (transfer, made.points, ("mean_dn", "variance_dn2"), made.transfer, ("dark_variance_dn2", "gain_dn_per_e")),
        (dark, made.dark_means, ("exposure_s", "mean_dn"), made.dark, ("offset_dn", "slope_dn_per_s")),
    ):
        for fit in records(fits):
            selected, colour = where(points, plane=fit["plane"]), looks[fit["plane"]]["color"]
            axes.plot(selected[x], selected[y], "o", markersize=2.6, color=colour)
            ends = np.array([0.0, selected[x].max()])
            axes.plot(ends, fit[offset] + fit[slope] * ends, linewidth=0.8, color=colour)
    labels = {"xlabel": "mean grey value above black [DN]", "ylabel": "variance of the noise [DN²]"}
    transfer.set(**labels, title="Photon transfer")
    dark.set(xlabel="exposure time [s]", ylabel="mean of a dark frame [DN]", title="Dark current")
    add_legend(figure, [(f"plane {name}", {**look, "linestyle": "-", "marker": "o"}) for name, look in looks.items()])
    gain, noise, dark_e = (
        {"least": column.min(), "most": column.max()}
        for column in (made.transfer["gain_dn_per_e"], made.transfer["dark_sigma_e"], made.dark["dark_current_e_per_s"])
    )
    alt = PAGE.alt("real_sensor", [], planes=len(planes), gain=gain, noise=noise, dark=dark_e)
    return style.Drawing(figure, alt, made.points)


def answer(row: Row) -> str:
    """An estimate in words: the median with its interval, and why there is none of some or of most patches."""
    patches, answered = int(row["patches"]), int(row["answered"])
    counts = dict(part.split(": ") for part in str(row["reasons"]).split(", ") if part)
    reasons = [(REASONS.get(reason, reason), int(count)) for reason, count in counts.items()]
    if 2 * answered < patches:
        return f"no answer in {patches - answered} of {patches} patches: {', '.join(words for words, _ in reasons)}"
    without = ", ".join(f"{words} ({count} {'patch' if count == 1 else 'patches'})" for words, count in reasons)
    text = f"{row['sigma_dn']:.2f} DN ({row['low_dn']:.2f} to {row['high_dn']:.2f})"
    return f"{text}; no answer: {without}" if without else text


def crops(made: Examples) -> style.Drawing:
    """Crops side by side, with the noise present and both estimates below each."""
    names = list(dict.fromkeys(made.table["example"]))
    figure = style.new_figure(style.TWO_COLUMNS_IN, 3.05)
    words = []
    for axes, name, crop in zip(figure.subplots(1, len(names), squeeze=False)[0], names, made.crops, strict=True):
        style.picture(axes, np.asarray(crop), interpolation="nearest")
        axes.set_title(name, fontsize=6.5)
        rows = {row["estimator"]: row for row in records(made.table[made.table["example"] == name])}
        lines = [f"present: {rows[NOW]['true_sigma_dn']:.2f} DN"]
        lines += [f"{LABELS[estimator]}: {answer(rows[estimator])}" for estimator in (BEFORE, NOW)]
        axes.set_xlabel("\n".join(lines).replace("; ", "\n"), fontsize=5.6, linespacing=1.5)
        words.append(f"{name}: {'; '.join(lines)}")
    return style.Drawing(figure, f"Crops of three pictures with their noise estimates. {'. '.join(words)}.", made.table)


def behind_codecs(record: Mapping[str, Any]) -> Table:
    """What is answered of frames and patches with noise behind codecs, filters and a tone curve, and what is wrong."""
    rows = []
    for unit, title in UNITS.items():
        codecs = record[unit]["by_codec"]
        for codec in sorted(codecs, key=_order):
            levels = {f"added_{added}": _answered(codecs[codec][added]) for added in ADDED}
            count = codecs[codec][ADDED[0]]["count"]
            rows.append({"unit": title, "codec": _stored(codec), "count": count, **levels})
    notes = _of_few_frames(levels[ADDED[0]] for levels in record["frames"]["by_codec"].values())
    also = [PAGE.text("shares_of_patches")] if notes else []
    return PAGE.table("real_noise_coded", rows, notes=notes + also, datasets=listing(map(word, record["datasets"])))


def behind_video_codecs(record: Mapping[str, Any]) -> Table:
    """What is answered of frames behind codecs that hide noise, and what is wrong, by whether the codec is known."""
    codecs, rows = record["by_codec"], []
    for codec in sorted(codecs, key=_order):
        for known, title in KNOWN.items():
            levels = {added: codecs[codec][added][known] for added in ADDED}
            cells = {f"added_{added}": _answered(level) for added, level in levels.items()}
            rows.append({"codec": _stored(codec), "known": title, "count": levels[ADDED[0]]["count"], **cells})
    notes = _of_few_frames(levels[ADDED[0]][known] for levels in codecs.values() for known in KNOWN)
    return PAGE.table("real_noise_video", rows, notes=notes, datasets=listing(map(word, record["datasets"])))


def _of_few_frames(levels: Iterable[Mapping[str, Any]]) -> list[str]:
    """How sure shares of so many whole frames are, in words; nothing where there are none."""
    frames = max((level["count"] for level in levels), default=0)
    if not frames:
        return []
    ends = [share_interval(successes, frames) for successes in (0, frames // 2, frames)]
    none, low, high, every = (100 * end for end in (ends[0][1], *ends[1], ends[2][0]))
    return [PAGE.text("shares_of_frames", frames=frames, none=none, low=low, high=high, all=every)]


def video_bounds(record: Mapping[str, Any]) -> Table:
    """How much noise there is at most in frames without an estimate behind known codecs that hide noise."""
    codecs, rows = record["by_codec"], []
    for codec in sorted(codecs, key=_order):
        for known in list(KNOWN)[1:]:
            levels = {codec: {added: codecs[codec][added][known] for added in ADDED}}
            rows += [{"known": KNOWN[known], **row} for row in _bounds(levels, ADDED)]
    return PAGE.table("real_noise_video_bounds", rows)


def bounds(record: Mapping[str, Any]) -> Table:
    """How much noise there is at most in whole frames without an estimate, by codec or filter."""
    return PAGE.table("real_noise_bounds", _bounds(record["frames"]["by_codec"], BOUNDED))


def _bounds(codecs: Mapping[str, Mapping[str, Any]], levels: Sequence[str]) -> list[Row]:
    """Rows of a table of bounds at levels of noise: of those codecs that have any."""
    return [
        {"codec": _stored(codec), **{f"added_{added}": _bound(codecs[codec][added]) for added in levels}}
        for codec in sorted(codecs, key=_order)
        if any(codecs[codec][added]["bounded"] for added in levels)
    ]


def _stored(codec: str) -> str:
    """A codec or filter and its number, in words."""
    name, *quality = codec.split()
    return " ".join([CODECS.get(name, name), *quality])


def _order(codec: str) -> tuple[int, str, list[float]]:
    """Sorting key of codecs and filters: by name, then by their number."""
    name, *quality = codec.split()
    known = list(CODECS)
    return known.index(name) if name in known else len(known), name, list(map(float, quality))


def _answered(level: Mapping[str, Any]) -> str:
    """Percentages answered, of the answers wrong, and of their intervals that hold the truth: ``"64 / 3 / 98"``.

    Empty where the noise saturates every patch.
    """
    if not level["count"]:
        return ""
    share = f"{100 * level['answered'] / level['count']:.0f}"
    if not level["answered"]:
        return share
    return f"{share} / {100 * level['wrong'] / level['answered']:.0f} / {100 * level['held_fraction']:.0f}"


def _bound(level: Mapping[str, Any]) -> str:
    """Frames with a bound, its median and the percentage that it holds: ``"20 / 4.9 / 100"``; empty where none has."""
    if not level["bounded"]:
        return ""
    return f"{level['bounded']} / {level['bound_dn']:.1f} / {100 * level['bound_held_fraction']:.0f}"


def section(inputs: ReportInputs) -> Section | None:
    """Noise of real cameras, or None where nothing of it is known; errors of `ReportInputs.benchmark`."""
    stages = inputs.folders("real_noise")
    parts = real_noise_records.recordings(stages, inputs.recorded)
    made = real_noise_records.sensor(stages, inputs.recorded)
    known = {part.name for part in parts} | ({SENSOR} if made is not None else set())
    coded = inputs.benchmark(CODED, lambda record: [behind_codecs(record), bounds(record)])
    videos = inputs.benchmark(VIDEOS, lambda record: [behind_video_codecs(record), video_bounds(record)])
    if not known and not stages and coded is None and videos is None:
        return None
    examples, blocks = real_noise_records.examples(inputs.recorded), list[Block]()
    if examples is not None:
        blocks.append(PAGE.figure("real_noise_examples", crops(examples), source=examples.source))
    if parts:
        made_by = tuple(part.stage for part in parts if part.stage)
        estimators = [name for name in SHOWN if any((part.patches["estimator"] == name).any() for part in parts)]
        drawing = scatter(parts, estimators)
        blocks += [PAGE.figure("real_noise", drawing, made_by), errors(parts), white_and_correlation(parts)]
        blocks += [picture_bounds(parts), _sources(parts)]
    if made is not None:
        constants = made.transfer.merge(made.dark, on="plane")
        blocks.append(PAGE.figure("real_sensor", sensor_figure(made), [made.stage] if made.stage else ()))
        blocks.append(PAGE.table("real_sensor_constants", constants, stage=made.stage))
    runs = [_run(inputs, name, name in known) for name in stages]
    for tables, title, benchmark in ((coded, "Noise behind codecs", CODED), (videos, HIDING, VIDEOS)):
        if tables is not None:
            recorded, run = of_benchmark(title, benchmark, tables)
            blocks += recorded
            runs.append(run)
    return PAGE.section(blocks, runs)


def _sources(parts: Sequence[Recording]) -> Table:
    rows = [
        {"recording": part.name, "pictures": int(part.summary["pictures"].max()), "source": part.source,
         "measured": "by its stage" if part.stage else "recorded earlier"}
        for part in parts
    ]  # fmt: skip
    return PAGE.table("real_noise_sources", rows)


def _run(inputs: ReportInputs, name: str, is_recorded: bool) -> Run:
    ran = real_noise_records.stage_has_run(inputs.folders("real_noise"), name)
    line = f"dvc exp run -S real_noise.recordings.{name}.folder=/path real_noise@{name} report"
    return Run(TITLE, word(name), ran, "" if ran else "data absent", line, is_recorded)
