"""The paper's claims: each sentence beside our measurement, its interval, a verdict and what a sceptic would object."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from functools import partial

from pipeline.control.order_conclusions import CONCLUSIONS
from pipeline.report.claims import of_blur, of_detection, of_noise
from pipeline.report.claims.claim import NOT_MEASURED, VERDICTS, Claim, Evidence, Measurement, descriptions
from pipeline.report.display_names import listing
from pipeline.report.inputs import ReportInputs
from pipeline.report.ledger import LedgerRow
from pipeline.report.sections.order_study import STAGE
from pipeline.report.spec import Section
from pipeline.report.tables import Column, Estimate, Row, Table, table

MEASURES = {**of_blur.MEASURES, **of_noise.MEASURES, **of_detection.MEASURES}
ORDER_STUDY = "Verdict of the detector's order in linear light, which the paper does not have."
TITLE = "Claims"
TEXT = (
    "The paper's sentences, in our words, beside our measurements. The verdict follows from intervals: a claim about "
    "many cells is supported, or contradicted, where nine cells of ten are, and contradicted too where half are and "
    "none supports; it is not decided where fewer than half of them are either. A verdict is about our pictures, "
    "estimators and detectors: the last column gives the reason why it might not be about the paper's.",
)


def all_claims() -> list[Claim]:
    """The claims of ``claims/claims.yaml``, then the conclusions that the order study decides."""
    claims = [
        Claim(measure=partial(MEASURES[entry.pop("measure")], **entry.pop("options", {})), **entry)
        for entry in descriptions()
    ]
    return claims + [
        Claim("order study", f"{one.claim}.", partial(of_detection.order, conclusion=one), ORDER_STUDY, STAGE)
        for one in CONCLUSIONS
    ]


def measurements(inputs: ReportInputs) -> list[tuple[Claim, Measurement]]:
    """Every claim with its measurement; *not measured* names the command where what it needs has not run."""
    evidence = Evidence(inputs)
    pairs = []
    for claim in all_claims():
        measured = claim.measure(evidence)
        if measured is None:
            measured = Measurement(f"Not run: {inputs.line(claim.stage)}", NOT_MEASURED)
        pairs.append((claim, measured))
    return pairs


def claims_table(pairs: Sequence[tuple[Claim, Measurement]]) -> Table:
    """The table of claims."""
    rows = [{"claim": claim, "measured": measured} for claim, measured in pairs]

    def value(row: Row) -> Estimate | None:
        one: Measurement = row["measured"]
        if math.isnan(one.value):
            return None
        ends = (one.low, one.high) if one.low < one.high else (math.nan, math.nan)
        centre, low, high = (float(f"{number:.3g}") for number in (one.value, *ends))
        return Estimate(centre, low, high)

    def measured(row: Row) -> str:
        one: Measurement = row["measured"]
        return f"{one.text} On {one.on}." if one.on else one.text

    columns = [
        Column("source", "Paper", source=lambda row: row["claim"].source),
        Column("claim", "Claim", wide=True, source=lambda row: row["claim"].sentence),
        Column("verdict", "Verdict", source=lambda row: row["measured"].verdict),
        Column("measured", "Our measurement", wide=True, source=measured),
        Column("value", "Number", source=value),
        Column("reservation", "A sceptic's reservation", wide=True, source=lambda row: row["claim"].reservation),
    ]
    notes = [
        "For and against: cells whose whole 95 % interval lies on the claimed or on the other side. Intervals are over "
        "frames (AP: over scenes); cells of one table share their frames. Number: the one that decides, with its "
        "interval where it has one."
    ]
    return table("claims", "The paper's claims beside our measurements.", rows, columns, notes)


def finding(pairs: Sequence[tuple[Claim, Measurement]]) -> str:
    """The sentence of the verdict."""
    counts = Counter(measured.verdict for _, measured in pairs)
    parts = [f"{counts[verdict]} {verdict}" for verdict in VERDICTS if counts[verdict]]
    return f"Of {len(pairs)} claims of the paper, or implied by it, {listing(parts)} (table of claims)."


def section(inputs: ReportInputs, ledger: Sequence[LedgerRow] = ()) -> Section:
    """The table of claims."""
    pairs = measurements(inputs)
    return Section("claims", TITLE, TEXT, [claims_table(pairs)], findings=[finding(pairs)])
