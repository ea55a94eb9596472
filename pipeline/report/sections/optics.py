"""The section of the optics: the bank of blur kernels, and the sharpness of Sim by its Siemens star."""

from __future__ import annotations

from pipeline import tables
from pipeline.errors import InputError
from pipeline.report import kernel_sheet, star_figure
from pipeline.report.inputs import ReportInputs, any_table, existing, optional_arrays, optional_table, records
from pipeline.report.ledger_sources import sharp_mtf, star_curve
from pipeline.report.sections.base import Block, NotRun, Run, Section, ShownFigure
from pipeline.report.tables import Cell, Column, Table

BANK_STAGE, STAR_STAGE = "psf_bank", "star"
SOURCES = {"generated": "generated here", "paper": "the paper's own"}


def _bank(inputs: ReportInputs) -> list[Block]:
    table = optional_table(inputs.psf, "kernels.parquet", tables.KERNELS)
    if table is None:
        return [NotRun("Bank of blur kernels", "stage absent", inputs.line(BANK_STAGE))]
    kernels = optional_arrays(inputs.psf, "kernels.npz")
    blocks: list[Block] = []
    for source in sorted(set(table["source"])):
        caption = (
            f"Blur kernels, {SOURCES.get(source, source)}. Each with its MTF beneath, horizontal (solid) and vertical "
            "(dashed), at the paper's eight frequencies."
        )
        blocks.append(
            ShownFigure(f"kernels_{source}", kernel_sheet.draw(table, kernels, source), caption, (BANK_STAGE,))
        )
    return blocks


def _star(inputs: ReportInputs) -> list[Block]:
    curves = star_curve(inputs)
    if curves is None:
        return [NotRun("Siemens star of Sim", "stage absent", inputs.line(STAR_STAGE))]
    arrays = optional_arrays(inputs.star, "star.npz")
    if "image" not in arrays:
        raise InputError(f"{inputs.star}/star.npz: expected an array 'image'; run the stage again")
    path = inputs.paper / "uncorrupted_mtf.csv"
    published = None
    if path.exists():
        paper = any_table(path)
        published = paper[(paper["dataset"] == "sim") & (paper["estimator"] == "ground_truth")]
    drawing = star_figure.draw(arrays["image"], curves["frequency"], curves["measured"], curves["formula"], published)
    caption = (
        "Sharpness of Sim. A Siemens star rendered through the same rays as the frames, and its MTF: measured, by the "
        "formula of sampling and lens, and as the paper states it for its own Sim."
    )
    own = sharp_mtf(inputs)
    theirs = {} if published is None else dict(zip(published["frequency"], published["mtf"], strict=True))
    rows: list[dict[str, Cell]] = [
        {"frequency": row["frequency"], "ours": row["mtf"], "paper": theirs.get(row["frequency"])}
        for row in (records(own) if own is not None else [])
    ]
    columns = [
        Column("frequency", "Frequency", "fraction of Nyquist", 2),
        Column("ours", "Ours, measured", "", 3),
        Column("paper", "Paper", "", 2),
    ]
    notes = ("Ours is interpolated linearly at the paper's frequencies.",)
    table = Table("sim_sharpness", "MTF of uncorrupted Sim frames.", columns, rows, notes, STAR_STAGE)
    return [ShownFigure("sim_star", drawing, caption, (STAR_STAGE,)), table]


def section(inputs: ReportInputs) -> Section:
    """Optics: kernels and star."""
    bank_ran = existing(inputs.psf) is not None
    star_ran = existing(inputs.star) is not None
    why = "stage absent"
    runs = [
        Run("Blur kernels", "", bank_ran, "" if bank_ran else why, inputs.line(BANK_STAGE)),
        Run("Siemens star", "sim", star_ran, "" if star_ran else why, inputs.line(STAR_STAGE)),
    ]
    return Section("optics", "Optics: blur kernels and sharpness", (), [*_bank(inputs), *_star(inputs)], runs)
