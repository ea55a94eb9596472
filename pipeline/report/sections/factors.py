"""Where differences from the paper's Table I come from: each choice of the measurement switched, all else equal."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.experiments.factors import ALL
from pipeline.report.descriptions import Cells, Descriptions
from pipeline.report.display_names import BLURS, ESTIMATORS, counted, word
from pipeline.report.frame_records import FACTOR_FILES, FrameRecord, records_with
from pipeline.report.inputs import ReportInputs
from pipeline.report.ledger import LedgerRow
from pipeline.report.spec import Block, Section
from pipeline.report.tables import Table, ordered

TITLE = "Factors behind Table I"
PAGE = Descriptions("factors")
FACTORS = {
    "kernel_px": "Size of the kernel",
    "storage": "Kernels stored",
    "boundary": "Beyond the frame",
    "patches": "Patches",
    "mode": "Mode",
    "discs": "Discs",
}


COLUMNS: Cells = {
    "factor": lambda row: FACTORS[row["factor"]],
    "switch": lambda row: f"{row['first']}, {row['second']}",
}


def effects(record: FrameRecord) -> Table:
    """The effect of each factor: over all blurs, and of each kind.

    Args:
        record: with the factorial's tables.
    """
    cells = record.table(FACTOR_FILES[1])
    cells = cells[cells["kernel_size_px"] == 0]
    rows = ordered(cells, factor=FACTORS, estimator=ESTIMATORS, blur_kind=[ALL, *BLURS])
    frames, source = counted(int(cells["frames"].max()), "frame"), record.source.rstrip(".")
    made: Cells = {**COLUMNS, "blur": lambda row: "All" if row["blur_kind"] == ALL else word(row["blur_kind"])}
    return PAGE.table("factors", rows, cells=made, dataset=record.dataset, frames=frames, source=source)


def by_kernel(record: FrameRecord) -> Table:
    """The effect of each factor on each kernel.

    Args:
        record: with the factorial's tables.
    """
    cells = record.table(FACTOR_FILES[1])
    rows = ordered(
        cells[cells["kernel_size_px"] > 0], factor=FACTORS, estimator=ESTIMATORS, blur_kind=BLURS, kernel_size_px=()
    )
    made: Cells = {**COLUMNS, "blur": lambda row: f"{word(row['blur_kind'])}, {row['kernel_size_px']:g} px"}
    return PAGE.table("factors_by_kernel", rows, cells=made, dataset=record.dataset)


def section(inputs: ReportInputs, ledger: Sequence[LedgerRow] = ()) -> Section | None:
    """The factorial of every dataset it was recorded on; None where it was not."""
    blocks: list[Block] = []
    findings: list[str] = []
    for record in records_with(inputs, FACTOR_FILES[1]):
        blocks += [effects(record), by_kernel(record)]
        findings += _fast_modes(record)
    return Section("factors", TITLE, (PAGE.text("introduction"),), blocks, findings=findings) if blocks else None


def _fast_modes(record: FrameRecord) -> list[str]:
    """What the fast modes of the paper's programs do to their error, for the verdict."""
    cells = record.table(FACTOR_FILES[1])
    rows = cells[(cells["factor"] == "mode") & (cells["blur_kind"] == ALL)]
    sizes = record.provenance["settings"].get("exact_sizes_px", [])
    kernels = " and ".join(f"{size:g} px" for size in sizes)
    return [
        f"The error of {word(row['estimator'])} in fast mode differs by {row['effect_percent']:+.1f} points "
        f"({row['low_percent']:+.1f} to {row['high_percent']:+.1f}) from that of the paper's program, on kernels of "
        f"{kernels} ({word(record.dataset)}, recorded): rows of its fast mode are no reproduction of the paper's."
        for row in rows.to_dict("records")
    ]
