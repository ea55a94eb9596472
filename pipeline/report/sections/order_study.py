"""The order of photon noise and blur: both orders in both lights, and which of the paper's conclusions survive."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pipeline.report.display_names import listing
from pipeline.report.inputs import ReportInputs, optional
from pipeline.report.spec import Block
from pipeline.report.tables import Column, Estimate, Row, Table, estimate, records, table

if TYPE_CHECKING:
    import pandas as pd

STAGE = "order_study"
PAPER, DETECTOR = "paper", "detector"
ENCODED, LINEAR = "encoded", "linear"
ORDER_WORDS = {PAPER: "paper's order", DETECTOR: "detector's order"}
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
    columns = [
        Column("light", "Light"),
        Column("motion_px", "Motion", "px", 0),
        Column("target_sigma_dn", "Noise", "DN", 0),
    ]
    for order, word in ORDER_WORDS.items():
        columns += [
            Column(f"present_{order}", f"Present, {word}", "DN", 1),
            Column(f"sigma_dn_{order}", f"Estimated, {word}", "DN", 1),
            Column(f"amae_percent_{order}", f"AMAE, {word}", "%", 1),
            Column(f"ap_percent_{order}", f"AP, {word}", "%", 1),
        ]
    notes = [
        f"Photon noise and horizontal linear motion on {int(study['frames'].max())} frames of Sim, the same random "
        "draws in every row. Paper's order: photon noise, then blur. Detector's order: blur, then photon noise, as in "
        "a camera, where light that optics or motion have spread is still Poisson distributed at the pixel. Light: "
        "grey levels as encoded (the paper's) or decoded to linear light, corrupted and encoded again. Present: after "
        "clipping. Estimates are those of the condition monitor; AMAE is that of the system MTF (the sharp frame's "
        "estimate times the kernel's MTF); intervals are bootstrap 95 % intervals over frames (AP: over scenes).",
    ]
    caption = "Order study: photon noise before or behind the blur, in encoded and in linear light."
    return table("order_study", caption, rows.values(), columns, notes, STAGE)


@dataclass(frozen=True)
class Conclusion:
    """A conclusion of the paper and whether the study's numbers support it.

    Attributes:
        claim: in words.
        evidence: ours in one cell, from the rows of one order and light.
        holds: whether these rows support it; None where they do not decide.
    """

    claim: str
    evidence: Callable[[pd.DataFrame], str]
    holds: Callable[[pd.DataFrame], Verdict]


def _at(rows: pd.DataFrame, motion_px: float, sigma_dn: float) -> Row:
    own = rows[(rows["motion_px"] == motion_px) & (rows["target_sigma_dn"] == sigma_dn)]
    return records(own)[0]


def _ends(rows: pd.DataFrame) -> tuple[float, float, float, float]:
    """Shortest and longest motion, least and strongest noise."""
    motion, sigma = rows["motion_px"], rows["target_sigma_dn"]
    return float(motion.min()), float(motion.max()), float(sigma.min()), float(sigma.max())


def _kept(rows: pd.DataFrame) -> float:
    """Noise present under the longest motion as a fraction of that without motion, at the strongest noise."""
    still, longest, _, strongest = _ends(rows)
    unblurred = _at(rows, still, strongest)["clipped_sigma_dn"]
    return float(_at(rows, longest, strongest)["clipped_sigma_dn"] / unblurred)


def _rise(rows: pd.DataFrame, name: str, motion: bool) -> tuple[Estimate, Estimate]:
    """A measure at the least and at the greatest noise (under the longest motion), or motion (at the least noise)."""
    still, longest, least, strongest = _ends(rows)
    first, last = (_at(rows, still, least), _at(rows, longest, least)) if motion else (
        _at(rows, longest, least), _at(rows, longest, strongest))  # fmt: skip
    before, after = MEASURES[name](first), MEASURES[name](last)
    assert isinstance(before, Estimate) and isinstance(after, Estimate)
    return before, after


def _grows(before: Estimate, after: Estimate) -> Verdict:
    """Whether a value grows beyond both intervals; None where the intervals overlap or there is one value only."""
    if after.low > before.high:
        return True
    return False if after.value < before.value else None


def _falls(before: Estimate, after: Estimate) -> Verdict:
    if after.high < before.low:
        return True
    return False if after.value > before.value else None


def _change(name: str, motion: bool) -> Callable[[pd.DataFrame], str]:
    def evidence(rows: pd.DataFrame) -> str:
        before, after = _rise(rows, name, motion)
        return f"{before.value:.1f} to {after.value:.1f} %"

    return evidence


CONCLUSIONS = (
    Conclusion(
        "Blur softens photon noise: less of it is present and estimated in a blurred frame",
        lambda rows: f"{100 * _kept(rows):.0f} % of the noise left",
        lambda rows: _kept(rows) < KEPT_FRACTION,
    ),
    Conclusion(
        "Photon noise disturbs the estimate of a blur (advice: avoid photon noise): AMAE grows with it",
        _change("amae_percent", motion=False),
        lambda rows: _grows(*_rise(rows, "amae_percent", motion=False)),
    ),
    Conclusion(
        "AP falls with photon noise",
        _change("ap_percent", motion=False),
        lambda rows: _falls(*_rise(rows, "ap_percent", motion=False)),
    ),
    Conclusion(
        "AP falls with motion blur",
        _change("ap_percent", motion=True),
        lambda rows: _falls(*_rise(rows, "ap_percent", motion=True)),
    ),
)
SETTINGS = ((PAPER, ENCODED), (DETECTOR, ENCODED), (PAPER, LINEAR), (DETECTOR, LINEAR))


def _rows(study: pd.DataFrame, order: str, light: str) -> pd.DataFrame:
    return study[(study["order"] == order) & (study["light"] == light)]


def survival(conclusion: Conclusion, study: pd.DataFrame) -> str:
    """Which settings support a conclusion: the word of the verdict."""
    held = {setting: conclusion.holds(_rows(study, *setting)) for setting in SETTINGS}
    detector = [held[DETECTOR, ENCODED], held[DETECTOR, LINEAR]]
    if all(detector):
        return "survives"
    if any(verdict is False for verdict in detector):
        return "holds in the paper's order only" if held[PAPER, ENCODED] else "does not survive"
    return "not decided"


def conclusion_table(study: pd.DataFrame) -> Table:
    """The paper's conclusions under both orders and in both lights."""
    marks = {True: "yes", False: "no", None: "not decided"}
    rows = []
    for conclusion in CONCLUSIONS:
        cells = {
            f"{order}_{light}": f"{marks[conclusion.holds(own)]}: {conclusion.evidence(own)}"
            for order, light in SETTINGS
            if len(own := _rows(study, order, light))
        }
        rows.append({"claim": conclusion.claim, **cells, "survival": survival(conclusion, study)})
    columns = [
        Column("claim", "Conclusion of the paper", wide=True),
        *(
            Column(f"{order}_{light}", f"{ORDER_WORDS[order].capitalize()}, {light} light", wide=True)
            for order, light in SETTINGS
        ),
        Column("survival", "Under the detector's order and in linear light"),
    ]
    still, longest, least, strongest = _ends(study)
    notes = [
        f"Noise left: present at {strongest:g} DN under {longest:g} px of motion against no motion; softened where "
        f"less than {100 * KEPT_FRACTION:.0f} % are left. Effects of noise: {least:g} to {strongest:g} DN under "
        f"{longest:g} px; of motion: {still:g} to {longest:g} px at {least:g} DN. Yes: beyond both 95 % intervals; not "
        "decided: in that direction, but the intervals overlap.",
    ]
    return table("order_study_conclusions", "Order study: which conclusions survive.", rows, columns, notes, STAGE)


def finding(study: pd.DataFrame) -> str:
    """The sentence of the verdict."""
    by_word: dict[str, list[str]] = {}
    for conclusion in CONCLUSIONS:
        claim = conclusion.claim.split(":")[0].split(" (")[0]
        by_word.setdefault(survival(conclusion, study), []).append(f"“{claim}”")
    parts = [f"{word}: {listing(claims)}" for word, claims in by_word.items()]
    _, longest, _, strongest = _ends(study)
    amae = {order: _at(_rows(study, order, LINEAR), longest, strongest)["amae_percent"] for order in (PAPER, DETECTOR)}
    return (
        "Order of photon noise and blur, under the detector's order and in linear light: "
        f"{'; '.join(parts)}. At {strongest:g} DN and {longest:g} px the blur estimate is "
        f"{amae[DETECTOR]:.1f} % off in the detector's order against {amae[PAPER]:.1f} % in the paper's."
    )


def blocks(inputs: ReportInputs) -> tuple[list[Block], list[str]]:
    """Both tables and the sentence for the verdict; empty where the stage has not run."""
    study = optional(None if inputs.control is None else inputs.control / STAGE, "study.parquet")
    if study is None:
        return [], []
    return [study_table(study), conclusion_table(study)], [finding(study)]
