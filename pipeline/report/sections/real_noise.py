"""Noise of real cameras: estimates beside the measured truth, and the constants of a sensor from its raw frames."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pipeline.report import real_noise_records, style
from pipeline.report.display_names import in_order, listing, word
from pipeline.report.figures import add_legend
from pipeline.report.inputs import ReportInputs
from pipeline.report.ledger import LedgerRow
from pipeline.report.real_noise_records import Recording, Sensor
from pipeline.report.sections import real_noise_examples
from pipeline.report.spec import Block, Figure, Run, Section
from pipeline.report.style import Drawing
from pipeline.report.tables import Column, Table, estimate, ordered, table

if TYPE_CHECKING:
    pass

STAGE = "real_noise@{name}"
SENSOR = "flea3"
"""Name of the recording that has raw frames of a sensor instead of pairs of pictures."""

TITLE = "Noise of real cameras"
TEXT = (
    "Photographs as cameras deliver them: demosaiced, denoised, sharpened and compressed, so that their noise is "
    "correlated between pixels. The truth of a 128 px patch is the standard deviation of photograph minus mean of many "
    "shots of the same scene; cleaned of what misregistration and drift of light leave in that difference. Raw frames "
    "follow the photon transfer of their sensor. Where the stage has not run, the numbers are those recorded earlier "
    "(reports/recorded), with the SHA-256 of every picture."
)
NAMES = {"cc": "CC", "polyu": "PolyU", "flea3": "Flea3 (raw)"}
ORDER = ("adaptive", "correlated", "cellwise", "pca", "pca_stride_2", "bf", "wavelet")
ESTIMATORS = {"adaptive": "Adaptive", "correlated": "Correlated", "pca_stride_2": "PCA, every 2nd pixel"}
SHOWN = ("adaptive", "cellwise", "pca", "pca_stride_2", "bf")


def recording_word(name: str) -> str:
    """Display name of a recording."""
    return NAMES.get(name, word(name))


def estimator_word(name: str) -> str:
    """Display name of an estimator."""
    return ESTIMATORS.get(name, word(name))


@style.styled
def scatter(parts: Sequence[Recording], estimators: Sequence[str]) -> Drawing:
    """Estimate over cleaned truth, patch by patch: recordings down, estimators across.

    Args:
        parts: recordings, at least one.
        estimators: columns of the figure.
    """
    import pandas as pd

    figure = style.new_figure(style.TWO_COLUMNS_IN, 1.45 * len(parts) + 0.35)
    grid = figure.subplots(len(parts), len(estimators), squeeze=False, sharex="row", sharey="row")
    values, words = [], []
    for row, part in enumerate(parts):
        first = part.patches.loc[part.patches["estimator"] == estimators[0], "sigma_dn"]
        top = 1.05 * max(float(part.patches["cleaned_sigma_dn"].max()), float(first.quantile(0.99)))
        for column, name in enumerate(estimators):
            axes = grid[row, column]
            own = part.patches[part.patches["estimator"] == name]
            answered = own[np.isfinite(own["sigma_dn"])]
            axes.plot([0, top], [0, top], color=style.MUTED, linewidth=0.6, zorder=1)
            axes.scatter(
                answered["cleaned_sigma_dn"], answered["sigma_dn"].clip(upper=top), s=2.5, linewidths=0, alpha=0.55,
                color=style.series_looks(list(estimators))[name]["color"], zorder=2, rasterized=True,
            )  # fmt: skip
            error = (answered["sigma_dn"] - answered["cleaned_sigma_dn"]).abs().mean()
            note = f"error {error:.2f} DN\n{100 * len(answered) / max(len(own), 1):.0f} % answered"
            axes.text(0.04, 0.96, note, transform=axes.transAxes, va="top", fontsize=5, color=style.INK)
            axes.set(xlim=(0, top), ylim=(0, top))
            if row == 0:
                axes.set_title(estimator_word(name))
            if row == len(parts) - 1:
                axes.set_xlabel("measured σ [DN]")
            values.append(own[["estimator", "picture", "cleaned_sigma_dn", "sigma_dn"]].assign(recording=part.name))
            words.append(f"{estimator_word(name)} on {recording_word(part.name)} {error:.2f} DN")
        grid[row, 0].set_ylabel(f"{recording_word(part.name)}\nestimated σ [DN]")
    alt = f"Estimated over measured noise of single patches. Mean absolute error: {listing(words)}."
    return Drawing(figure, alt, pd.concat(values, ignore_index=True))


def errors(parts: Sequence[Recording]) -> Table:
    """Errors, coverage and abstentions of every estimator on every recording."""
    import pandas as pd

    rows = pd.concat([part.summary.assign(recording=part.name) for part in parts], ignore_index=True)
    rows = ordered(rows, recording=[part.name for part in parts], estimator=ORDER)
    columns = [
        Column("recording", "Recording", source=lambda row: recording_word(row["recording"])),
        Column("estimator", "Estimator", source=lambda row: estimator_word(row["estimator"])),
        Column("patches", "Patches"),
        Column("true_mean_dn", "Noise, raw", "DN", 2),
        Column("cleaned_mean_dn", "Noise, cleaned", "DN", 2),
        Column("true_mae_dn", "Error, raw", "DN", 2, estimate("true_mae_dn", "true_mae_low_dn", "true_mae_high_dn")),
        Column(
            "cleaned_mae_dn", "Error, cleaned", "DN", 2,
            estimate("cleaned_mae_dn", "cleaned_mae_low_dn", "cleaned_mae_high_dn"),
        ),
        Column("cleaned_bias_dn", "Bias, cleaned", "DN", 2),
        _percent("true_coverage_fraction", "Interval holds raw"),
        _percent("cleaned_coverage_fraction", "Interval holds cleaned"),
        _percent("answered_fraction", "Answered"),
        Column("mean_picture_sigma_dn", "Read from the mean", "DN", 2),
        _percent("mean_picture_answered_fraction", "Means answered"),
    ]  # fmt: skip
    notes = [
        "Mean absolute error over answered patches, in brackets its bootstrap 95 % interval over pictures. Read from "
        "the mean: estimate on the mean of many shots, which has next to no noise. Intervals are nominally 95 %.",
        "CC and PolyU pictures are development pictures: the constants of the adaptive estimator were chosen on them.",
    ]
    return table(
        "real_noise_errors", "Noise of real cameras: estimates beside the measured truth.", rows, columns, notes
    )


def _percent(name: str, title: str) -> Column:
    return Column(name, title, "%", 0, lambda row: 100 * row[name] if np.isfinite(row[name]) else None)


@style.styled
def sensor_figure(made: Sensor) -> Drawing:
    """Photon transfer and dark current of a sensor's colour planes.

    Args:
        made: its constants and the points that they were fitted to.
    """
    planes = list(made.transfer["plane"])
    looks = style.series_looks(planes)
    figure = style.new_figure(style.TWO_COLUMNS_IN, 2.3)
    transfer, dark = figure.subplots(1, 2)
    for (_, fit), (_, current) in zip(made.transfer.iterrows(), made.dark.iterrows(), strict=True):
        plane, colour = fit["plane"], looks[fit["plane"]]["color"]
        own = made.points[made.points["plane"] == plane]
        transfer.plot(own["mean_dn"], own["variance_dn2"], "o", markersize=2.6, color=colour)
        ends = np.array([0.0, own["mean_dn"].max()])
        transfer.plot(ends, fit["dark_variance_dn2"] + fit["gain_dn_per_e"] * ends, linewidth=0.8, color=colour)
        means = made.dark_means[made.dark_means["plane"] == plane]
        dark.plot(means["exposure_s"], means["mean_dn"], "o", markersize=2.6, color=colour)
        ends = np.array([0.0, means["exposure_s"].max()])
        dark.plot(ends, current["offset_dn"] + current["slope_dn_per_s"] * ends, linewidth=0.8, color=colour)
    transfer.set(xlabel="mean grey value [DN]", ylabel="variance of the noise [DN²]", title="Photon transfer")
    dark.set(xlabel="exposure time [s]", ylabel="mean of a dark frame [DN]", title="Dark current")
    add_legend(figure, [(f"plane {name}", {**look, "linestyle": "-", "marker": "o"}) for name, look in looks.items()])
    gain, noise = made.transfer["gain_dn_per_e"], made.transfer["dark_sigma_e"]
    alt = (
        f"Photon transfer: variance over mean is a straight line in each of {len(planes)} colour planes, with a gain "
        f"of {gain.min():.4f} to {gain.max():.4f} DN per electron and a dark noise of {noise.min():.1f} to "
        f"{noise.max():.1f} electrons. Dark frames grow by {made.dark['dark_current_e_per_s'].min():.3f} to "
        f"{made.dark['dark_current_e_per_s'].max():.3f} electrons per second."
    )
    return Drawing(figure, alt, made.points)


def sensor_table(made: Sensor) -> Table:
    """Constants of a sensor by colour plane."""
    rows = made.transfer.merge(made.dark, on="plane")
    columns = [
        Column("plane", "Colour plane"),
        Column("gain_dn_per_e", "System gain", "DN/e", 4),
        Column("gain_error", "± (standard error)", "DN/e", 4),
        Column("dark_sigma_e", "Dark noise", "e", 1),
        Column("saturation_e", "Saturation", "e", 0),
        Column("snr_at_saturation", "SNR at saturation", "", 1),
        Column("dark_current_e_per_s", "Dark current", "e/s", 3),
        Column("zero_fraction", "Dark pixels at 0", "%", 1, lambda row: 100 * row["zero_fraction"]),
    ]
    notes = [
        "After EMVA 1288, from pairs of exposures of one scene. Where nearly all dark pixels are 0 the black level "
        "cuts the dark noise off: the dark current is that of hot pixels, a lower limit."
    ]
    return table("real_sensor_constants", "Sensor constants from raw frames.", rows, columns, notes, made.stage)


def section(inputs: ReportInputs, ledger: Sequence[LedgerRow] = ()) -> Section | None:
    """Noise of real cameras, or None where nothing of it is known."""
    parts, made = real_noise_records.recordings(inputs), real_noise_records.sensor(inputs)
    pairs = {part.name for part in parts}
    runs = [_run(inputs, name, name in pairs or (made is not None and name == SENSOR)) for name in inputs.real_noise]
    if not parts and made is None and not runs:
        return None
    examples = real_noise_records.examples(inputs)
    blocks: list[Block] = [] if examples is None else [real_noise_examples.block(examples)]
    if parts:
        stages = tuple(part.stage for part in parts if part.stage)
        estimators = in_order(
            (name for part in parts for name in part.patches["estimator"].unique() if name in SHOWN), SHOWN
        )
        caption = (
            "Estimated over measured noise (cleaned) of single patches; points above the axis are drawn at its end. "
            "Estimators of white noise read correlated noise low."
        )
        blocks += [Figure("real_noise", scatter(parts, estimators), caption, stages), errors(parts), _sources(parts)]
    if made is not None:
        caption = "Photon transfer (variance over mean grey value) and dark current of a real sensor, by colour plane."
        stages = (made.stage,) if made.stage else ()
        blocks += [Figure("real_sensor", sensor_figure(made), caption, stages), sensor_table(made)]
    return Section("real_noise", TITLE, (TEXT,), blocks, runs)


def _sources(parts: Sequence[Recording]) -> Table:
    import pandas as pd

    rows = pd.DataFrame(
        [
            {
                "recording": recording_word(part.name),
                "pictures": int(part.summary["pictures"].max()),
                "measured": "by its stage" if part.stage else "recorded earlier",
                "source": part.source,
            }
            for part in parts
        ]
    )
    columns = [
        Column("recording", "Recording"),
        Column("pictures", "Pictures"),
        Column("measured", "Measured"),
        Column("source", "Source", wide=True),
    ]
    return table("real_noise_sources", "Noise of real cameras: pictures with their source.", rows, columns)


def _run(inputs: ReportInputs, name: str, is_recorded: bool) -> Run:
    ran = real_noise_records.stage_has_run(inputs, name)
    line = f"dvc exp run -S real_noise.recordings.{name}.folder=/path real_noise@{name} report"
    return Run(TITLE, recording_word(name), ran, "" if ran else "data absent", line, is_recorded)
