"""From measurements to the cells of tables: AMAE, robust sigma, coverage, abstentions, and bootstrap intervals.

    AMAE = mean over H and V of mean over 8 frequencies of |robust median - truth|, in percent, averaged over rotations

with the robust median over the patches of all frames (`pipeline.statistics`; Wischow et al. 2023, Sec. V). Noise is the
robust median, minimum and maximum over all tiles (Sec. IV-B). Intervals are bias-corrected 95 % intervals over frames
(`pipeline.experiments.intervals`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.camera import mtf
from pipeline.experiments.intervals import bootstrap_stream, frame_interval, median, robust_median
from pipeline.experiments.tables import CONDITION, CONDITIONS
from pipeline.statistics import robust
from pipeline.streams import stream

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

NOISE_CELL = ("dataset", "estimator", "noise_source", "target_sigma_dn")
MTF_CELL = ("dataset", "estimator", "noise_source", "target_sigma_dn", "blur_kind", "kernel_size_px")
_NAN = float("nan")


def noise_cells(
    measurements: pd.DataFrame,
    by: Sequence[str],
    purpose: str,
    seed: int,
    draws: int,
    *,
    sort: bool = True,
) -> pd.DataFrame:
    """Robust statistics of the noise, one row for each cell.

    Args:
        measurements: of sigma (`pipeline.experiments.tables.MEASUREMENTS`).
        by: columns that a cell's rows have in common.
        purpose: names the bootstrap's random stream.
        seed: root of the random streams.
        draws: bootstrap resamples of frames; 0 for none.
        sort: cells in the order of their keys; else in that of the measurements.

    Returns:
        the cells, with the mean absolute error of the patches against the noise present (``clipped_error_dn``) and the
        noise before clipping (``unclipped_error_dn``), and the fraction of intervals that hold the latter
        (``coverage``; NaN where the method has none).
    """
    import pandas as pd

    rows = []
    for key, group in measurements.groupby(list(by), sort=sort):
        cell: dict[str, Any] = dict(zip(by, key, strict=True))
        values, clipped, unclipped, low, high = (
            group[name].to_numpy(float) for name in ("estimate", "truth", "unclipped_truth", "low", "high")
        )
        generator = bootstrap_stream(seed, purpose, *cell.values())
        statistics = robust(values, generator, 1)
        low_dn, high_dn = frame_interval(
            values, group["frame"].to_numpy(str), robust_median, generator, draws, least=0.0
        )
        rows.append(
            {
                **cell,
                "median_dn": statistics.median,
                "minimum_dn": statistics.minimum,
                "maximum_dn": statistics.maximum,
                "low_dn": low_dn,
                "high_dn": high_dn,
                "clipped_median_dn": float(robust_median(clipped)),
                "unclipped_median_dn": float(robust_median(unclipped)),
                "clipped_error_dn": _known_mean(np.abs(values - clipped)),
                "unclipped_error_dn": _known_mean(np.abs(values - unclipped)),
                "coverage": _known_mean(coverage(low, high, unclipped)),
                "count": statistics.count,
                "rejected": statistics.rejected,
                "abstained": statistics.abstained,
            }
        )
    return pd.DataFrame(rows)


def coverage(
    low: NDArray[np.float64], high: NDArray[np.float64], truth: NDArray[np.float64]
) -> NDArray[np.float64]:  # fmt: skip
    """Whether each interval holds the truth: 1 or 0; NaN where there is no interval.

    Args:
        low: (N,) lower ends of the intervals.
        high: (N,) upper ends.
        truth: (N,).
    """
    held = ((low <= truth) & (truth <= high)).astype(float)
    return np.where(np.isnan(low) | np.isnan(high), np.nan, held)


def mtf_cells(
    measurements: pd.DataFrame,
    by: Sequence[str],
    purpose: str,
    seed: int,
    draws: int,
    *,
    calibrated: bool = False,
    skip_missing: bool = False,
) -> pd.DataFrame:
    """AMAE and what belongs to it, one row for each cell of Table I or of the combined tables.

    Args:
        measurements: of the MTF (`pipeline.experiments.tables.MEASUREMENTS`).
        by: columns that a cell's rows have in common.
        purpose: names the bootstrap's random stream.
        seed: root of the random streams.
        draws: bootstrap resamples of frames, the same for all rotations; 0 for none.
        calibrated: written into that column.
        skip_missing: average over the frequencies and rotations that have an estimate, where a filter was divided out;
            else a cell in which one has none is NaN.

    Returns:
        the cells in the order of their keys; ``frequencies_fraction`` is the fraction of frequencies with an estimate,
        over patches that were not abstained from.
    """
    import pandas as pd

    rows = []
    for key, group in measurements.groupby(list(by), sort=True):
        cell: dict[str, Any] = dict(zip(by, key, strict=True))
        ordered = group.sort_values(["angle_deg", "frame", "patch", "axis", "frequency"])
        shape = (ordered["angle_deg"].nunique(), -1, 2, len(mtf.FREQUENCIES))
        estimates, truth = (ordered[name].to_numpy(float).reshape(shape) for name in ("estimate", "truth"))
        by_patch, truths = estimates.swapaxes(0, 1), truth[:, 0]
        curves = robust_median(by_patch)

        def amae(patches: NDArray[np.float64], truths: NDArray[np.float64] = truths) -> NDArray[np.float64]:
            return _amae(robust_median(patches), truths, skip_missing)

        generator = bootstrap_stream(seed, purpose, *cell.values())
        frames = ordered["frame"].to_numpy(str).reshape(shape)[0, :, 0, 0]
        low, high = frame_interval(by_patch, frames, amae, generator, draws, least=0.0)
        patches = group[~group["abstained"].to_numpy(bool)]
        estimated = patches[patches["estimate"].notna()]
        error = (estimated["estimate"] - estimated["truth"]).abs()
        held = coverage(*(estimated[name].to_numpy(float) for name in ("low", "high", "truth")))
        points = 2 * len(mtf.FREQUENCIES)
        rows.append(
            {
                **cell,
                "relative_to": str(group["relative_to"].iloc[0]),
                "calibrated": calibrated,
                "amae_percent": float(_amae(curves, truths, skip_missing)),
                "low_percent": low,
                "high_percent": high,
                "patch_error_percent": 100 * float(error.mean()) if len(error) else _NAN,
                "coverage": _known_mean(held),
                "angles": shape[0],
                "count": len(patches) // points,
                "abstained": (len(group) - len(patches)) // points,
                "smoothed_fraction": float(group["smoothed"].mean()),
                "frequencies_fraction": len(estimated) / len(patches) if len(patches) else _NAN,
                "mae_h_percent": float(_amae(curves[:, [0, 0]], truths[:, [0, 0]], True)),
                "mae_v_percent": float(_amae(curves[:, [1, 1]], truths[:, [1, 1]], True)),
                "expected_amae_percent": _NAN,
            }
        )
    return pd.DataFrame(rows)


def condition_medians(
    measured: pd.DataFrame, seed: int, draws: int, scene_of: Callable[[str], str] = str
) -> pd.DataFrame:
    """Noise and MTF of every condition of a detection sweep: medians with 95 % intervals over scenes.

    Args:
        measured: `pipeline.experiments.tables.MEASURED`.
        seed: root of the bootstrap's streams.
        draws: bootstrap resamples of scenes.
        scene_of: frame -> its scene; frames of one scene are resampled together. Every frame has its own by default.

    Returns:
        `pipeline.experiments.tables.CONDITIONS`.
    """
    import pandas as pd

    rows = []
    groups: Any = measured.groupby(list(CONDITION), sort=False)
    for key, group in groups:
        row: dict[str, Any] = dict(zip(CONDITION, key, strict=True))
        for quantity, short, unit, count in (("sigma_dn", "sigma", "_dn", "tiles"), ("mtf", "mtf", "", "patches")):
            part = group[group["quantity"] == quantity]
            values = part["estimate"].to_numpy(float)
            generator = stream(seed, "condition medians", quantity, *key)
            scenes = part["frame"].map(scene_of).to_numpy(str)
            low, high = frame_interval(values, scenes, median, generator, draws, least=0.0)
            row |= {f"{short}{unit}": float(median(values)), f"{short}_low{unit}": low, f"{short}_high{unit}": high}
            truth = "clipped_sigma_dn" if quantity == "sigma_dn" else "true_mtf"
            row[truth] = float(part["true"].median())
            row |= {count: len(part), f"{count}_abstained": int(part["abstained"].sum())}
        rows.append(row)
    return CONDITIONS.conform(pd.DataFrame(rows, columns=list(CONDITIONS.columns)))


def _amae(curves: NDArray[np.float64], truths: NDArray[np.float64], skip_missing: bool) -> NDArray[np.float64]:
    """AMAE in percent, averaged over rotations: (..., rotations, 2, 8) -> (...)."""
    each = mtf.amae(curves, truths, skip_missing=skip_missing)
    if not skip_missing:
        return np.asarray(each.mean(axis=-1))
    known = np.isfinite(each)
    total = np.where(known, each, 0.0).sum(axis=-1)
    count = known.sum(axis=-1)
    return np.where(count == 0, np.nan, total / np.maximum(count, 1))


def _known_mean(values: NDArray[np.float64]) -> float:
    """Mean of those that are numbers; NaN where none is."""
    return float(np.nanmean(values)) if np.isfinite(values).any() else _NAN
