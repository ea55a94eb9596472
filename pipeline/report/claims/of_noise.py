"""Claims on noise estimation, on blur and noise at once, and on improved blur estimation."""

from __future__ import annotations

from collections.abc import Iterable

import pandas as pd

from pipeline.report.claims import claim
from pipeline.report.claims.claim import PAPER_BLUR, Evidence, Measurement
from pipeline.report.display_names import word
from pipeline.report.inputs import published_table
from pipeline.report.ledger.sources import levels
from pipeline.report.tables import records, where
from pipeline.stage_files import optional

PREVENTED_PERCENT = 10.0
"""AMAE from which an estimate counts as prevented: half of what answering without a look at the patch gives."""

NOISY_DN, FOLLOWS_DN = 10.0, 2.0
PAPER_NOISE = ("cnn", "pca", "bf")
REAL_FRACTION = 0.25
KERNEL = ["experiment", "dataset", "estimator", "kernel_size_px"]
CURVE = ["dataset", "estimator"]


def _of_experiments(evidence: Evidence, *experiments: str) -> pd.DataFrame:
    """Cells of experiments, of patches as they are."""
    cells = where(evidence.combined, experiment=list(experiments), filter_px=0)
    return cells[cells["amae_percent"].notna()]


def _by_levels(parts: Iterable[tuple[float, float, str]]) -> str:
    """Texts with the least and the strongest noise that each is of (DN), those of the same levels together."""
    texts: dict[str, list[str]] = {}
    for least_dn, most_dn, text in parts:
        levels = f"from {least_dn:g} to {most_dn:g} DN" if least_dn < most_dn else f"at {least_dn:g} DN"
        texts.setdefault(levels, []).append(text)
    return "; ".join(f"{levels}: {', '.join(of_levels)}" for levels, of_levels in texts.items())


def _by_estimator(cells: pd.DataFrame) -> str:
    """Mean AMAE of each estimator with the least and the strongest noise that it has cells of."""
    parts = []
    for name, group in cells.groupby("estimator"):
        means = group.groupby("target_sigma_dn")["amae_percent"].mean()  # in ascending order of the noise
        ends = [f"{mean:.1f}" for mean in means.iloc[[0, -1] if len(means) > 1 else [0]]]
        parts.append((float(means.index[0]), float(means.index[-1]), f"{word(str(name))} {' to '.join(ends)} %"))
    return f"Mean AMAE {_by_levels(parts)}."


def _of_paper(cells: pd.DataFrame, what: str, text: str) -> Measurement | None:
    """A claim about the paper's estimators, by their cells that have an interval; those of ours are stated in words.

    For the arguments see `claim.of_cells`.
    """
    if cells.empty:
        return None
    known = cells[cells["low_percent"].notna()]
    is_papers = known["estimator"].isin(PAPER_BLUR)
    papers, ours = known[is_papers], known[~is_papers]
    if len(ours):
        names, (supporting, opposing) = map(word, ours["estimator"].unique()), ours[["supports", "opposes"]].sum()
        text = f"{text} Ours, not counted ({', '.join(names)}): {supporting} for, {opposing} against, of {len(ours)}."
    if papers.empty:
        return Measurement(f"No {what} of the paper's estimators has an interval. {text}".strip(), claim.UNDECIDED)
    return claim.of_cells(papers, what, papers["dataset"], f"Of the paper's estimators. {text}".strip())


def _prevents(evidence: Evidence, *, experiment: str) -> Measurement | None:
    """That noise of 10 DN and more prevents the estimation of a blur."""
    cells = _of_experiments(evidence, experiment)
    noisy = cells[cells["target_sigma_dn"] >= NOISY_DN]
    bound = {"supports": noisy["low_percent"] > PREVENTED_PERCENT, "opposes": noisy["high_percent"] < PREVENTED_PERCENT}
    return _of_paper(noisy.assign(**bound), "cell", _by_estimator(cells))


def _disturbs(evidence: Evidence) -> Measurement | None:
    cells = _of_experiments(evidence, "photon_linear", "photon_defocus")
    level = cells.groupby(KERNEL)["target_sigma_dn"]
    least, most = level.transform("min"), level.transform("max")
    quiet, loud = (
        cells[(cells["target_sigma_dn"] == end) & (least < most)].set_index(KERNEL).sort_index()
        for end in (least, most)
    )
    return _of_paper(claim.lower(quiet, loud).reset_index(), "kernel", f"{_by_estimator(cells)} {claim.OVERLAP}")


def _defocus_under_photon_noise(evidence: Evidence) -> Measurement | None:
    cells = _of_experiments(evidence, "photon_defocus")
    bound = float(published_table(evidence.inputs.paper / "photon_defocus_amae.csv")["amae_percent"].max())
    cells = cells.assign(supports=cells["high_percent"] <= bound, opposes=cells["low_percent"] > bound)
    return _of_paper(cells, "cell", _by_estimator(cells))


def _overestimates(evidence: Evidence) -> Measurement | None:
    """By the paired change of the median from the least to the strongest noise, frames resampled."""
    of_paper = {"experiment": "photon_linear", "calibrated": False, "filter_px": 0}
    curves = where(evidence.inputs.result_with_records("combined_curves"), axis="HV", frequency_index=4, **of_paper)
    groups = curves.sort_values("target_sigma_dn", kind="stable").groupby(CURVE)
    quiet, loud = (rows.set_index(CURVE).sort_index() for rows in (groups.head(1), groups.tail(1)))
    known = quiet["target_sigma_dn"] < loud["target_sigma_dn"]
    known &= quiet["median"].notna() & loud["median"].notna() & loud["change_low"].notna()
    unknown = [f"{word(name)} on {word(dataset)}" for dataset, name in known.index[~known]]
    without = "no estimate with the least or the strongest noise, or no interval of the change"
    left_out = f"Left out, {without}: {', '.join(unknown)}. " if unknown else ""
    quiet, loud = quiet[known], loud[known]
    if quiet.empty:
        return Measurement(left_out.strip(), claim.UNDECIDED) if unknown else None
    parts = [
        (least_dn, most_dn, f"{word(name)} on {word(dataset)} {before:.2f} to {after:.2f}")
        for (dataset, name), least_dn, most_dn, before, after in zip(
            quiet.index, quiet["target_sigma_dn"], loud["target_sigma_dn"], quiet["median"], loud["median"], strict=True
        )
    ]
    text = f"Median at 0.3 of Nyquist {_by_levels(parts)}. {left_out}".strip()
    pairs = loud.assign(supports=loud["change_low"] > 0, opposes=loud["change_high"] < 0)
    return claim.of_cells(pairs, "curve", quiet.index.get_level_values("dataset"), text)


def _smoothing(evidence: Evidence) -> Measurement | None:
    cells = where(evidence.combined, experiment=["linear_dcsn", "defocus_dcsn"])
    cells = cells[cells["target_sigma_dn"] >= NOISY_DN].set_index([*KERNEL, "target_sigma_dn"])
    pairs = claim.lower(cells[cells["filter_px"] > 0], where(cells, filter_px=0))
    return _of_paper(pairs.reset_index(), "cell", f"Beside the same cell without the disc. {claim.OVERLAP}")


def _follows(evidence: Evidence) -> Measurement | None:
    cells = where(evidence.inputs.result_with_records("noise_summary"), estimator=list(PAPER_NOISE))
    median, below, above = (cells[name] - cells["unclipped_median_dn"] for name in ("median_dn", "low_dn", "high_dn"))
    errors = median.groupby(cells["estimator"]).agg(["min", "max"])
    words = [f"{word(str(name))} {row['min']:+.1f} to {row['max']:+.1f} DN" for name, row in errors.iterrows()]
    cells = cells.assign(
        supports=(below > -FOLLOWS_DN) & (above < FOLLOWS_DN), opposes=(above < -FOLLOWS_DN) | (below > FOLLOWS_DN)
    )
    return claim.of_cells(cells, "cell", cells["dataset"], f"Median less noise added: {', '.join(words)}.")


def _real_cameras(evidence: Evidence) -> Measurement | None:
    rows = optional(evidence.inputs.recorded, "real-noise/noise_summary.csv")
    if rows is None:
        return None
    rows = where(rows, estimator=list(PAPER_NOISE))
    bound = REAL_FRACTION * rows["true_mean_dn"]
    words = [
        f"{word(row['estimator'])} {row['true_mae_dn']:.1f} of {row['true_mean_dn']:.1f} DN" for row in records(rows)
    ]
    cells = rows.assign(supports=rows["true_mae_high_dn"] < bound, opposes=rows["true_mae_low_dn"] > bound)
    text = f"Mean error of the noise present: {', '.join(words)}. Within {100 * REAL_FRACTION:.0f} % counts."
    return claim.of_cells(cells, "dataset-estimator pair", rows["dataset"], text)


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

TASKS = dict.fromkeys(("levels", "follows", "real_cameras"), "noise")
"""Claim -> task of the paper's network that it is about; the others are about blur."""
