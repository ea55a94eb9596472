"""The paper's claims: each sentence beside our measurement, its interval, a verdict and what a sceptic would object."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from functools import partial

from pipeline.control.simulation.order_conclusions import CONCLUSIONS
from pipeline.report import training_budget
from pipeline.report.claims import descriptions, of_blur, of_detection, of_noise
from pipeline.report.claims.claim import NOT_MEASURED, VERDICTS, Claim, Evidence, Measurement
from pipeline.report.descriptions import Descriptions
from pipeline.report.display_names import listing, qualified
from pipeline.report.inputs import ReportInputs
from pipeline.report.sections.order_study import STAGE
from pipeline.report.spec import Section
from pipeline.report.tables import Estimate, Table

MEASURES = {**of_blur.MEASURES, **of_noise.MEASURES, **of_detection.MEASURES}
PAGE = Descriptions("claims")


def all_claims() -> list[Claim]:
    """The claims of ``claims/claims.yaml``, then the conclusions that the order study decides."""
    claims = []
    for entry in descriptions():
        name = entry.pop("measure")
        measure = partial(MEASURES[name], **entry.pop("options", {}))
        claims.append(Claim(measure=measure, tasks=(of_noise.TASKS.get(name, "blur"),), **entry))
    reservation = PAGE.text("order_study")
    return claims + [
        Claim("order study", f"{one.claim}.", partial(of_detection.order, conclusion=one), reservation, STAGE)
        for one in CONCLUSIONS
    ]


def measurements(inputs: ReportInputs) -> list[tuple[Claim, Measurement]]:
    """Every claim with its measurement; *not measured* names the command where what it needs has not run."""
    evidence, stated = Evidence(inputs), all_claims()
    names = {tasks: training_budget.names(inputs, *tasks) for tasks in {claim.tasks for claim in stated}}
    pairs = []
    for claim in stated:
        with qualified(names[claim.tasks]):
            measured = claim.measure(evidence)
        if measured is None:
            measured = Measurement(f"Not run: {claim.command or inputs.line(claim.stage)}", NOT_MEASURED)
        pairs.append((claim, measured))
    return pairs


def _number(one: Measurement) -> Estimate | None:
    """The number that decides, with its interval where it has one."""
    if math.isnan(one.value):
        return None
    ends = (one.low, one.high) if one.low < one.high else (math.nan, math.nan)
    centre, low, high = (float(f"{number:.3g}") for number in (one.value, *ends))
    return Estimate(centre, low, high)


def claims_table(pairs: Sequence[tuple[Claim, Measurement]]) -> Table:
    """The table of claims."""
    rows = [
        {"source": claim.source, "claim": claim.sentence, "verdict": one.verdict, "value": _number(one),
         "measured": f"{one.text} On {one.on}." if one.on else one.text, "reservation": claim.reservation}
        for claim, one in pairs
    ]  # fmt: skip
    return PAGE.table("claims", rows)


def finding(pairs: Sequence[tuple[Claim, Measurement]]) -> str:
    """The sentence of the verdict."""
    counts = Counter(measured.verdict for _, measured in pairs)
    parts = [f"{counts[verdict]} {verdict}" for verdict in VERDICTS if counts[verdict]]
    return f"Of {len(pairs)} claims of the paper, or implied by it, {listing(parts)} (table of claims)."


def section(inputs: ReportInputs) -> Section:
    """The table of claims."""
    pairs = measurements(inputs)
    return PAGE.section([claims_table(pairs)], findings=[finding(pairs)])
