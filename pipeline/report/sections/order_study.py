"""The order of photon noise and blur: both orders in both lights, and which of the paper's conclusions survive."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pipeline.report.display_names import listing
from pipeline.report.inputs import ReportInputs, optional
from pipeline.report.sections.control_tables import CONTROL
from pipeline.report.spec import Block
from pipeline.report.tables import Row, Table, estimate, format_number, records

if TYPE_CHECKING:
    import pandas as pd

STAGE = "order_study"
PAPER, DETECTOR = "paper", "detector"
ENCODED, LINEAR = "encoded", "linear"
MEASURES = {
    "amae_percent": estimate("amae_percent", "amae_low_percent", "amae_high_percent"),
    "ap_percent": estimate("ap_percent", "ap_low_percent", "ap_high_percent"),
    "sigma_dn": estimate("estimated_sigma_dn", "sigma_low_dn", "sigma_high_dn"),
}
KEPT_FRACTION = 0.8
"""Photon noise counts as softened by the blur where less than this fraction of its unblurred amount is present."""

Verdict = bool | None


def study_table(study: pd.DataFrame) -> Table:
    """Noise present and estimated, AMAE and AP under both orders and in both lights."""
    rows: dict[tuple[Any, ...], dict[str, Any]] = {}
    for row in records(study):
        key = (row["light"], row["motion_px"], row["target_sigma_dn"])
        cells = rows.setdefault(key, dict(zip(("light", "motion_px", "target_sigma_dn"), key, strict=True)))
        cells[f"present_{row['order']}"] = row["clipped_sigma_dn"]
        for name, cell in MEASURES.items():
            cells[f"{name}_{row['order']}"] = cell(row)
    return CONTROL.table("order_study", rows.values(), frames=int(study["frames"].max()))


@dataclass(frozen=True)
class Conclusion:
    """A conclusion of the paper and what the study measures of it.

    Attributes:
        claim: in words.
        cause: of the effect (``noise`` or ``motion``); empty where noise left by the blur decides.
        measure: column of the effect.
        sign: of the change that the claim states.
    """

    claim: str
    cause: str = ""
    measure: str = ""
    sign: int = 1


CONCLUSIONS = (
    Conclusion("Blur softens photon noise: less of it is present in a blurred frame"),
    Conclusion(
        "Photon noise disturbs the estimate of a blur (advice: avoid photon noise): AMAE grows with it",
        "noise",
        "amae_percent",
    ),
    Conclusion("AP falls with photon noise", "noise", "ap_percent", -1),
    Conclusion("AP falls with motion blur", "motion", "ap_percent", -1),
)
SETTINGS = ((PAPER, ENCODED), (DETECTOR, ENCODED), (PAPER, LINEAR), (DETECTOR, LINEAR))
MARKS = {True: "yes", False: "no", None: "not decided"}


@dataclass(frozen=True, eq=False)
class Study:
    """Both tables of the stage: conditions, and the effects of noise and motion with paired intervals."""

    conditions: pd.DataFrame
    effects: pd.DataFrame

    def at(self, setting: tuple[str, str]) -> pd.DataFrame:
        """Conditions of an order and a light."""
        order, light = setting
        return self.conditions[(self.conditions["order"] == order) & (self.conditions["light"] == light)]

    def kept(self, setting: tuple[str, str]) -> float:
        """Noise present under the longest motion as a fraction of that without motion, at the strongest noise."""
        rows = self.at(setting)
        rows = rows[rows["target_sigma_dn"] == rows["target_sigma_dn"].max()].sort_values("motion_px")
        return float(rows["clipped_sigma_dn"].iloc[-1] / rows["clipped_sigma_dn"].iloc[0])

    def effect(self, conclusion: Conclusion, setting: tuple[str, str]) -> Row | None:
        """The effect that decides a conclusion; None where the study has one level of its cause."""
        rows = self.effects
        for column, value in zip(
            ("order", "light", "cause", "measure"), (*setting, conclusion.cause, conclusion.measure), strict=True
        ):
            rows = rows[rows[column] == value]
        return records(rows)[0] if len(rows) else None

    def holds(self, conclusion: Conclusion, setting: tuple[str, str]) -> Verdict:
        """Whether the numbers of one order and light support a conclusion; None where they do not decide."""
        if not conclusion.cause:
            return self.kept(setting) < KEPT_FRACTION
        effect = self.effect(conclusion, setting)
        if effect is None:
            return None
        ends = sorted((conclusion.sign * effect["low"], conclusion.sign * effect["high"]))
        return True if ends[0] > 0 else False if ends[1] < 0 else None

    def evidence(self, conclusion: Conclusion, setting: tuple[str, str]) -> str:
        """The numbers behind `holds`."""
        if not conclusion.cause:
            return f"{100 * self.kept(setting):.0f} % of the noise left"
        effect = self.effect(conclusion, setting)
        if effect is None:
            return "one level only"
        numbers = (format_number(effect[name], 1) for name in ("before", "after", "low", "high"))
        return "{} to {} %, change {} to {} points".format(*numbers)

    def survival(self, conclusion: Conclusion) -> str:
        """The word of the verdict under the detector's order, in both lights."""
        detector = [self.holds(conclusion, (DETECTOR, light)) for light in (ENCODED, LINEAR)]
        if all(detector):
            return "survives"
        if any(verdict is False for verdict in detector):
            paper = self.holds(conclusion, (PAPER, ENCODED))
            return "holds in the paper's order only" if paper else "does not survive"
        return "not decided"


def conclusion_table(study: Study) -> Table:
    """The paper's conclusions under both orders and in both lights."""
    rows = []
    for conclusion in CONCLUSIONS:
        cells = {
            f"{order}_{light}": f"{MARKS[study.holds(conclusion, (order, light))]}: "
            f"{study.evidence(conclusion, (order, light))}"
            for order, light in SETTINGS
        }
        rows.append({"claim": conclusion.claim, **cells, "survival": study.survival(conclusion)})
    motion, sigma = (sorted(set(study.conditions[name])) for name in ("motion_px", "target_sigma_dn"))
    ends = {"shortest_px": motion[0], "longest_px": motion[-1], "least_dn": sigma[0], "most_dn": sigma[-1]}
    return CONTROL.table("order_study_conclusions", rows, kept_percent=100 * KEPT_FRACTION, **ends)


def finding(study: Study) -> str:
    """The sentence of the verdict."""
    by_word: dict[str, list[str]] = {}
    for conclusion in CONCLUSIONS:
        claim = conclusion.claim.split(":")[0].split(" (")[0]
        by_word.setdefault(study.survival(conclusion), []).append(f"“{claim}”")
    parts = [f"{word}: {listing(claims)}" for word, claims in by_word.items()]
    return (
        f"Order of photon noise and blur, under the detector's order and in linear light: {'; '.join(parts)}. Of the "
        f"photon noise {100 * study.kept((DETECTOR, LINEAR)):.0f} % is left behind the blur, in the paper's order "
        f"{100 * study.kept((PAPER, LINEAR)):.0f} %."
    )


def blocks(inputs: ReportInputs) -> tuple[list[Block], list[str]]:
    """Both tables and the sentence for the verdict; empty where the stage has not run."""
    folder = inputs.of_control(STAGE)
    study, effects = optional(folder, "study.parquet"), optional(folder, "effects.parquet")
    if study is None or effects is None:
        return [], []
    both = Study(study, effects)
    return [study_table(study), conclusion_table(both)], [finding(both)]
