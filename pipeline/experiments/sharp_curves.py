"""MTF that each blur estimator measures on sharp frames: robust median and range over patches, and its error."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.camera import mtf
from pipeline.camera.mtf import SYSTEM
from pipeline.experiments.intervals import bootstrap_stream, frame_interval, robust_median
from pipeline.statistics import inliers

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

NOMINAL_FREQUENCIES = (0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6)
"""The paper's names of its eight frequencies (`pipeline.camera.mtf.FREQUENCIES`, 0.054 to 0.595)."""


def sharp_curves(estimates: pd.DataFrame, seed: int = 0, draws: int = 500) -> pd.DataFrame:
    """Median and range of the inliers over the patches of sharp frames.

    Args:
        estimates: `pipeline.experiments.tables.BLUR_ESTIMATES`; rows of other kernels are ignored.
        seed: root of the bootstrap's random streams.
        draws: bootstrap resamples of frames.

    Returns:
        dataset, estimator, axis (H, V), frequency (one of `NOMINAL_FREQUENCIES`), frequency_index (from 0), median,
        min, max, low and high (95 % interval of the median, frames resampled), count (patches with an estimate),
        rejected and abstained (patches).
    """
    import pandas as pd

    from pipeline.experiments.condition import SHARP

    columns = ["dataset", "estimator", "axis", "frequency", "frequency_index", "median", "min", "max", "low", "high"]
    rows = []
    sharp = estimates[estimates["kernel"] == SHARP]
    groups: Any = sharp.groupby(["dataset", "estimator", "axis"], sort=True)
    for (dataset, estimator, axis), curve in groups:
        for number, (_, point) in enumerate(curve.groupby("frequency", sort=True)):
            values = point["mtf"].to_numpy(float)
            generator = bootstrap_stream(seed, "sharp curves", dataset, estimator, axis, number)
            low, high = frame_interval(values, point["frame"].to_numpy(str), robust_median, generator, draws, least=0.0)
            answers = values[np.isfinite(values)]
            kept = answers[inliers(answers)] if answers.size else np.array([np.nan])
            rows.append(
                {
                    "dataset": dataset,
                    "estimator": estimator,
                    "axis": axis,
                    "frequency": NOMINAL_FREQUENCIES[number],
                    "frequency_index": number,
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


def sharp_errors(
    estimates: pd.DataFrame, lenses: Mapping[str, NDArray[np.float64]], seed: int = 0, draws: int = 500
) -> pd.DataFrame:
    """AMAE on sharp frames against the MTF of the lens that took them.

    A sharp frame has been through a lens and a pixel, so an estimate of 1 is wrong there; where the lens is not known
    there is no error to state.

    Args:
        estimates: `pipeline.experiments.tables.BLUR_ESTIMATES`; rows of other kernels are ignored.
        lenses: dataset -> (8,) MTF of its lens and pixel at `pipeline.camera.mtf.FREQUENCIES`, both directions.
        seed: root of the bootstrap's random streams.
        draws: bootstrap resamples of frames.

    Returns:
        dataset, estimator, blur_kind (`pipeline.experiments.condition.SHARP`), kernel_size_px (0), calibrated (False),
        amae_percent, low_percent and high_percent (95 % interval), count and abstained (patches).
    """
    import pandas as pd

    from pipeline.experiments.condition import SHARP

    sharp = estimates[(estimates["kernel"] == SHARP) & estimates["dataset"].isin(list(lenses))]
    rows = []
    groups: Any = sharp.groupby(["dataset", "estimator"], sort=True)
    for (dataset, estimator), group in groups:
        ordered = group.sort_values(["frame", "patch", "axis", "frequency"])
        values = ordered["mtf"].to_numpy(float).reshape(-1, 2, len(NOMINAL_FREQUENCIES))
        frames = ordered["frame"].to_numpy(str)[:: values[0].size]

        def error(patches: NDArray[np.float64], lens: NDArray[np.float64] = lenses[dataset]) -> NDArray[np.float64]:
            return mtf.amae(robust_median(patches), np.broadcast_to(lens, (2, len(lens))))

        generator = bootstrap_stream(seed, "sharp errors", dataset, estimator)
        low, high = frame_interval(values, frames, error, generator, draws, least=0.0)
        rows.append(
            {
                "dataset": dataset,
                "estimator": estimator,
                "blur_kind": SHARP,
                "kernel_size_px": 0.0,
                "relative_to": SYSTEM,
                "calibrated": False,
                "amae_percent": float(error(values)),
                "low_percent": low,
                "high_percent": high,
                "count": int(np.isfinite(values).all(axis=(1, 2)).sum()),
                "abstained": int(ordered["abstained"].to_numpy(bool)[:: values[0].size].sum()),
            }
        )
    return pd.DataFrame(rows)
