"""Control: the paper's worked examples, the surface that controllers ask, the closed loop, and the order study."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.report.control_results import decision_ms, scenario_results, scenario_word
from pipeline.report.inputs import ReportInputs
from pipeline.report.ledger import LedgerRow
from pipeline.report.sections import (
    control_examples,
    control_films,
    control_surface,
    control_tables,
    order_study,
)
from pipeline.report.sections.published import beside_ours
from pipeline.report.spec import STAGE_ABSENT, Block, NotRun, Run, Section, single

PUBLISHED = ("worked_examples", "controller_ap", "controller_response")


def section(inputs: ReportInputs, ledger: Sequence[LedgerRow] = ()) -> Section:
    """Everything on control that has run, and the commands for the rest."""
    blocks: list[Block] = []
    findings: list[str] = []
    runs: list[Run] = []
    for title, stage, part in (
        ("Worked examples of control", control_examples.STAGE, control_examples.blocks),
        ("Surface for control", control_surface.STAGE, control_surface.blocks),
    ):
        shown, sentences = part(inputs)
        blocks, findings = [*blocks, *shown], [*findings, *sentences]
        runs.append(single(title, stage, bool(shown), inputs))
    results = scenario_results(inputs)
    if results:
        blocks += [
            control_tables.overview(results),
            control_tables.pairs(results),
            *(table for table in [control_tables.losses(results)] if table.rows),
            control_tables.measures(results, decision_ms(inputs)),
            *control_films.figures(results),
        ]
        findings += control_tables.findings(results)
    runs += _scenario_runs(inputs, {one.name for one in results})
    shown, sentences = order_study.blocks(inputs)
    blocks, findings = [*blocks, *shown], [*findings, *sentences]
    runs.append(single("Order of photon noise and blur", order_study.STAGE, bool(shown), inputs))
    blocks += [NotRun(run.experiment, run.why, run.line) for run in runs if not run.ran]
    beside, published_runs = beside_ours(PUBLISHED, ledger, inputs)
    text = [control_tables.CONTROL.text("introduction")]
    return Section("control", "Camera control", text, [*blocks, *beside], [*runs, *published_runs], findings)


def _scenario_runs(inputs: ReportInputs, ran: set[str]) -> list[Run]:
    """One line of the overview for all scenarios, and one for each that did not run where others did."""
    scenarios = inputs.folders("closed_loop")
    missing = [name for name in scenarios if name not in ran] if ran else []
    partly = f"{len(ran)} of {len(scenarios)} scenarios" if missing else ""
    line = inputs.line("closed_loop")
    return [Run("Closed loop", "", bool(ran), partly if ran else STAGE_ABSENT, line)] + [
        Run(f"Closed loop: {scenario_word(name)}", "", False, STAGE_ABSENT, inputs.line(f"closed_loop@{name}"))
        for name in missing
    ]
