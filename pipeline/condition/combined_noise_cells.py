"""Statistics of the noise read under blur: sigma over kernels and levels, its error and intervals."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.blur.evaluation import robust_median
from pipeline.condition.combined_tables import NOISE_CELLS
from pipeline.noise.evaluation import columns, coverage, known_mean
from pipeline.statistics import robust
from pipeline.streams import stream

if TYPE_CHECKING:
    import pandas as pd

NOISE_CELL = ["dataset", "estimator", "experiment", "kind", "size_px", "effect", "level_dn"]


def noise_cells(read: pd.DataFrame, seed: int, draws: int) -> pd.DataFrame:
    """Robust statistics of the noise read, per estimator, experiment, kernel size and level.

    Args:
        read: `NOISE_READ`.
        seed: root of the bootstrap's streams.
        draws: bootstrap resamples.

    Returns:
        `NOISE_CELLS`.
    """
    import pandas as pd

    rows = []
    for key, group in read.groupby(NOISE_CELL, sort=True):
        cell: dict[str, Any] = dict(zip(NOISE_CELL, key, strict=True))
        values, true, added = (group[name].to_numpy(float) for name in ("sigma_dn", "true_sigma_dn", "added_sigma_dn"))
        found = robust(values, stream(seed, "bootstrap", "combined noise", *cell.values()), draws)
        rows.append(
            {
                **cell,
                **columns(found),
                "true_median_dn": float(robust_median(true)),
                "added_median_dn": float(robust_median(added)),
                "patch_error_dn": known_mean(np.abs(values - added)),
                "coverage": known_mean(coverage(group).to_numpy(float)),
            }
        )
    return NOISE_CELLS.conform(pd.DataFrame(rows, columns=list(NOISE_CELLS.columns)))
