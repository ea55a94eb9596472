"""Claims on detection under blur and noise, on camera control, and on the order of photon noise and blur."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd

from pipeline.control.order_conclusions import DETECTOR, ENCODED, LINEAR, PAPER, Conclusion, Study
from pipeline.control.scenario_result import OURS
from pipeline.report import detection_results
from pipeline.report.claims import claim
from pipeline.report.claims.claim import Evidence, Measurement
from pipeline.report.detection_results import Results
from pipeline.report.display_names import word
from pipeline.report.inputs import published_table
from pipeline.report.sections import order_study
from pipeline.report.sections.closed_loop import scenario_results
from pipeline.report.tables import records

BUILT_IN = ("prosilica", "mean_intensity")


def _results(evidence: Evidence) -> list[Results]:
    """Every sweep, recorded ones among them."""
    return [*evidence.detection, *(record.results for record in detection_results.recorded(evidence.inputs))]


def _sweeps(evidence: Evidence) -> Iterator[tuple[str, pd.DataFrame]]:
    """Dataset and average precision of every detector and class."""
    for one in _results(evidence):
        for label in one.labels:
            yield one.dataset, one.precision[one.precision["label"] == label]


def _falls(evidence: Evidence, *, cause: str) -> Measurement | None:
    """That AP falls with the strongest noise or the longest blur, the other absent."""
    column, other = ("target_sigma_dn", "kernel_size_px") if cause == "noise" else ("kernel_size_px", "target_sigma_dn")
    pairs, on, ends = [], [], []
    for dataset, table in _sweeps(evidence):
        selected = table[table[other] == 0]
        clean, worst = selected[selected[column] == 0].iloc[0], selected[selected[column] == selected[column].max()]
        pairs += [claim.sides(row, clean) for row in records(worst)]
        on.append(dataset)
        ends.append((clean["ap_percent"], worst["ap_percent"].mean()))
    if not pairs:
        return None
    before, after = (sum(end[number] for end in ends) / len(ends) for number in (0, 1))
    return claim.of_cells(pairs, "condition", on, f"Mean AP {before:.0f} to {after:.0f} %.")


def _both_cost_more(evidence: Evidence) -> Measurement | None:
    pairs, on = [], []
    for dataset, table in _sweeps(evidence):
        cells = {(row["kernel_size_px"], row["angle_deg"], row["target_sigma_dn"]): row for row in records(table)}
        size, level = table["kernel_size_px"].max(), table["target_sigma_dn"].max()
        noisy = next(row for key, row in cells.items() if key[0] == 0 and key[2] == level)
        for (px, angle, dn), both in cells.items():
            if (px, dn) == (size, level) and (size, angle, 0.0) in cells:
                blurred = cells[size, angle, 0.0]
                lowest = {end: min(noisy[end], blurred[end]) for end in ("low_percent", "high_percent")}
                pairs.append(claim.sides(both, lowest))
                on.append(dataset)
    return claim.of_cells(pairs, "direction", on)


def _not_monotonic(evidence: Evidence) -> Measurement | None:
    pairs, on, rises, certain, bins = [], [], 0, 0, 0
    for one in _results(evidence):
        for _, group in one.heat[one.heat["count"] > 0].groupby("label"):
            pairs.append((bool(group["certainly"].any()), False))
            on.append(one.dataset)
            rises += int(group["non_monotonic"].sum())
            certain += int(group["certainly"].sum())
            bins += len(group)
    text = f"{rises} of {bins} bins exceed a milder neighbour, {certain} certainly, corrected for their number."
    return claim.of_cells(pairs, "surface", on, text)


def _direction_matters(evidence: Evidence) -> Measurement | None:
    paper = published_table(evidence.inputs.paper / "yolov7_direction_ap.csv")
    quiet = paper[paper["sigma_dn"] == 0].groupby("kernel_size_px")["ap_percent"]
    theirs = float((quiet.max() - quiet.min()).max())
    parts = [one.spread.assign(dataset=one.dataset) for one in _results(evidence) if one.spread is not None]
    rows = [row for part in parts for row in records(part[part["target_sigma_dn"] == 0])]
    if not rows:
        return None
    best = max(rows, key=lambda row: row["spread_percent"])
    text = (
        f"Largest difference between directions, without noise: {best['spread_percent']:.0f} points ({best['label']}, "
        f"{best['kernel_size_px']:g} px); in the paper's table {theirs:.0f} points."
    )
    value, low, high = (best[name] for name in ("spread_percent", "low_percent", "high_percent"))
    return claim.of_number(value, low, high, 5.0, text, [best["dataset"]])


def _regression(evidence: Evidence) -> Measurement | None:
    published = published_table(evidence.inputs.paper / "regression_coefficients.csv")
    bound = float(published.loc[published["parameter"] == "r2", "value"].min())
    every = [(one.dataset, fit.get("r2")) for one in evidence.detection for fit in one.fits.values()]
    fits = [(dataset, float(r2)) for dataset, r2 in every if r2 is not None]  # none of fewer cells than terms
    if not fits:
        return None
    values = [r2 for _, r2 in fits]
    text = f"R² of {min(values):.3f} to {max(values):.3f}; the paper's {bound:.3f} and more counts."
    return claim.of_cells([(r2 >= bound, r2 < bound) for r2 in values], "fit", [dataset for dataset, _ in fits], text)


def _grid(evidence: Evidence) -> Measurement | None:
    fits = evidence.inputs.read("refit/fits.json")
    if not fits:
        return None
    miss = max(float(one["largest_miss_of_grid"]) for one in fits.values())
    text = f"Largest difference from the printed grid: {miss:.3f} points."
    return claim.of_number(miss, miss, miss, 0.1, text, (), above=False)


def _framework_wins(evidence: Evidence) -> Measurement | None:
    table = evidence.inputs.read("worked_examples/precision.parquet")
    if table is None:
        return None
    at = {row["controller"]: row for row in records(table)}
    ours, others = at["proposed"], [at["camera_default"], at["fixed_parameters"]]
    below, above = zip(*(claim.sides(ours, row) for row in others), strict=True)
    verdict = claim.SUPPORTED if all(above) else claim.CONTRADICTED if any(below) else claim.UNDECIDED
    text = ", ".join(
        f"{name} {row['car_ap_percent']:.0f} % ({row['low_percent']:.0f} to {row['high_percent']:.0f})"
        for name, row in (("framework", ours), ("built-in", others[0]), ("fixed", others[1]))
    )
    value, low, high = (ours[name] for name in ("car_ap_percent", "low_percent", "high_percent"))
    return Measurement(f"AP: {text}.", verdict, value, low, high, word("sim"))


def _framework_wins_elsewhere(evidence: Evidence) -> Measurement | None:
    pairs, words = [], []
    for one in scenario_results(evidence.inputs):
        for policy in OURS:
            for other in BUILT_IN:
                difference = one.difference(policy, other)
                if one.is_demanding and difference is not None:
                    pairs.append((difference[1] > 0, difference[2] < 0))
                    words.append(difference[0])
    text = (
        f"Difference of AP {min(words):+.0f} to {max(words):+.0f} points ({', '.join(map(word, OURS))} less "
        f"{', '.join(map(word, BUILT_IN))})."
        if words
        else ""
    )
    return claim.of_cells(pairs, "comparison", ["sim"], text)


def _trade(evidence: Evidence) -> Measurement | None:
    steps = evidence.inputs.read("worked_examples/steps.parquet")
    if steps is None:
        return None
    at = steps[steps["example"] == "sim_yolov4_car"].set_index("step")["detection_score"]
    before, after = float(at["corrupted"]), float(at["final"])
    text = f"Score of the car {before:.2f} to {after:.2f}; the paper's 0.25 to 0.50."
    return Measurement(text, claim.SUPPORTED if after > before else claim.CONTRADICTED, after, on=word("sim"))


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
