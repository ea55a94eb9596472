"""Where differences from the paper's Table I come from: each choice of the measurement switched, all else equal."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.experiments.factors import ALL
from pipeline.report.display_names import BLURS, ESTIMATORS, counted, word
from pipeline.report.frame_records import FACTOR_FILES, FrameRecord, records_with
from pipeline.report.inputs import ReportInputs
from pipeline.report.ledger import LedgerRow
from pipeline.report.spec import Block, Section
from pipeline.report.tables import Column, Row, Table, estimate, named, ordered, table

TITLE = "Factors behind Table I"
TEXT = (
    "The paper's measurement and ours differ in choices that are no property of an estimator. Each is switched here, "
    "all else equal, on recorded frames of one dataset: a full factorial of kernel size, storage of kernels, boundary "
    "and patches for PMP and GBB in fast mode; exact against fast mode on some kernels; for the network the boundary, "
    "the patches, and discs that it was trained on against discs of the same area that it has not seen as such. An "
    "effect is a difference of AMAE in percentage points, its interval from resampled frames."
)
FACTORS = {
    "kernel_px": "Size of the kernel",
    "storage": "Kernels stored",
    "boundary": "Beyond the frame",
    "patches": "Patches",
    "mode": "Mode",
    "discs": "Discs",
}


def effects(record: FrameRecord) -> Table:
    """The effect of each factor: over all blurs, and of each kind.

    Args:
        record: with the factorial's tables.
    """
    cells = record.table(FACTOR_FILES[1])
    cells = cells[cells["kernel_size_px"] == 0]
    rows = ordered(cells, factor=FACTORS, estimator=ESTIMATORS, blur_kind=[ALL, *BLURS])
    columns = _columns(lambda row: "All" if row["blur_kind"] == ALL else word(row["blur_kind"]))
    frames = counted(int(cells["frames"].max()), "frame")
    notes = [
        f"{frames} of {word(record.dataset)}, {record.source.rstrip('.')}. Mean AMAE over kernels, rotations and all "
        "combinations of the other factors. The authors' programs store the kernels of JPEG frames as JPEG (Udacity), "
        "those of other frames without loss."
    ]
    caption = f"Effect of each choice of the measurement on the AMAE, on {word(record.dataset)} (recorded)."
    return table(f"factors_{record.dataset}", caption, rows, columns, notes)


def by_kernel(record: FrameRecord) -> Table:
    """The effect of each factor on each kernel.

    Args:
        record: with the factorial's tables.
    """
    cells = record.table(FACTOR_FILES[1])
    cells = cells[cells["kernel_size_px"] > 0]
    rows = ordered(cells, factor=FACTORS, estimator=ESTIMATORS, blur_kind=BLURS, kernel_size_px=())
    columns = _columns(lambda row: f"{word(row['blur_kind'])}, {row['kernel_size_px']:g} px")
    caption = f"The same by kernel, on {word(record.dataset)} (recorded)."
    return table(f"factors_by_kernel_{record.dataset}", caption, rows, columns)


def _columns(blur: object) -> list[Column]:
    assert callable(blur)
    noise_source = estimate("effect_percent", "low_percent", "high_percent", "patches")
    return [
        Column("factor", "Choice", source=lambda row: FACTORS[row["factor"]]),
        named("estimator", "Estimator"),
        Column("switch", "From, to", source=_switch),
        Column("blur", "Blur", source=blur),
        Column("first_percent", "AMAE from", "%", 1),
        Column("second_percent", "AMAE to", "%", 1),
        Column("noise_source", "Effect", "points", 1, noise_source),
    ]


def _switch(row: Row) -> str:
    return f"{row['first']}, {row['second']}"


def section(inputs: ReportInputs, ledger: Sequence[LedgerRow] = ()) -> Section | None:
    """The factorial of every dataset it was recorded on; None where it was not."""
    blocks: list[Block] = []
    for record in records_with(inputs, FACTOR_FILES[1]):
        blocks += [effects(record), by_kernel(record)]
    return Section("factors", TITLE, (TEXT,), blocks) if blocks else None
