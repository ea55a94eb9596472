"""Claims on detection under blur and noise, on camera control, and on the order of photon noise and blur."""

from __future__ import annotations

import pandas as pd

from pipeline.control.simulation.order_conclusions import DETECTOR, ENCODED, LINEAR, PAPER, Conclusion, StudyTables
from pipeline.control.simulation.scenario_result import OURS
from pipeline.report.claims import claim
from pipeline.report.claims.claim import Evidence, Measurement
from pipeline.report.claims.paired_precision import WHO, distinct
from pipeline.report.display_names import counted, word
from pipeline.report.inputs import published_table
from pipeline.report.order_evidence import evidence_of
from pipeline.report.scenario_results import scenario_results
from pipeline.report.tables import records, where

BUILT_IN = ("prosilica", "mean_intensity")
CLEAN = (0.0, 0.0)
"""Neither blur (px) nor noise (DN)."""

MEASURED_BIN = ("sigma_bin_dn", "mtf_bin", "sigma_dn", "mtf", "ap_percent")
"""Columns of a bin of a surface that are equal where it is the same measurement."""

DIRECTION_POINTS = 5.0
"""Difference of AP between directions of blur from which the direction matters."""


def _falls(evidence: Evidence, *, cause: str) -> Measurement | None:
    """That AP falls with the strongest noise or the longest blur, the other absent; the mean over directions."""
    rows = []
    for sweep in evidence.sweeps:
        longest, strongest = sweep.ends()
        point = (0.0, strongest) if cause == "noise" else (longest, 0.0)
        if point == CLEAN:
            continue
        blur = "" if cause == "noise" else sweep.blur_kind
        clean, worst = sweep.ap_percent(0.0, 0.0), sweep.ap_percent(*point)
        rows.append({**sweep.who, "blur_kind": blur, "clean": clean, "worst": worst, **sweep.lower(point, [CLEAN])})
    pairs = distinct(rows, "blur_kind")
    if pairs.empty:
        return None
    before, after = pairs.groupby(WHO)[["clean", "worst"]].mean().mean()
    return claim.of_cells(pairs, "comparison", pairs["dataset"], f"Mean AP {before:.0f} to {after:.0f} %.")


def _both_cost_more(evidence: Evidence) -> Measurement | None:
    """That AP under the longest blur and the strongest noise is below that under either; the mean over directions."""
    rows = []
    for sweep in evidence.sweeps:
        longest, strongest = sweep.ends()
        if not (longest and strongest):
            continue
        lower = sweep.lower((longest, strongest), [(longest, 0.0), (0.0, strongest)])
        rows.append({**sweep.who, "blur_kind": sweep.blur_kind, **lower})
    pairs = distinct(rows, "blur_kind")
    return None if pairs.empty else claim.of_cells(pairs, "comparison", pairs["dataset"])


def _not_monotonic(evidence: Evidence) -> Measurement | None:
    """By surfaces; bins that two of them share, those without blur, count for the first alone."""
    parts = [
        where(one.heat, label=label).assign(dataset=one.dataset, detector=one.detector, surface=f"{number} {label}")
        for number, one in enumerate(evidence.detection)
        for label in sorted(set(one.heat["label"]))
    ]
    if not parts:
        return None
    bins = pd.concat(parts, ignore_index=True)
    bins = bins[bins["count"] > 0].drop_duplicates([*WHO, *MEASURED_BIN])
    groups = bins.groupby("surface", sort=False)
    certain = pd.DataFrame({"dataset": groups["dataset"].first(), "supports": groups["certainly"].any()})
    certain = certain.assign(opposes=False)
    rises, certainly = (int(bins[name].sum()) for name in ("non_monotonic", "certainly"))
    text = f"{rises} of {len(bins)} bins exceed a milder neighbour, {certainly} certainly, corrected for their number."
    return claim.of_cells(certain, "surface", certain["dataset"], text)


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
    """R² of fits in which every cell counts the same, as in the paper, beside the paper's; it has no interval."""
    published = published_table(evidence.inputs.paper / "regression_coefficients.csv")
    bound = float(published.loc[published["parameter"] == "r2", "value"].min())
    every = [(one.dataset, one.unweighted_r2(label)) for one in evidence.detection for label in one.fits]
    fits = [(dataset, r2) for dataset, r2 in every if r2 is not None]
    if not fits:
        return None
    r2 = pd.Series([value for _, value in fits])
    text = (
        f"Unweighted R² of {counted(len(r2), 'fit')}: {r2.min():.3f} to {r2.max():.3f}; {(r2 >= bound).sum()} of them "
        f"as high as the lower of the paper's two, {bound:.3f}, unweighted too. Without an interval R² decides nothing."
    )
    return Measurement(text, claim.UNDECIDED, on=claim.names_of(dataset for dataset, _ in fits))


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
    return Measurement(f"AP: {text}. {claim.OVERLAP}", verdict, value, low, high, word("sim"))


def _framework_wins_elsewhere(evidence: Evidence) -> Measurement | None:
    """By paired differences; where both policies drive alike, so that theirs are the same, they count once."""
    rows = [
        (one.name, other, *difference)
        for one in scenario_results(evidence.inputs)
        for policy in OURS
        for other in BUILT_IN
        if one.is_demanding and (difference := one.difference(policy, other)) is not None
    ]
    columns = ["points", "low", "high"]
    every = pd.DataFrame(rows, columns=["scenario", "other", *columns]).astype(dict.fromkeys(columns, float))
    cells = every.drop_duplicates()
    cells = cells.assign(supports=cells["low"] > 0, opposes=cells["high"] < 0)
    twice = every[every.duplicated()]["scenario"].nunique()
    same = f" Both policies drive alike in {counted(twice, 'scenario')}, which count once." if twice else ""
    text = (
        f"Difference of AP {cells['points'].min():+z.0f} to {cells['points'].max():+z.0f} points "
        f"({', '.join(map(word, OURS))} less {', '.join(map(word, BUILT_IN))}).{same}"
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
    study = StudyTables(conditions, effects)
    verdicts = {True: claim.SUPPORTED, False: claim.CONTRADICTED, None: claim.UNDECIDED}
    text = f"{evidence_of(study, conclusion, setting)}; in the paper's order and light "
    text += evidence_of(study, conclusion, (PAPER, ENCODED))
    return Measurement(f"{text}.", verdicts[study.holds(conclusion, setting)], on=word("sim"))


MEASURES = claim.measures(
    _falls, _both_cost_more, _not_monotonic, _direction_matters, _regression, _grid, _trade, _framework_wins,
    _framework_wins_elsewhere,
)  # fmt: skip
