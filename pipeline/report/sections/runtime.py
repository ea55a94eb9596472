"""The section of run times on declared hardware, if they were measured."""

from __future__ import annotations

from pipeline.report.inputs import ReportInputs, any_table, existing, records
from pipeline.report.sections.base import NotRun, Run, Section
from pipeline.report.tables import Column, Table


def section(inputs: ReportInputs) -> Section:
    """Run times as measured; the paper's stand in the ledger, not comparable across hardware."""
    path = existing(inputs.runtime)
    line = inputs.line("runtime")
    if path is None:
        runs = [Run("Run times", "", False, "stage absent", line)]
        return Section("runtime", "Run times", (), [NotRun("Run times", "stage absent", line)], runs)
    table = any_table(path)
    columns = [Column(str(name), str(name).replace("_", " ")) for name in table.columns]
    shown = Table("runtime", "Run times on the hardware named in the table.", columns, records(table), (), "runtime")
    return Section("runtime", "Run times", (), [shown], [Run("Run times", "", True, "", line)])
