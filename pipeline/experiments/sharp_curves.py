"""MTF that each blur estimator measures on sharp frames: robust median and range over patches at every frequency."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.experiments.intervals import frame_interval, robust_median
from pipeline.statistics import inliers
from pipeline.streams import stream

if TYPE_CHECKING:
    import pandas as pd

NOMINAL_FREQUENCIES = (0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6)
"""The paper's names of its eight frequencies (`pipeline.camera.mtf.FREQUENCIES`, 0.054 to 0.595)."""


def sharp_curves(estimates: pd.DataFrame, seed: int = 0, draws: int = 500) -> pd.DataFrame:
    """Median and range of the inliers over the patches of sharp frames.

    Args:
        estimates: `pipeline.experiments.tables.BLUR_ESTIMATES`; rows of other kernels are ignored.
        seed: root of the bootstrap's random streams.
        draws: bootstrap resamples of frames.

    Returns:
        dataset, estimator, axis (H, V), frequency (one of `NOMINAL_FREQUENCIES`), place (its number, from 0), median,
        min, max, low and high (95 % interval of the median, frames resampled), count (patches with an estimate),
        rejected and abstained (patches).
    """
    import pandas as pd

    from pipeline.experiments.condition import SHARP

    columns = ["dataset", "estimator", "axis", "frequency", "place", "median", "min", "max", "low", "high"]
    rows = []
    sharp = estimates[estimates["kernel"] == SHARP]
    groups: Any = sharp.groupby(["dataset", "estimator", "axis"], sort=True)
    for (dataset, estimator, axis), curve in groups:
        for number, (_, point) in enumerate(curve.groupby("frequency", sort=True)):
            values = point["mtf"].to_numpy(float)
            generator = stream(seed, "bootstrap", "sharp curves", dataset, estimator, axis, number)
            low, high = frame_interval(values, point["frame"].to_numpy(str), robust_median, generator, draws)
            answers = values[np.isfinite(values)]
            kept = answers[inliers(answers)] if answers.size else np.array([np.nan])
            rows.append(
                {
                    "dataset": dataset,
                    "estimator": estimator,
                    "axis": axis,
                    "frequency": NOMINAL_FREQUENCIES[number],
                    "place": number,
                    "median": float(np.median(kept)),
                    "min": float(kept.min()),
                    "max": float(kept.max()),
                    "low": low,
                    "high": high,
                    "count": answers.size,
                    "rejected": answers.size - (kept.size if answers.size else 0),
                    "abstained": int(point["abstained"].sum()),
                }
            )
    return pd.DataFrame(rows, columns=[*columns, "count", "rejected", "abstained"])
