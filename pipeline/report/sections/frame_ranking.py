"""How well estimates rank frames by blur and noise, beside the measures in common use, as a benchmark recorded it."""

from __future__ import annotations

from typing import Any

from pipeline.errors import InputError
from pipeline.report.descriptions import Descriptions
from pipeline.report.inputs import ReportInputs
from pipeline.report.spec import Run, Section
from pipeline.report.tables import Estimate

PAGE = Descriptions("frame_ranking")
COMMAND = "python benchmarks/flags.py"
TITLE = "Ranking of frames by blur and noise"
QUANTITIES = {"blur": "mtf", "noise": "sigma_dn"}
"""What is ranked -> our measure of it."""


def section(inputs: ReportInputs) -> Section | None:
    """Spearman's rank correlation with the true blur and noise (``benchmarks/results/flags.json``).

    Raises:
        InputError: the record holds something else.
    """
    content = inputs.benchmark("flags", ("results",), COMMAND)
    if content is None:
        return None
    rows: list[dict[str, Any]] = []
    try:
        for quantity, ours in QUANTITIES.items():
            for pictures, result in content["results"].items():
                measures = result.get(quantity, {})
                cells = {"ours" if name == ours else name: _cell(entry) for name, entry in measures.items()}
                counts = {name: measures[ours][name] for name in ("pictures", "scenes")} if measures else {}
                rows += [{"quantity": quantity, "dataset": pictures, **counts, **cells}] if measures else []
    except (KeyError, TypeError, AttributeError):
        raise InputError(
            f"{inputs.benchmarks['flags']}: a rank correlation is missing; make it again: {COMMAND}"
        ) from None
    return PAGE.section([PAGE.table("frame_ranking", rows)], [Run(TITLE, "", True, "", COMMAND)])


def _cell(entry: dict[str, Any]) -> Estimate:
    return Estimate(entry["spearman"], entry["low"], entry["high"])
