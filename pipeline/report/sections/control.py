"""Camera control: the paper's worked examples, response and AP of its controllers."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.report.inputs import ReportInputs
from pipeline.report.ledger import LedgerRow
from pipeline.report.sections.published import beside_ours
from pipeline.report.spec import Section


def section(inputs: ReportInputs, ledger: Sequence[LedgerRow] = ()) -> Section:
    """The paper's numbers, and the commands that would produce ours."""
    blocks, runs = beside_ours(("worked_examples", "controller_ap", "controller_response"), ledger, inputs)
    return Section("control", "Camera control", (), blocks, runs)
