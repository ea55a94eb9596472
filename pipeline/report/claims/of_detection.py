"""Claims on detection under blur and noise, on camera control, and on the order of photon noise and blur."""

from __future__ import annotations

import pandas as pd

from pipeline.control.order_conclusions import DETECTOR, ENCODED, LINEAR, PAPER, Conclusion, Study
from pipeline.control.scenario_result import OURS
from pipeline.report.claims import claim
from pipeline.report.claims.claim import ENDS, Evidence, Measurement
from pipeline.report.display_names import word
from pipeline.report.inputs import published_table
from pipeline.report.sections import order_study
from pipeline.report.sections.closed_loop import scenario_results
from pipeline.report.tables import records, where

BUILT_IN = ("prosilica", "mean_intensity")
DIRECTION_POINTS = 5.0
"""Difference of AP between directions of blur from which the direction matters."""


def _falls(evidence: Evidence, *, cause: str) -> Measurement | None:
    """That AP falls with the strongest noise or the longest blur, the other absent."""
    if evidence.sweeps.empty:
        return None
    column, other = ("target_sigma_dn", "kernel_size_px") if cause == "noise" else ("kernel_size_px", "target_sigma_dn")
    rows = where(evidence.sweeps, **{other: 0})
    clean, worst = where(rows, **{column: 0}), rows[rows[column] == rows.groupby("sweep")[column].transform("max")]
    before, after = (of["ap_percent"].groupby("sweep").mean().mean() for of in (clean, worst))
    text = f"Mean AP {before:.0f} to {after:.0f} %."
    return claim.of_cells(claim.lower(worst, clean), "condition", worst["measured_on"], text)


def _both_cost_more(evidence: Evidence) -> Measurement | None:
    rows = evidence.sweeps
    if rows.empty:
        return None
    size, level = (rows.groupby("sweep")[name].transform("max") for name in ("kernel_size_px", "target_sigma_dn"))
    longest, strongest = rows["kernel_size_px"] == size, rows["target_sigma_dn"] == level
    noisy = rows[strongest & (rows["kernel_size_px"] == 0)]
    both, blurred = (
        rows[longest & noise].set_index("angle_deg", append=True) for noise in (strongest, rows["target_sigma_dn"] == 0)
    )
    either = blurred[[*ENDS]].join(noisy[[*ENDS]], rsuffix="_of_noise")
    lowest = pd.DataFrame({end: either[[end, f"{end}_of_noise"]].min(axis=1) for end in ENDS})
    return claim.of_cells(claim.lower(both, lowest), "direction", both["measured_on"])


def _not_monotonic(evidence: Evidence) -> Measurement | None:
    surfaces = [
        (one.dataset, group)
        for one in evidence.detection
        for _, group in one.heat[one.heat["count"] > 0].groupby("label")
    ]
    certain = pd.DataFrame({"supports": [group["certainly"].any() for _, group in surfaces], "opposes": False})
    rises, certainly, bins = (
        sum(int(of(group)) for _, group in surfaces)
        for of in (lambda group: group["non_monotonic"].sum(), lambda group: group["certainly"].sum(), len)
    )
    text = f"{rises} of {bins} bins exceed a milder neighbour, {certainly} certainly, corrected for their number."
    return claim.of_cells(certain, "surface", [dataset for dataset, _ in surfaces], text)


def _direction_matters(evidence: Evidence) -> Measurement | None:
    """At the longest blur, which is chosen beforehand: the largest spread of many lengths is large by chance."""
    paper = published_table(evidence.inputs.paper / "yolov7_direction_ap.csv")
    quiet = paper[paper["sigma_dn"] == 0].groupby("kernel_size_px")["ap_percent"]
    theirs = float((quiet.max() - quiet.min()).max())
    parts = [
        where(one.spread, target_sigma_dn=0, kernel_size_px=one.spread["kernel_size_px"].max()).assign(on=one.dataset)
        for one in evidence.detection
        if one.spread is not None and len(one.spread)
    ]
    if not parts:
        return None
    rows = pd.concat(parts, ignore_index=True)
    rows = rows.assign(supports=rows["low_percent"] > DIRECTION_POINTS, opposes=rows["high_percent"] < DIRECTION_POINTS)
    least, most = rows["spread_percent"].min(), rows["spread_percent"].max()
    text = (
        f"Best less worst direction without noise, at the longest blur: {least:.0f} to {most:.0f} points; in the "
        f"paper's table up to {theirs:.0f}."
    )
    return claim.of_cells(rows, "detector-class pair", rows["on"], text)


def _regression(evidence: Evidence) -> Measurement | None:
    published = published_table(evidence.inputs.paper / "regression_coefficients.csv")
    bound = float(published.loc[published["parameter"] == "r2", "value"].min())
    every = [(one.dataset, fit.get("r2")) for one in evidence.detection for fit in one.fits.values()]
    fits = [(dataset, float(r2)) for dataset, r2 in every if r2 is not None]  # none of fewer cells than terms
    if not fits:
        return None
    r2 = pd.Series([fit for _, fit in fits])
    text = f"R² of {r2.min():.3f} to {r2.max():.3f}; the paper's {bound:.3f} and more counts."
    cells = pd.DataFrame({"supports": r2 >= bound, "opposes": r2 < bound})
    return claim.of_cells(cells, "fit", [dataset for dataset, _ in fits], text)


def _grid(evidence: Evidence) -> Measurement | None:
    fits = evidence.inputs.read("refit/fits.json")
    if not fits:
        return None
    miss = max(float(one["largest_miss_of_grid"]) for one in fits.values())
    text = f"Largest difference from the printed grid: {miss:.3f} points."
    return Measurement(text, claim.CONSISTENT if miss <= 0.1 else claim.CONTRADICTED, miss)


def _framework_wins(evidence: Evidence) -> Measurement | None:
    table = evidence.inputs.read("worked_examples/precision.parquet")
    if table is None:
        return None
    at = {row["controller"]: row for row in records(table)}
    ours, others = at["proposed"], [at["camera_default"], at["fixed_parameters"]]
    is_above = all(ours["low_percent"] > row["high_percent"] for row in others)
    is_below = any(ours["high_percent"] < row["low_percent"] for row in others)
    verdict = claim.SUPPORTED if is_above else claim.CONTRADICTED if is_below else claim.UNDECIDED
    text = ", ".join(
        f"{name} {row['car_ap_percent']:.0f} % ({row['low_percent']:.0f} to {row['high_percent']:.0f})"
        for name, row in (("framework", ours), ("built-in", others[0]), ("fixed", others[1]))
    )
    value, low, high = (ours[name] for name in ("car_ap_percent", "low_percent", "high_percent"))
    return Measurement(f"AP: {text}.", verdict, value, low, high, word("sim"))


def _framework_wins_elsewhere(evidence: Evidence) -> Measurement | None:
    differences = [
        difference
        for one in scenario_results(evidence.inputs)
        for policy in OURS
        for other in BUILT_IN
        if one.is_demanding and (difference := one.difference(policy, other)) is not None
    ]
    cells = pd.DataFrame(differences, columns=["points", "low", "high"], dtype=float)
    cells = cells.assign(supports=cells["low"] > 0, opposes=cells["high"] < 0)
    text = (
        f"Difference of AP {cells['points'].min():+z.0f} to {cells['points'].max():+z.0f} points "
        f"({', '.join(map(word, OURS))} less {', '.join(map(word, BUILT_IN))})."
    )
    return claim.of_cells(cells, "comparison", ["sim"], text)


def _trade(evidence: Evidence) -> Measurement | None:
    steps = evidence.inputs.read("worked_examples/steps.parquet")
    if steps is None:
        return None
    at = steps[steps["example"] == "sim_yolov4_car"].set_index("step")["detection_score"]
    before, after = float(at["corrupted"]), float(at["final"])
    text = f"Mean score of the cars {before:.2f} to {after:.2f}, without an interval; the paper's 0.25 to 0.50."
    verdict = claim.PARTLY if after > before else claim.CONTRADICTED  # without an interval it carries no more
    return Measurement(text, verdict, after, on=word("sim"))


def order(evidence: Evidence, *, conclusion: Conclusion) -> Measurement | None:
    """A conclusion of the order study, under the detector's order and in linear light."""
    setting = (DETECTOR, LINEAR)
    conditions, effects = (evidence.inputs.read(f"order_study/{name}.parquet") for name in ("study", "effects"))
    if conditions is None or effects is None:
        return None
    study = Study(conditions, effects)
    verdicts = {True: claim.SUPPORTED, False: claim.CONTRADICTED, None: claim.UNDECIDED}
    text = f"{order_study.evidence(study, conclusion, setting)}; in the paper's order and light "
    text += order_study.evidence(study, conclusion, (PAPER, ENCODED))
    return Measurement(f"{text}.", verdicts[study.holds(conclusion, setting)], on=word("sim"))


MEASURES = claim.measures(
    _falls, _both_cost_more, _not_monotonic, _direction_matters, _regression, _grid, _trade, _framework_wins,
    _framework_wins_elsewhere,
)  # fmt: skip
