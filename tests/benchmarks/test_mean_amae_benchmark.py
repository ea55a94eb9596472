"""The interval of the mean AMAE over kernels: of the mean over cells, frames resampled for all kernels at once."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from benchmarks import mean_amae
from pipeline.camera import mtf
from pipeline.experiments import table_one
from pipeline.experiments.tables import MEASUREMENTS
from pipeline.streams import stream

KERNELS = [("defocus", 3.0, 0.0), *(("linear_motion", size, angle) for size in (3.0, 7.0) for angle in (0.0, 45.0))]
FRAMES, SEED = 12, 3


def measured(errors: np.ndarray) -> pd.DataFrame:
    """Measurements of a patch a frame whose MTF is too high by (kernels, frames) at every frequency."""
    rows = []
    for (kind, size_px, angle_deg), by_frame in zip(KERNELS, errors, strict=True):
        for frame, error in enumerate(by_frame):
            for axis in "HV":
                for number, frequency in enumerate(mtf.FREQUENCIES):
                    truth = 0.9 - 0.1 * number
                    rows.append(
                        {
                            "dataset": "made", "estimator": "made", "kernel": f"{kind}{size_px:g}_{angle_deg:g}",
                            "blur_kind": kind, "kernel_size_px": size_px, "angle_deg": angle_deg, "noise_source": "",
                            "target_sigma_dn": 0.0, "frame": f"{frame:02d}", "patch": 0, "axis": axis,
                            "frequency": frequency, "truth": truth, "estimate": truth + error, "low": truth,
                            "high": truth + 0.5, "abstained": False, "relative_to": "camera", "smoothed": False,
                        }
                    )  # fmt: skip
    frame = pd.DataFrame(rows)
    assert set(frame.columns) <= set(MEASUREMENTS.columns)
    return frame.iloc[::-1]  # whatever the order


def mean_percent(table: pd.DataFrame) -> float:
    return float(table_one.summarise(table, SEED, 0, calibrated=True)["amae_percent"].mean())


def ends_percent(errors: np.ndarray) -> tuple[float, float]:
    return mean_amae.interval_percent(measured(errors), SEED, ("made",))


def test_it_encloses_the_mean_over_cells_whatever_the_rotations_of_each() -> None:
    """One kernel of five is a cell of three: its error counts a third, not a fifth."""
    errors = np.full((len(KERNELS), FRAMES), 0.02)
    errors[0] = 0.05 + 0.01 * stream(SEED, "errors").standard_normal(FRAMES)
    table = measured(errors)
    low, high = mean_amae.interval_percent(table, SEED, ("made",))
    assert low < mean_percent(table) < high
    assert mean_percent(table) == pytest.approx(100 * (np.median(errors[0]) + 2 * 0.02) / 3, abs=0.1)


def test_errors_that_frames_share_do_not_average_out() -> None:
    scatter = 0.02 * stream(SEED, "scatter").standard_normal((len(KERNELS), FRAMES))
    shared = np.broadcast_to(scatter[0], scatter.shape)
    widths = [high - low for low, high in (ends_percent(0.1 + shared), ends_percent(0.1 + scatter))]
    assert widths[0] > 1.5 * widths[1]


def test_it_holds_the_error_of_many_frames() -> None:
    """95 % of intervals of few frames hold the mean AMAE that infinitely many frames would give."""
    held = 0
    for trial in range(60):
        draw = stream(SEED, "trial", trial)
        errors = 0.1 + 0.02 * draw.standard_normal(FRAMES) + 0.01 * draw.standard_normal((len(KERNELS), FRAMES))
        low, high = ends_percent(errors)
        held += low <= 10.0 <= high
    assert 52 <= held <= 60


def test_one_frame_gives_none() -> None:
    assert np.isnan(ends_percent(np.full((len(KERNELS), 1), 0.1))).all()
