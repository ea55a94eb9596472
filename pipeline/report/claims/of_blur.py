"""Claims on blur estimation: Table I, uncorrupted frames and run times."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.report.claims import claim
from pipeline.report.claims.claim import ENDS, Evidence, Measurement
from pipeline.report.display_names import word
from pipeline.report.sections.runtime import patch_times
from pipeline.report.tables import format_number, where

NETWORK, DECONVOLUTION = "cnn", ["pmp", "gbb"]
FREQUENCY = 0.3
PREPROCESSING_PERCENT = 90.0


def _network_is_best(evidence: Evidence) -> Measurement | None:
    cells, kernel = evidence.amae, ["measured_on", "blur_kind", "kernel_size_px"]
    network = where(cells, estimator=NETWORK).set_index(kernel)
    rest = where(cells, estimator=DECONVOLUTION).groupby(kernel)[[*ENDS, "paper"]].min()
    papers = network.join(rest["paper"].dropna(), how="inner", rsuffix="_of_rest")
    lowest = papers["paper"] < papers["paper_of_rest"]
    text = f"In the paper's own numbers the network is lowest in {lowest.sum()} of {len(lowest)} of them."
    return claim.of_cells(claim.lower(network, rest), "cell", cells["measured_on"], text)


def _amae_over_size(
    evidence: Evidence, *, first_px: float, then_px: float, estimators: Sequence[str], blur: str, rises: bool
) -> Measurement | None:
    """That the AMAE of a blur rises, or falls, from one kernel size to another."""
    cells = where(evidence.amae, estimator=list(estimators), blur_kind=blur)
    first, then = (
        where(cells, kernel_size_px=size).set_index(["measured_on", "estimator"]) for size in (first_px, then_px)
    )
    both = claim.lower(first, then) if rises else claim.lower(then, first)
    before, after = (format_number(of.loc[both.index, "amae_percent"].mean(), 1) for of in (first, then))
    text = f"Mean AMAE {before} % at {first_px:g} px and {after} % at {then_px:g} px."
    return claim.of_cells(both, "dataset-estimator pair", cells["measured_on"], text)


def _defocus_is_easiest(evidence: Evidence) -> Measurement | None:
    cells, keys = where(evidence.amae, estimator=NETWORK), ["measured_on", "kernel_size_px"]
    disc = where(cells, blur_kind="defocus").set_index(keys)
    motion = cells[cells["blur_kind"] != "defocus"].groupby(keys)[list(ENDS)].min()
    pairs = claim.lower(disc, motion)
    means = cells.groupby("blur_kind")["amae_percent"].mean()
    text = f"Mean AMAE: {', '.join(f'{word(str(blur))} {mean:.1f} %' for blur, mean in means.items())}."
    return claim.of_cells(pairs, "dataset-size pair", sorted(pairs.index.get_level_values("measured_on")), text)


def _sharp_frames(evidence: Evidence) -> Measurement | None:
    if evidence.sharp.empty:
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
    return claim.of_cells(claim.lower(rest, network, ("low", "high")), "dataset-estimator pair", means.index, text)


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
