"""Causes of differences from the paper, row by row: what is known of both measurements, and what ours measures of it.

A cause is a difference between the two measurements that the records prove (mode and kernel size of an estimator,
training seen, number of frames), or a number: the error that remains when the MTF of the camera's sharp frames is
divided out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from pipeline.experiments.recorded import blur as blur_records
from pipeline.experiments.recorded import frames as frame_records
from pipeline.experiments.recorded.blur import BlurRecord
from pipeline.report import training_budget
from pipeline.report.display_names import counted, word
from pipeline.report.inputs import EXACT, ReportInputs, options_of
from pipeline.report.ledger.sources import COMBINED_DATASET, COMBINED_ESTIMATOR, PAPER_FRAMES, combined_estimator
from pipeline.report.tables import Row, format_number, where
from pipeline.report.tables import records as records_of

PAPER_KERNEL_PX = 25
"""Of PMP and GBB in the authors' programs (their text has 31)."""

LENS_SHARE = 0.5  # of an error that is the lens's when dividing out its MTF removes as much


def blur_amae(inputs: ReportInputs) -> Callable[[Row], str]:
    """A function from a row of Table I in the ledger to the causes of its difference, in words."""
    records, effects, of_measurement = blur_records.read(inputs.recorded), _effects(inputs), uncorrupted(inputs)

    def cause(row: Row) -> str:
        record = _record(row, records)
        return "; ".join(filter(None, [_lens(row, record), effects(row, record), of_measurement(row)]))

    return cause


def uncorrupted(inputs: ReportInputs) -> Callable[[Row], str]:
    """A function from a row of the MTF of sharp frames to the causes of its difference, in words."""
    records, percent = blur_records.read(inputs.recorded), training_budget.percents(inputs).get("mtf_cnn")

    def cause(row: Row) -> str:
        if row["estimator"] == "ground_truth":
            return "another renderer and lens than the authors' Sim"
        record = _record(row, records)
        return "; ".join([*_of_estimator(row, record, percent), _frames(row, record)])

    return cause


def combined(inputs: ReportInputs) -> Callable[[Row], str]:
    """A function from a row of blur and noise at once to the causes of its difference, in words."""
    records = frame_records.records_with(inputs.recorded, frame_records.COMBINED_FILES[0])
    causes = [f"ours is {word(COMBINED_ESTIMATOR)}, which was trained on noise, the paper's network was not"]
    if combined_estimator(inputs) == training_budget.NETWORK:
        causes = _of_training(training_budget.percents(inputs).get("mtf_cnn"))
    for record in [one for one in records if one.dataset == COMBINED_DATASET][:1]:
        causes.append(_compared_on(len(record.frames), int(record.frames["blur_patches"].sum())))
    text = "; ".join(causes)
    return lambda row: text


def _of_training(percent: float | None) -> list[str]:
    """How the training of the paper's network differs, which saw ``percent`` of the paper's samples here."""
    anew = [f"trained anew on {training_budget.in_words(percent)}"] if percent is not None and percent < 100 else []
    return [*anew, "other training pictures than the paper's photographs"]


def _compared_on(frames: int, patches: int) -> str:
    return f"{counted(patches, 'patch', 'patches')} of {counted(frames, 'frame')}, the paper's of {PAPER_FRAMES}"


def _record(row: Row, records: Sequence[BlurRecord]) -> BlurRecord | None:
    """The record that ours comes from, None where a stage made it."""
    of_dataset = (one for one in records if one.dataset == row["measured_on"])
    return next((one for one in of_dataset if one.name_of(row["estimator"]) in one.estimators), None)


def _options(row: Row, record: BlurRecord | None) -> dict[str, Any]:
    """Options that the estimator of a row was recorded with (`options_of`); empty, as unknown, without a record."""
    if record is None:
        return {}
    return options_of(record.provenance["blur"]["estimators"][record.name_of(row["estimator"])])


def _of_estimator(row: Row, record: BlurRecord | None, percent: float | None) -> list[str]:
    """How our estimator differs from the paper's of that name, which saw ``percent`` of the paper's samples."""
    options, causes = _options(row, record), []
    if options.get("mode") not in (None, "exact"):
        causes.append(f"ours in {options['mode']} mode, the paper's program as published")
    if options.get("kernel_size") not in (None, PAPER_KERNEL_PX):
        causes.append(f"kernels of {options['kernel_size']} px, the paper's {PAPER_KERNEL_PX} px")
    return [*causes, *(_of_training(percent) if row["estimator"] == training_budget.NETWORK else [])]


CHOICES = {
    "storage": "kernels stored as JPEG, as theirs of these frames",
    "boundary": "dark borders, as theirs",
    "kernel_px": "kernels of {second}, {ours}",
    "mode": "{second} mode, {ours}",
    "patches": "patches on a grid, where both use objects",
}
"""Factor -> its second setting in words, of which an effect is; ``ours``: whether it is that of our estimator."""

JPEG_FRAMES = "udacity"
"""Dataset whose frames, and so whose kernels, the authors' programs store as JPEG."""


def _effects(inputs: ReportInputs) -> Callable[[Row, BlurRecord | None], str]:
    """What each choice in which the two measurements differ does to the AMAE of a row, as the factorial measured it."""
    known: dict[tuple[Any, ...], dict[str, Row]] = {}
    for record in frame_records.records_with(inputs.recorded, frame_records.FACTOR_FILES[1]):
        for effect in records_of(record.table(frame_records.FACTOR_FILES[1])):
            key = tuple(effect[name] for name in ("estimator", "factor", "blur_kind", "kernel_size_px"))
            known.setdefault(key, {})[record.dataset] = effect

    def words(row: Row, record: BlurRecord | None) -> str:
        options = _options(row, record)
        size, mode = options.get("kernel_size", PAPER_KERNEL_PX), options.get("mode", EXACT)
        ours = {"kernel_px": f"{size} px", "mode": mode}
        applies = {
            "storage": row["dataset"] == JPEG_FRAMES,
            "boundary": True,
            "kernel_px": size != PAPER_KERNEL_PX,
            "mode": mode != EXACT,
            "patches": True,
        }
        parts: dict[str, list[str]] = {}  # by the dataset that they were measured on
        for factor, text in CHOICES.items():
            cells = known.get((row["estimator"], factor, row["blur_kind"], row["kernel_size_px"]), {})
            if cells and applies[factor]:
                on = row["dataset"] if row["dataset"] in cells else next(iter(cells))
                cell = cells[on]
                low, high = (f"{cell[name]:+.1f}" for name in ("low_percent", "high_percent"))
                setting = ours.get(factor)
                same = "as ours" if setting == cell["second"] else f"ours {setting}"
                choice = text.format(second=cell["second"], ours=same)
                parts.setdefault(on, []).append(f"{choice}: {cell['effect_percent']:+.1f} points ({low} to {high})")
        return "; ".join(f"{'; '.join(effects)}, measured on {word(on)}" for on, effects in parts.items())

    return words


def _frames(row: Row, record: BlurRecord | None) -> str:
    if record is None:
        return f"other frames than the paper's {PAPER_FRAMES}"
    return _compared_on(*record.measured_on(record.name_of(row["estimator"])))


def _lens(row: Row, record: BlurRecord | None) -> str:
    """How much of a higher error is the camera's lens, where that is most of it; empty else."""
    if record is None or not row["ours"] > row["paper"]:
        return ""
    kernel = {name: row[name] for name in ("estimator", "blur_kind", "kernel_size_px")}
    cells = where(record.summary, calibrated=True, **kernel)
    if len(cells) != 1:
        return ""
    remaining = float(cells["amae_percent"].iloc[0])
    if row["ours"] - remaining < LENS_SHARE * (row["ours"] - row["paper"]):
        return ""
    return f"the camera's lens: {format_number(remaining, 1)} % remain when the MTF of its sharp frames is divided out"
