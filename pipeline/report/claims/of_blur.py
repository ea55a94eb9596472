"""Claims on blur estimation: Table I, uncorrupted frames and run times."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from pipeline.experiments.condition import SHARP
from pipeline.experiments.sharp_curves import NOMINAL_FREQUENCIES
from pipeline.report.claims import claim, paired_blur
from pipeline.report.claims.claim import Evidence, Measurement
from pipeline.report.display_names import word
from pipeline.report.patch_times import patch_times
from pipeline.report.tables import format_number, where

NETWORK, DECONVOLUTION = "cnn", ["pmp", "gbb"]
FREQUENCY = 0.3
PREPROCESSING_PERCENT = 90.0


def _network_is_best(evidence: Evidence) -> Measurement | None:
    """On the patches that the network and each of the others have."""
    known, rows = evidence.blur, []
    for key in known:
        dataset, estimator, blur, size_px = key
        others = [(dataset, name, blur, size_px) for name in DECONVOLUTION]
        if estimator == NETWORK and blur != SHARP and all(other in known for other in others):
            rows.append({"measured_on": dataset, **paired_blur.lower(known, key, others, evidence.inputs.seed)})
    cells = pd.DataFrame(rows)
    if cells.empty:
        return None
    kernel = ["measured_on", "blur_kind", "kernel_size_px"]
    network = where(evidence.amae, estimator=NETWORK).set_index(kernel)
    rest = where(evidence.amae, estimator=DECONVOLUTION).groupby(kernel)[["paper"]].min()
    papers = network.join(rest["paper"].dropna(), how="inner", rsuffix="_of_rest")
    lowest = papers["paper"] < papers["paper_of_rest"]
    text = "On the patches that both have. "
    text += f"In the paper's own numbers the network is lowest in {lowest.sum()} of {len(lowest)} of them."
    return claim.of_cells(cells, "cell", cells["measured_on"], text)


def _amae_over_size(
    evidence: Evidence, *, first_px: float, then_px: float, estimators: Sequence[str], blur: str, rises: bool
) -> Measurement | None:
    """That the AMAE of a blur rises, or falls, from one kernel size to another."""
    known, rows = evidence.blur, []
    smaller, larger = (first_px, then_px) if rises else (then_px, first_px)
    for dataset, name in dict.fromkeys(key[:2] for key in known if key[1] in estimators):
        low, high = ((dataset, name, blur, size_px) for size_px in (smaller, larger))
        if low in known and high in known:
            compared = paired_blur.lower(known, low, [high], evidence.inputs.seed)
            rows.append({"measured_on": dataset, "estimator": name, **compared})
    pairs = pd.DataFrame(rows)
    if pairs.empty:
        return None
    cells = where(evidence.amae, blur_kind=blur).merge(pairs[["measured_on", "estimator"]])
    before, after = (
        format_number(where(cells, kernel_size_px=size)["amae_percent"].mean(), 1) for size in (first_px, then_px)
    )
    text = f"Mean AMAE {before} % at {first_px:g} px and {after} % at {then_px:g} px."
    return claim.of_cells(pairs, "dataset-estimator pair", pairs["measured_on"], text)


def _defocus_is_easiest(evidence: Evidence) -> Measurement | None:
    known, rows = evidence.blur, []
    for key in known:
        dataset, estimator, blur, _ = key
        motion = [other for other in known if other[::3] == key[::3] and other[1] == NETWORK and other[2] != blur]
        if estimator == NETWORK and blur == "defocus" and motion:
            rows.append({"measured_on": dataset, **paired_blur.lower(known, key, motion, evidence.inputs.seed)})
    pairs = pd.DataFrame(rows)
    if pairs.empty:
        return None
    means = where(evidence.amae, estimator=NETWORK).groupby("blur_kind")["amae_percent"].mean()
    text = f"Mean AMAE: {', '.join(f'{word(str(blur))} {mean:.1f} %' for blur, mean in means.items())}."
    return claim.of_cells(pairs, "dataset-size pair", pairs["measured_on"], text)


def _sharp_frames(evidence: Evidence) -> Measurement | None:
    """That PMP and GBB estimate a lower MTF than the network, on the patches that both have."""
    known, rows = evidence.blur, []
    statistic = paired_blur.horizontal_mtf(NOMINAL_FREQUENCIES.index(FREQUENCY))
    for key in known:
        dataset, estimator, blur, size_px = key
        beside = (dataset, NETWORK, blur, size_px)
        if estimator in DECONVOLUTION and blur == SHARP and beside in known:
            compared = paired_blur.lower(known, key, [beside], evidence.inputs.seed, statistic)
            rows.append({"measured_on": dataset, **compared})
    pairs = pd.DataFrame(rows)
    if pairs.empty or evidence.sharp.empty:
        return None
    cells = evidence.sharp[np.isclose(evidence.sharp["frequency"], FREQUENCY)]
    network = where(cells, estimator=NETWORK).set_index("measured_on")
    rest = where(cells, estimator=DECONVOLUTION, measured_on=list(network.index)).set_index("measured_on")
    means = rest.groupby(level=0, sort=False)["mtf"].mean()
    words = [
        f"{claim.names_of([dataset])}: {word(NETWORK)} {ours:.2f}, PMP and GBB {mean:.2f}"
        for dataset, mean, ours in zip(means.index, means, network["mtf"].reindex(means.index), strict=True)
    ]
    text = f"Median MTF at {FREQUENCY:g} of Nyquist, horizontal: {'; '.join(words)}."
    return claim.of_cells(pairs, "dataset-estimator pair", pairs["measured_on"], text)


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
    """That neither PCA nor B+F takes longer than the paper's time for it."""
    times, paper = evidence.run_times, {"pca": 0.002, "bf": 0.005}
    if not set(paper) <= set(times):
        return None
    text = f"PCA {1e3 * times['pca']:.2f} ms, B+F {1e3 * times['bf']:.2f} ms a patch, on one core."
    both = all(times[name] <= seconds for name, seconds in paper.items())
    return Measurement(text, claim.SUPPORTED if both else claim.CONTRADICTED)


MEASURES = claim.measures(
    _network_is_best, _amae_over_size, _defocus_is_easiest, _sharp_frames, _many_times_faster, _preprocessing,
    _published_times,
)  # fmt: skip
