"""How well a noise estimator does on one frame: every source and level, tile by tile, beside the truth.

The paper's noise figure (Wischow et al. 2023, Sec. IV-B): noise of one source is scaled to a level, the estimator
sees 128 x 128 px tiles, and the robust median, minimum and maximum over all tiles are drawn over the level. Beside
the level asked for, each tile keeps the standard deviation of the noise that is really in it: clipping and, for photon
noise, local brightness make the two differ, and an estimator must be judged by the noise it was shown. An estimator
that undoes the clipping is judged by the noise as the sensor added it, which each tile keeps as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.truth import local_sigma
from pipeline.datasets.corrupted import CameraSettings, corrupted
from pipeline.datasets.patches import Patch, cut
from pipeline.noise.base import WHITE_DN, NoiseEstimator
from pipeline.statistics import Robust, robust
from pipeline.streams import stream

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.datasets.frame import Frame


def evaluate_frame(
    frame: Frame,
    tiles: Sequence[Patch],
    estimator: NoiseEstimator,
    effects: Sequence[str],
    levels_dn: Sequence[float],
    camera: CameraSettings,
    seed: int,
) -> list[dict[str, Any]]:
    """Estimate the noise of every tile of one frame under every effect and level.

    Args:
        frame: a sharp frame.
        tiles: where to look.
        estimator: takes (N, 1, H, W).
        effects: names of noise sources, as in `pipeline.camera.chain`.
        levels_dn: standard deviations asked for, DN.
        camera: the camera that adds the noise.
        seed: root of the random streams; the noise depends on dataset, frame, effect and level only.

    Returns:
        rows of `pipeline.tables.NOISE_ESTIMATES`, but for the estimator's name.
    """
    sharp = frame.image()
    saturated = saturated_share(cut(sharp, tiles))
    rows: list[dict[str, Any]] = []
    for effect in effects:
        for level in levels_dn:
            shown = corrupted(sharp, frame, effect, level, camera, seed)
            truth, added = local_sigma(shown, tiles), local_sigma(shown, tiles, "before")
            estimate = estimator.estimate(cut(shown.image, tiles))
            for index in range(len(tiles)):
                rows.append(
                    {
                        "dataset": frame.dataset,
                        "effect": effect,
                        "level_dn": float(level),
                        "frame": frame.name,
                        "patch": index,
                        "true_sigma_dn": float(truth[index]),
                        "added_sigma_dn": float(added[index]),
                        "saturated_share": float(saturated[index]),
                        "sigma_dn": float(estimate.sigma_dn[index]),
                        "low_dn": float(estimate.low_dn[index]),
                        "high_dn": float(estimate.high_dn[index]),
                        "abstained": bool(estimate.abstained[index]),
                        "reason": str(estimate.reason[index]),
                    }
                )
    return rows


def saturated_share(patches: NDArray[np.float32]) -> NDArray[np.float64]:
    """Share of each patch's pixels within half a DN of black or white.

    Args:
        patches: (N, 1, H, W) in [0, 1].

    Returns:
        (N,) shares.
    """
    edge = 0.5 / WHITE_DN
    clipped: NDArray[np.float64] = ((patches <= edge) | (patches >= 1.0 - edge)).mean(axis=(1, 2, 3))
    return clipped


def coverage(estimates: pd.DataFrame) -> pd.Series:
    """Whether each interval holds the noise as added: 1 or 0; NaN where there is no interval.

    Args:
        estimates: `pipeline.tables.NOISE_ESTIMATES`.
    """
    low, high, added = (estimates[name] for name in ("low_dn", "high_dn", "added_sigma_dn"))
    held = ((low <= added) & (added <= high)).astype(float)
    return held.where(low.notna() & high.notna())


def summarise(estimates: pd.DataFrame, seed: int, draws: int) -> pd.DataFrame:
    """Robust statistics per dataset, estimator, effect and level.

    Args:
        estimates: `pipeline.tables.NOISE_ESTIMATES`.
        seed: root of the bootstrap's streams.
        draws: bootstrap resamples.

    Returns:
        `pipeline.tables.NOISE_SUMMARY`.
    """
    import pandas as pd

    rows = []
    keys = ["dataset", "estimator", "effect", "level_dn"]
    for cell, group in estimates.groupby(keys, sort=False):
        dataset, estimator, effect, level = cell if isinstance(cell, tuple) else (cell,)
        key = (str(dataset), str(estimator), str(effect), float(str(level)))
        values = group["sigma_dn"].to_numpy(float)
        truth = group["true_sigma_dn"].to_numpy(float)
        found = robust(values, stream(seed, "bootstrap", "noise", *key), draws)
        present = robust(truth, stream(seed, "bootstrap", "noise truth", *key), 1)
        as_added = group["added_sigma_dn"].to_numpy(float)
        added = robust(as_added, stream(seed, "bootstrap", "noise added", *key), 1)
        rows.append(
            {
                **dict(zip(keys, key, strict=True)),
                **columns(found),
                "true_median_dn": present.median,
                "added_median_dn": added.median,
                "patch_error_dn": known_mean(np.abs(values - truth)),
                "added_error_dn": known_mean(np.abs(values - as_added)),
                "coverage": known_mean(coverage(group).to_numpy(float)),
            }
        )
    return pd.DataFrame(rows)


def columns(found: Robust) -> dict[str, Any]:
    """The columns of a table of noise that say what its cell's estimates, DN, come to."""
    return {
        "median_dn": found.median,
        "minimum_dn": found.minimum,
        "maximum_dn": found.maximum,
        "low_dn": found.low,
        "high_dn": found.high,
        "count": found.count,
        "rejected": found.rejected,
        "abstained": found.abstained,
    }


def known_mean(values: NDArray[np.float64]) -> float:
    """Mean of those that are numbers; NaN where none is."""
    return float(np.nanmean(values)) if np.isfinite(values).any() else float("nan")


def metrics(summary: pd.DataFrame) -> dict[str, Any]:
    """What continuous integration compares: medians, errors, abstentions and coverage, nested by effect and level.

    A cell in which all tiles were abstained from has its counts only.

    Args:
        summary: `pipeline.tables.NOISE_SUMMARY` of one dataset and estimator.
    """
    nested: dict[str, Any] = {}
    for row in summary.to_dict("records"):
        cell = nested.setdefault(str(row["effect"]), {})
        names = ("median_dn", "true_median_dn", "patch_error_dn", "coverage")
        numbers = {name: row[name] for name in names if np.isfinite(row[name])}
        cell[f"{row['level_dn']:g}"] = {**numbers, "abstained": int(row["abstained"]), "count": int(row["count"])}
    return nested
