"""Where differences from the paper's Table I come from: each choice of the measurement switched, all else equal."""

from __future__ import annotations

from typing import Any

from pipeline.experiments.factors import ALL
from pipeline.experiments.recorded.frames import FACTOR_FILES, FrameRecord, records_with
from pipeline.report.descriptions import Descriptions
from pipeline.report.display_names import BLURS, ESTIMATORS, counted, word
from pipeline.report.inputs import ReportInputs
from pipeline.report.spec import Section
from pipeline.report.tables import Table, ordered, records

PAGE = Descriptions("factors")
FACTORS = ("kernel_px", "storage", "boundary", "patches", "mode", "discs")


def _tables(record: FrameRecord) -> list[Table]:
    """The effect of each factor: over all blurs and of each kind, then on each kernel."""
    cells = record.table(FACTOR_FILES[1])
    rows = ordered(cells, factor=FACTORS, estimator=ESTIMATORS, blur_kind=[ALL, *BLURS], kernel_size_px=())
    whole = rows["kernel_size_px"] == 0
    kinds, kernels = rows[whole], rows[~whole]
    words: dict[str, Any] = {"dataset": record.dataset, "source": record.source.rstrip(".")}
    by_kind = {"blur": lambda row: "All" if row["blur_kind"] == ALL else word(row["blur_kind"])}
    frames = counted(int(kinds["frames"].max()), "frame")
    return [
        PAGE.table("factors", kinds, cells=by_kind, frames=frames, **words),
        PAGE.table("factors_by_kernel", kernels, dataset=record.dataset),
    ]


def _fast_modes(record: FrameRecord) -> list[str]:
    """What the fast modes of the paper's programs do to their error, for the verdict."""
    cells = record.table(FACTOR_FILES[1])
    rows = cells[(cells["factor"] == "mode") & (cells["blur_kind"] == ALL)]
    kernels = " and ".join(f"{size:g} px" for size in record.provenance["settings"].get("exact_sizes_px", []))
    words = {"dataset": record.dataset, "kernels": kernels}
    return [PAGE.text("fast_mode", **row, **words) for row in records(rows.drop(columns="dataset"))]


def section(inputs: ReportInputs) -> Section | None:
    """The factorial of every dataset it was recorded on; None where it was not."""
    recorded = records_with(inputs.recorded, FACTOR_FILES[1])
    findings = [sentence for record in recorded for sentence in _fast_modes(record)]
    blocks = [table for record in recorded for table in _tables(record)]
    return PAGE.section(blocks, findings=findings) if blocks else None
