"""Control: the paper's worked examples, the surface that controllers ask, the closed loop, and the order study."""

from __future__ import annotations

from pipeline.report.inputs import ReportInputs
from pipeline.report.sections import closed_loop, control_examples, control_surface, order_study
from pipeline.report.sections.closed_loop import scenario_word
from pipeline.report.sections.published import beside_ours
from pipeline.report.spec import STAGE_ABSENT, Block, NotRun, Run, Section, single


def section(inputs: ReportInputs) -> Section:
    """Everything on control that has run, and the commands for the rest."""
    (examples, of_examples), surface = control_examples.blocks(inputs), control_surface.blocks(inputs)
    results, (study, of_study) = closed_loop.scenario_results(inputs), order_study.blocks(inputs)
    loop: list[Block] = []
    if results:
        loop += [closed_loop.overview(results), closed_loop.pairs(results)]
        loop += [table for table in [closed_loop.losses(results)] if table.rows]
        loop += [closed_loop.measures(results, closed_loop.decision_ms(inputs)), *closed_loop.films(results)]
    runs = [
        single("Worked examples of control", control_examples.STAGE, bool(examples), inputs),
        single("Surface for control", control_surface.STAGE, bool(surface), inputs),
        *_scenario_runs(inputs, {one.name for one in results}),
        single("Order of photon noise and blur", order_study.STAGE, bool(study), inputs),
    ]
    absent = [NotRun(run.experiment, run.why, run.line) for run in runs if not run.ran]
    beside, published_runs = beside_ours(("worked_examples", "controller_ap", "controller_response"), inputs)
    blocks = [*examples, *surface, *loop, *study, *absent, *beside]
    findings = [*of_examples, *closed_loop.findings(results), *of_study]
    text = [closed_loop.CONTROL.text("introduction")]
    return Section("control", "Camera control", text, blocks, [*runs, *published_runs], findings)


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
