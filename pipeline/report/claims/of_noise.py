"""Claims on noise estimation, on blur and noise at once, and on improved blur estimation."""

from __future__ import annotations

import pandas as pd

from pipeline.report.claims import claim
from pipeline.report.claims.claim import Evidence, Measurement
from pipeline.report.display_names import word
from pipeline.report.inputs import published_table
from pipeline.report.ledger_sources import levels
from pipeline.report.tables import records, where
from pipeline.stage_files import any_table, existing

PREVENTED_PERCENT = 10.0
"""AMAE from which an estimate counts as prevented: half of what answering without a look at the patch gives."""

NOISY_DN, FOLLOWS_DN = 10.0, 2.0
PAPER_NOISE = ("cnn", "pca", "bf")
PAPER_BLUR = ("cnn", "pmp", "gbb")
REAL_FRACTION = 0.25
KERNEL = ["experiment", "dataset", "estimator", "kernel_size_px"]
CELL = (*KERNEL, "target_sigma_dn")


def _of_experiments(evidence: Evidence, *experiments: str) -> pd.DataFrame:
    """Cells of experiments, of patches as they are."""
    cells = where(evidence.combined, experiment=list(experiments), filter_px=0)
    return cells[cells["amae_percent"].notna()]


def _by_estimator(cells: pd.DataFrame) -> str:
    """Mean AMAE of each estimator with the least and the strongest noise."""
    words = []
    for name, group in cells.groupby("estimator"):
        quiet, loud = (group[group["target_sigma_dn"] == end(group["target_sigma_dn"])] for end in (min, max))
        words.append(f"{word(str(name))} {quiet['amae_percent'].mean():.1f} to {loud['amae_percent'].mean():.1f} %")
    return f"Mean AMAE from no noise to the strongest: {', '.join(words)}."


def _of_paper(counted: pd.DataFrame, pairs: list[tuple[bool, bool]], what: str, text: str) -> Measurement | None:
    """A claim about the paper's estimators, by their cells that have an interval; those of ours are stated in words.

    ``counted`` holds dataset, estimator and ``low_percent`` of each cell; for the rest see `claim.of_cells`.
    """
    known = counted["low_percent"].notna().to_numpy()
    papers = counted["estimator"].isin(PAPER_BLUR).to_numpy()
    if not pairs:
        return None
    numbered = list(zip(pairs, papers, known, strict=True))
    chosen, ours = ([pair for pair, one, held in numbered if held and one == is_paper] for is_paper in (True, False))
    if ours:
        names = ", ".join(word(str(name)) for name in dict.fromkeys(counted.loc[~papers & known, "estimator"]))
        supporting, opposing = (sum(bool(pair[number]) for pair in ours) for number in (0, 1))
        text = f"{text} Ours, not counted ({names}): {supporting} for, {opposing} against, of {len(ours)}."
    if not chosen:
        return Measurement(f"No {what} of the paper's estimators has an interval. {text}".strip(), claim.UNDECIDED)
    text = f"Of the paper's estimators. {text}".strip()
    return claim.of_cells(chosen, what, counted.loc[papers & known, "dataset"], text)


def _prevents(evidence: Evidence, *, experiment: str) -> Measurement | None:
    """That noise of 10 DN and more prevents the estimation of a blur."""
    cells = _of_experiments(evidence, experiment)
    noisy = cells[cells["target_sigma_dn"] >= NOISY_DN]
    pairs = [
        (row["low_percent"] > PREVENTED_PERCENT, row["high_percent"] < PREVENTED_PERCENT) for row in records(noisy)
    ]
    return _of_paper(noisy, pairs, "cell", _by_estimator(cells))


def _disturbs(evidence: Evidence) -> Measurement | None:
    cells = _of_experiments(evidence, "photon_linear", "photon_defocus")
    groups = [group.sort_values("target_sigma_dn") for _, group in cells.groupby(KERNEL) if len(group) > 1]
    if not groups:
        return None
    pairs = [claim.sides(group.iloc[0], group.iloc[-1]) for group in groups]
    loudest = pd.concat([group.iloc[-1:] for group in groups])
    return _of_paper(loudest, pairs, "kernel", _by_estimator(cells))


def _defocus_under_photon_noise(evidence: Evidence) -> Measurement | None:
    cells = _of_experiments(evidence, "photon_defocus")
    bound = float(published_table(evidence.inputs.paper / "photon_defocus_amae.csv")["amae_percent"].max())
    pairs = [(row["high_percent"] <= bound, row["low_percent"] > bound) for row in records(cells)]
    return _of_paper(cells, pairs, "cell", _by_estimator(cells))


def _overestimates(evidence: Evidence) -> Measurement | None:
    of_paper = {"experiment": "photon_linear", "calibrated": False, "filter_px": 0}
    curves = where(evidence.inputs.result_with_records("combined_curves"), axis="HV", frequency_index=4, **of_paper)
    pairs, words, on = [], [], []
    for (dataset, name), group in curves.groupby(["dataset", "estimator"]):
        at = group.sort_values("target_sigma_dn")
        quiet, loud = at.iloc[0], at.iloc[-1]
        pairs.append(claim.sides(quiet, loud, ("minimum", "maximum")))
        words.append(f"{word(str(name))} on {word(str(dataset))} {quiet['median']:.2f} to {loud['median']:.2f}")
        on.append(dataset)
    return claim.of_cells(
        pairs, "curve", on, f"Median at 0.3 of Nyquist: {', '.join(words)}. Ranges over patches decide."
    )


def _smoothing(evidence: Evidence) -> Measurement | None:
    cells = where(evidence.combined, experiment=["linear_dcsn", "defocus_dcsn"])
    cells = cells[cells["target_sigma_dn"] >= NOISY_DN]
    plain = {tuple(row[name] for name in CELL): row for row in records(where(cells, filter_px=0))}
    smoothed = [row for row in records(cells[cells["filter_px"] > 0]) if tuple(row[name] for name in CELL) in plain]
    pairs = [claim.sides(row, plain[tuple(row[name] for name in CELL)]) for row in smoothed]
    text = "Beside the same cell without the disc."
    return _of_paper(pd.DataFrame(smoothed, columns=cells.columns), pairs, "cell", text)


def _follows(evidence: Evidence) -> Measurement | None:
    cells = where(evidence.inputs.result_with_records("noise_summary"), estimator=list(PAPER_NOISE))
    pairs = []
    for row in records(cells):
        below, above = row["low_dn"] - row["unclipped_median_dn"], row["high_dn"] - row["unclipped_median_dn"]
        pairs.append((below > -FOLLOWS_DN and above < FOLLOWS_DN, above < -FOLLOWS_DN or below > FOLLOWS_DN))
    errors = (cells["median_dn"] - cells["unclipped_median_dn"]).groupby(cells["estimator"]).agg(["min", "max"])
    words = [f"{word(str(name))} {row['min']:+.1f} to {row['max']:+.1f} DN" for name, row in errors.iterrows()]
    return claim.of_cells(pairs, "cell", cells["dataset"], f"Median less noise added: {', '.join(words)}.")


def _real_cameras(evidence: Evidence) -> Measurement | None:
    folder = existing(evidence.inputs.recorded)
    path = existing(folder / "real-noise/noise_summary.csv" if folder is not None else None)
    if path is None:
        return None
    rows = records(any_table(path))
    rows = [row for row in rows if row["estimator"] in PAPER_NOISE]
    pairs, words = [], []
    for row in rows:
        bound = REAL_FRACTION * row["true_mean_dn"]
        pairs.append((row["true_mae_high_dn"] < bound, row["true_mae_low_dn"] > bound))
        words.append(f"{word(row['estimator'])} {row['true_mae_dn']:.1f} of {row['true_mean_dn']:.1f} DN")
    text = f"Mean error of the noise present: {', '.join(words)}. Within {100 * REAL_FRACTION:.0f} % counts."
    return claim.of_cells(pairs, "dataset-estimator pair", [row["dataset"] for row in rows], text)


def _levels(evidence: Evidence) -> Measurement | None:
    misses = levels(evidence.inputs)
    if misses is None:
        return None
    worst = float(misses["miss_percent"].max())
    text = f"Largest deviation from the target before clipping: {worst:.3f} %."
    return claim.of_number(worst, worst, worst, 2.0, text, misses["dataset"], above=False)


MEASURES = claim.measures(
    _levels, _follows, _real_cameras, _prevents, _disturbs, _defocus_under_photon_noise, _overestimates, _smoothing,
)  # fmt: skip
