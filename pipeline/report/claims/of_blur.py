"""Claims on blur estimation: Table I, uncorrupted frames and run times."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pipeline.report.claims import claim
from pipeline.report.claims.claim import Evidence, Measurement
from pipeline.report.display_names import word
from pipeline.report.sections.runtime import patch_times
from pipeline.report.tables import format_number, records, where

NETWORK, DECONVOLUTION = "cnn", ("pmp", "gbb")
FREQUENCY = 0.3
PREPROCESSING_PERCENT = 90.0


def _network_is_best(evidence: Evidence) -> Measurement | None:
    cells, pairs, paper = evidence.amae, [], []
    for _, group in cells.groupby(["measured_on", "blur_kind", "kernel_size_px"]):
        at = group.set_index("estimator")
        rest = at[at.index.isin(DECONVOLUTION)]
        if NETWORK not in at.index or rest.empty:
            continue
        pairs.append(claim.sides(at.loc[NETWORK], rest[["low_percent", "high_percent"]].min()))
        if rest["paper"].notna().any():
            paper.append(at.loc[NETWORK, "paper"] < rest["paper"].min())
    text = f"In the paper's own numbers the network is lowest in {sum(paper)} of {len(paper)} of them."
    return claim.of_cells(pairs, "cell", cells["measured_on"], text)


def _amae_over_size(
    evidence: Evidence, *, first_px: float, then_px: float, estimators: Sequence[str], blur: str, rises: bool
) -> Measurement | None:
    """That the AMAE of a blur rises, or falls, from one kernel size to another."""
    cells = where(evidence.amae, estimator=list(estimators), blur_kind=blur)
    pairs, means = [], []
    for _, group in cells.groupby(["measured_on", "estimator"]):
        at = group.set_index("kernel_size_px")
        if {first_px, then_px} <= set(at.index):
            first, then = at.loc[first_px], at.loc[then_px]
            pairs.append(claim.sides(first, then) if rises else claim.sides(then, first))
            means.append((first["amae_percent"], then["amae_percent"]))
    before, after = np.mean(means, axis=0) if means else (math.nan, math.nan)
    text = (
        f"Mean AMAE {format_number(before, 1)} % at {first_px:g} px and {format_number(after, 1)} % at {then_px:g} px."
    )
    return claim.of_cells(pairs, "dataset-estimator pair", cells["measured_on"], text)


def _defocus_is_easiest(evidence: Evidence) -> Measurement | None:
    cells = where(evidence.amae, estimator=NETWORK)
    pairs, on = [], []
    for (dataset, _), group in cells.groupby(["measured_on", "kernel_size_px"]):
        disc, motion = where(group, blur_kind="defocus"), group[group["blur_kind"] != "defocus"]
        if len(disc) and len(motion):
            pairs.append(claim.sides(disc.iloc[0], motion[["low_percent", "high_percent"]].min()))
            on.append(dataset)
    means = cells.groupby("blur_kind")["amae_percent"].mean()
    text = f"Mean AMAE: {', '.join(f'{word(str(blur))} {mean:.1f} %' for blur, mean in means.items())}."
    return claim.of_cells(pairs, "dataset-size pair", on, text)


def _sharp_frames(evidence: Evidence) -> Measurement | None:
    if evidence.sharp.empty:
        return None
    cells = evidence.sharp[np.isclose(evidence.sharp["frequency"], FREQUENCY)]
    pairs, words, on = [], [], []
    for dataset, group in cells.groupby("measured_on", sort=False):
        at = group.set_index("estimator")
        rest = at.loc[[name for name in DECONVOLUTION if name in at.index]]
        if NETWORK not in at.index or rest.empty:
            continue
        network = at.loc[NETWORK]
        pairs += [claim.sides(row, network, ("low", "high")) for row in records(rest)]
        words.append(
            f"{claim.names_of([dataset])}: {word(NETWORK)} {network['mtf']:.2f}, PMP and GBB {rest['mtf'].mean():.2f}"
        )
        on.append(dataset)
    text = f"Median MTF at {FREQUENCY:g} of Nyquist, horizontal: {'; '.join(words)}."
    return claim.of_cells(pairs, "dataset-estimator pair", on, text)


def _many_times_faster(evidence: Evidence) -> Measurement | None:
    times = evidence.run_times
    if not {"cnn_mtf", *DECONVOLUTION} <= set(times):
        return None
    ratios = [times[name] / times["cnn_mtf"] for name in DECONVOLUTION]
    network, fastest = 1e3 * times["cnn_mtf"], 1e3 * min(times[name] for name in DECONVOLUTION)
    text = (
        f"{min(ratios):.1f} and {max(ratios):.1f} times: {network:.0f} ms for four patches by the network, "
        f"{fastest:.0f} ms and more for one by PMP and GBB, one core."
    )
    return claim.of_number(min(ratios), min(ratios), max(ratios), 50.0, text, ())


def _preprocessing(evidence: Evidence) -> Measurement | None:
    """That nearly all of the network's time passes before its first layer; 90 % and more counts."""
    times = patch_times(evidence.inputs)
    rows = times[(times["name"] == "cnn_mtf") & times["preprocessing_ms"].notna()]
    if rows.empty:
        return None
    before, whole = (4 * float(rows[name].iloc[0]) for name in ("preprocessing_ms", "batched_ms"))
    percent = 100 * before / whole
    text = (
        f"{percent:.1f} %: {before:.1f} of {whole:.0f} ms for four patches, one core; in the paper 98 % of 240 ms. "
        f"{PREPROCESSING_PERCENT:g} % and more counts."
    )
    return claim.of_number(percent, percent, percent, PREPROCESSING_PERCENT, text, ())


def _published_times(evidence: Evidence) -> Measurement | None:
    times, paper = evidence.run_times, {"pca": 0.002, "bf": 0.005}
    if not set(paper) <= set(times):
        return None
    held = all(times[name] <= seconds for name, seconds in paper.items())
    text = f"PCA {1e3 * times['pca']:.2f} ms, B+F {1e3 * times['bf']:.2f} ms a patch, on one core."
    measured = Measurement(text, claim.SUPPORTED)
    return (
        measured if held else claim.of_number(times["bf"], times["bf"], times["bf"], paper["bf"], text, (), above=False)
    )


MEASURES = claim.measures(
    _network_is_best, _amae_over_size, _defocus_is_easiest, _sharp_frames, _many_times_faster, _preprocessing,
    _published_times,
)  # fmt: skip
