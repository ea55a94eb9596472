"""The mean AMAE over several kernels with its interval: frames are resampled once for all kernels.

    mean AMAE = mean over cells of (mean over the kernels of a cell of AMAE)

A cell of Table I is a kind and size of blur and holds its rotations. The AMAE of one kernel is that of the robust
median over all patches (`pipeline.experiments.summarise`). Every kernel blurred the same frames, so that their errors
share what these frames show: intervals of single cells cannot be joined to that of their mean.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pipeline.camera import mtf
from pipeline.experiments.intervals import bootstrap_stream, frame_interval, robust_median

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

DRAWS = 200
CELL = ("blur_kind", "kernel_size_px")
KERNEL = ("blur_kind", "kernel_size_px", "angle_deg", "kernel")
MEASURES = ["amae_percent", "patch_error_percent", "coverage"]


def mean_errors(cells: pd.DataFrame, measurements: pd.DataFrame, seed: int, purpose: Sequence[str]) -> dict[str, float]:
    """Means over cells, and the interval of that of the AMAE, with four decimals.

    Args:
        cells: `pipeline.experiments.table_one.summarise` of the measurements.
        measurements: see `interval_percent`.
        seed: see there.
        purpose: see there.

    Returns:
        `MEASURES`, then ``amae_low_percent`` and ``amae_high_percent``.
    """
    low, high = interval_percent(measurements, seed, purpose)
    means = {**cells[MEASURES].mean().to_dict(), "amae_low_percent": low, "amae_high_percent": high}
    return {str(key): round(float(value), 4) for key, value in means.items()}


def interval_percent(measurements: pd.DataFrame, seed: int, purpose: Sequence[str]) -> tuple[float, float]:
    """Ends of the 95 % interval of the mean AMAE, over frames.

    Args:
        measurements: of the MTF of one estimator (`pipeline.experiments.tables.MEASUREMENTS`), every patch under every
            kernel.
        seed: root of the random streams.
        purpose: names the bootstrap's random stream.

    Returns:
        lower and upper end, percent; NaN with fewer than two frames that hold an estimate.
    """
    ordered = measurements.sort_values([*KERNEL, "frame", "patch", "axis", "frequency"])
    kernels = ordered[list(KERNEL)].drop_duplicates()
    shape = (len(kernels), -1, 2, len(mtf.FREQUENCIES))
    estimates, truth = (ordered[name].to_numpy(float).reshape(shape) for name in ("estimate", "truth"))
    frames = ordered["frame"].to_numpy(str).reshape(shape)[0, :, 0, 0]
    in_cell = kernels.groupby(list(CELL))["kernel"].transform("size").to_numpy(float)
    weights = 1.0 / in_cell / len(kernels[list(CELL)].drop_duplicates())

    def mean_amae(patches: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(mtf.amae(robust_median(patches), truth[:, 0]) @ weights)

    generator = bootstrap_stream(seed, "mean AMAE", *purpose)
    return frame_interval(estimates.swapaxes(0, 1), frames, mean_amae, generator, DRAWS, least=0.0)
