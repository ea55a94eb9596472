"""The numbers on which a conclusion of the order study rests, in words."""

from __future__ import annotations

from pipeline.control.simulation.order_conclusions import Conclusion, StudyTables
from pipeline.report.tables import format_end, format_number


def evidence_of(study: StudyTables, conclusion: Conclusion, setting: tuple[str, str]) -> str:
    """The numbers behind `StudyTables.holds`, in words."""
    if not conclusion.cause:
        return f"{100 * study.kept(setting):.0f} % of the noise left"
    effect = study.effect(conclusion, setting)
    if effect is None:
        return "one level only"
    numbers = (format_number(effect[name], 1) for name in ("before", "after"))
    ends = (format_end(effect[name], 1) for name in ("low", "high"))
    return "{} to {} %, change {} to {} points".format(*numbers, *ends)
