"""The paper's published numbers beside ours, item by item, as part of a section."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.report.display_names import counted
from pipeline.report.inputs import ReportInputs
from pipeline.report.ledger import NOT_RUN, to_table
from pipeline.report.ledger_items import ITEMS, rows_of
from pipeline.report.spec import STAGE_ABSENT, Block, NotRun, Run


def beside_ours(names: Sequence[str], inputs: ReportInputs) -> tuple[list[Block], list[Run]]:
    """Of each ledger item ours beside the paper's as a table, a note on what did not run, its line of the overview."""
    items = {item.name: item for item in ITEMS}
    blocks: list[Block] = []
    runs: list[Run] = []
    for item in (items[name] for name in names):
        rows = rows_of(item, inputs)
        done, missing = ([row for row in rows if (row.verdict == NOT_RUN) == absent] for absent in (False, True))
        why, line = STAGE_ABSENT, inputs.line(item.stage.replace("{", "<").replace("}", ">"))
        if missing and missing[0].why:  # of all, the first stands for the item
            why, line = missing[0].why, missing[0].line or line
        if done:
            blocks.append(to_table(done, f"published_{item.name}", f"{item.title}: the paper's numbers beside ours."))
        if missing:
            blocks.append(NotRun(f"{item.title} ({counted(len(missing), 'published number')})", why, line))
        partly = f"{len(done):,} of {len(rows):,} numbers" if done and missing else ""
        measured_on = {row.dataset for row in done if row.dataset}
        recorded = bool(measured_on) and measured_on <= set(inputs.absent)  # data that no stage had
        runs.append(Run(item.title, "", bool(done) and not recorded, partly or ("" if done else why), line, recorded))
    return blocks, runs
