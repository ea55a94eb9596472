"""The order of photon noise and blur: both orders in both lights, and which of the paper's conclusions survive."""

from __future__ import annotations

import pandas as pd

from pipeline.control.simulation import order_conclusions
from pipeline.control.simulation.order_conclusions import CONCLUSIONS, SETTINGS, StudyTables
from pipeline.report.display_names import listing
from pipeline.report.inputs import ReportInputs
from pipeline.report.order_evidence import evidence_of
from pipeline.report.sections.closed_loop import CONTROL
from pipeline.report.spec import Block
from pipeline.report.tables import Table

STAGE = "order_study"
MARKS = {True: "yes", False: "no", None: "not decided"}


def study_table(study: pd.DataFrame) -> Table:
    """Noise present and estimated, AMAE and AP under both orders and in both lights."""
    wide = study.pivot(index=["light", "motion_px", "target_sigma_dn"], columns="order")
    wide.columns = ["_".join(names) for names in wide.columns]
    return CONTROL.table("order_study", wide.reset_index(), frames=int(study["frames"].max()))


def conclusion_table(study: StudyTables) -> Table:
    """The paper's conclusions under both orders and in both lights."""
    rows = []
    for conclusion in CONCLUSIONS:
        cells = {
            f"{order}_{light}": f"{MARKS[study.holds(conclusion, (order, light))]}: "
            f"{evidence_of(study, conclusion, (order, light))}"
            for order, light in SETTINGS
        }
        rows.append({"claim": conclusion.claim, **cells, "survival": study.survival(conclusion)})
    motion, sigma = (sorted(set(study.conditions[name])) for name in ("motion_px", "target_sigma_dn"))
    moving = listing(f"{px:g}" for px in motion if px > motion[0] or len(motion) == 1)
    ends = {"shortest_px": motion[0], "longest_px": motion[-1], "least_dn": sigma[0], "most_dn": sigma[-1]}
    kept_percent = 100 * order_conclusions.KEPT_FRACTION
    return CONTROL.table("order_study_conclusions", rows, kept_percent=kept_percent, moving=moving, **ends)


def finding(study: StudyTables) -> str:
    """The sentence of the verdict."""
    by_word: dict[str, list[str]] = {}
    for conclusion in CONCLUSIONS:
        claim = conclusion.claim.split(":")[0].split(" (")[0]
        by_word.setdefault(study.survival(conclusion), []).append(f"“{claim}”")
    parts = [f"{word}: {listing(claims)}" for word, claims in by_word.items()]
    kept = {order: 100 * study.kept((order, order_conclusions.LINEAR)) for order in ("detector", "paper")}
    return CONTROL.text("order_of_noise_and_blur", parts="; ".join(parts), **kept)


def blocks(inputs: ReportInputs) -> tuple[list[Block], list[str]]:
    """Both tables and the sentence for the verdict; empty where the stage has not run."""
    study, effects = (inputs.read(f"{STAGE}/{name}.parquet") for name in ("study", "effects"))
    if study is None or effects is None:
        return [], []
    both = StudyTables(study, effects)
    return [study_table(study), conclusion_table(both)], [finding(both)]
