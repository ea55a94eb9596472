"""Errors of the blur read under noise: AMAE over kernels, levels and smoothing, with its interval."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.blur.denoise import expected_amae
from pipeline.blur.evaluation import robust_median
from pipeline.camera import mtf
from pipeline.condition.combined_answers import CELL, answers
from pipeline.condition.combined_design import DISC
from pipeline.condition.combined_tables import BLUR_CELLS
from pipeline.streams import stream

if TYPE_CHECKING:
    import pandas as pd

BLOCK = 2_000_000  # numbers resampled together


def blur_cells(read: pd.DataFrame, seed: int, draws: int) -> pd.DataFrame:
    """Errors of every estimator for every experiment, kernel size, level and smoothing, raw and calibrated.

    Args:
        read: `BLUR_READ`.
        seed: root of the bootstrap's streams.
        draws: bootstrap resamples, of patches, the same for all rotations.

    Returns:
        `BLUR_CELLS`, without the expected error (`with_expected`).
    """
    import pandas as pd

    rows = []
    for is_calibrated, table in answers(read):
        for cell, group in table.groupby(CELL, sort=True):
            rows.append(_blur_cell(dict(zip(CELL, cell, strict=True)), group, seed, draws, is_calibrated))
    return BLUR_CELLS.conform(pd.DataFrame(rows, columns=list(BLUR_CELLS.columns)))


def _blur_cell(cell: dict[str, Any], group: pd.DataFrame, seed: int, draws: int, is_calibrated: bool) -> dict[str, Any]:
    ordered = group.sort_values(["angle_deg", "frame", "patch", "axis", "frequency"])
    shape = (ordered["angle_deg"].nunique(), -1, 2, len(mtf.FREQUENCIES))
    given, truth = (ordered[name].to_numpy(float).reshape(shape) for name in ("mtf", "true_mtf"))
    by_patch, truths = given.swapaxes(0, 1), truth[:, 0]
    middle = robust_median(by_patch)
    low, high = _interval(by_patch, truths, stream(seed, "bootstrap", "combined", *cell.values()), draws)
    patches = group[~group["abstained"].to_numpy(bool)]
    answered = patches[patches["mtf"].notna()]
    error = (answered["mtf"] - answered["true_mtf"]).abs()
    interval = answered[answered["low"].notna()]
    held = (interval["low"] <= interval["true_mtf"]) & (interval["true_mtf"] <= interval["high"])
    points = 2 * len(mtf.FREQUENCIES)
    nan = float("nan")
    return {
        **cell,
        "calibrated": is_calibrated,
        "amae_percent": float(_amae(middle, truths)),
        "low_percent": low,
        "high_percent": high,
        "patch_error_percent": 100 * float(error.mean()) if len(error) else nan,
        "coverage": float(held.mean()) if len(held) else nan,
        "angles": shape[0],
        "count": len(patches) // points,
        "abstained": (len(group) - len(patches)) // points,
        "smoothed_share": float(group["smoothed"].mean()),
        "frequencies_share": len(answered) / len(patches) if len(patches) else nan,
        "mae_h_percent": float(_amae(middle[:, [0, 0]], truths[:, [0, 0]])),
        "mae_v_percent": float(_amae(middle[:, [1, 1]], truths[:, [1, 1]])),
        "expected_amae_percent": nan,
    }


def _amae(curves: NDArray[np.float64], truths: NDArray[np.float64]) -> NDArray[np.float64]:
    """AMAE in percent over the frequencies answered, averaged over rotations: (..., rotations, 2, 8) -> (...)."""
    each = mtf.amae(curves, truths, skip_missing=True)
    known = np.isfinite(each)
    total = np.where(known, each, 0.0).sum(axis=-1)
    count = known.sum(axis=-1)
    return np.where(count == 0, np.nan, total / np.maximum(count, 1))


def _interval(
    by_patch: NDArray[np.float64], truths: NDArray[np.float64], generator: np.random.Generator, draws: int
) -> tuple[float, float]:
    """Bootstrap 95 % interval of the AMAE: (patches, rotations, 2, 8) and (rotations, 2, 8)."""
    count = len(by_patch)
    picks = generator.integers(count, size=(draws, count))
    block = max(1, BLOCK // by_patch.size)
    found = np.concatenate(
        [_amae(robust_median(by_patch[part.T]), truths) for part in np.split(picks, range(block, draws, block))]
    )
    if not np.isfinite(found).any():
        return float("nan"), float("nan")
    low, high = np.nanpercentile(found, [2.5, 97.5])
    return float(low), float(high)


def with_expected(cells: pd.DataFrame) -> pd.DataFrame:
    """The cells with the error to be expected of smoothed answers, and without the discs' own.

    Expected is sqrt(a1^2 + a2^2), from the same estimator's AMAE for the blur (a1) and for the disc (a2), both without
    noise (Wischow et al. 2023, supplement).

    Args:
        cells: `BLUR_CELLS` with experiment `DISC` and level 0.
    """
    who = ["dataset", "estimator", "calibrated"]
    without = cells[(cells["level_dn"] == 0) & (cells["filter_px"] == 0)]
    error = {
        (*key[:3], key[3] == DISC, key[4]): value
        for *key, value in without[[*who, "experiment", "size_px", "amae_percent"]].itertuples(index=False, name=None)
    }
    expected = [
        float(expected_amae(error.get((*key[:3], False, size), np.nan), error.get((*key[:3], True, filter_px), np.nan)))
        for *key, size, filter_px in cells[[*who, "size_px", "filter_px"]].itertuples(index=False, name=None)
    ]
    changed = cells.assign(expected_amae_percent=expected)
    return changed[changed["experiment"] != DISC].reset_index(drop=True)
