"""Summaries: an estimator that returns the truth scores zero, a camera's own blur is divided out, intervals repeat."""

import numpy as np
import pandas as pd
import pytest
from data_makers import make_folder

from pipeline import datasets
from pipeline.blur.base import BlurEstimate
from pipeline.camera import mtf
from pipeline.camera.psf.defocus import create as defocus
from pipeline.camera.psf.kernel import Kernel
from pipeline.camera.psf.linear_motion import create as motion
from pipeline.errors import InputError
from pipeline.experiments.calibrate import divided_by_sharp
from pipeline.experiments.condition import grid, sharp_kernel
from pipeline.experiments.frames import of_dataset
from pipeline.experiments.metrics import table_one_metrics
from pipeline.experiments.run import Method, run
from pipeline.experiments.summarise import coverage
from pipeline.experiments.table_one import summarise
from pipeline.streams import stream

KERNELS = [
    sharp_kernel(),
    Kernel("defocus_7", "defocus", 7, 0, defocus(7.0)),
    *(Kernel(f"linear_motion_7_{angle}", "linear_motion", 7, angle, motion(7.0, angle)) for angle in (0, 45)),
]


class Knowing:
    """Returns the true MTF of each kernel in turn, times the camera's own."""

    def __init__(self, system):
        self.system, self.turn = system, 0

    def estimate(self, patches):
        value = np.repeat((mtf.sample(KERNELS[self.turn % len(KERNELS)].psf) * self.system)[None], len(patches), 0)
        self.turn += 1
        count = len(patches)
        return BlurEstimate(value, np.zeros(count, bool), np.full(count, ""), low=value - 0.1, high=value + 0.1)


@pytest.fixture(scope="module")
def estimates(tmp_path_factory):
    root = make_folder(tmp_path_factory.mktemp("frames"), 2)
    frames = of_dataset(datasets.open_dataset("folder", "mine", root))
    return run(frames, grid(KERNELS), [Method("knowing", "mtf", Knowing(0.8))])


def test_every_patch_kernel_axis_and_frequency_has_a_row(estimates):
    patches = estimates[["frame", "patch"]].drop_duplicates()
    assert len(estimates) == len(patches) * len(KERNELS) * 16
    assert estimates["frequency"].nunique() == 8 and set(estimates["axis"]) == {"H", "V"}
    one = estimates[(estimates.kernel == "defocus_7") & (estimates.patch == 0) & (estimates.axis == "V")]
    assert np.allclose(one["truth"].to_numpy()[:8], mtf.sample(defocus(7.0))[1])


def test_blur_along_rows_is_the_horizontal_one(estimates):
    along = estimates[(estimates.kernel == "linear_motion_7_0") & (estimates.patch == 0)]
    frame = along[along["frame"] == along["frame"].iloc[0]]
    for axis, exact in zip("HV", mtf.sample(motion(7.0, 0)), strict=True):
        for column, factor in (("truth", 1.0), ("estimate", 0.8)):
            assert frame.loc[frame["axis"] == axis, column].to_numpy() == pytest.approx(factor * exact)
    assert frame.loc[frame["axis"] == "H", "truth"].min() < 0.2 < frame.loc[frame["axis"] == "V", "truth"].min()


def test_the_cameras_own_blur_is_divided_out(estimates):
    raw = summarise(estimates, 1, 20)
    relative = summarise(divided_by_sharp(estimates), 1, 20, calibrated=True)
    assert (relative["amae_percent"] < 1e-6).all() and relative["calibrated"].all()
    motion_row = raw[raw.blur_kind == "linear_motion"].iloc[0]
    truths = [mtf.sample(kernel.psf) for kernel in KERNELS[2:]]
    assert motion_row["amae_percent"] == pytest.approx(20 * np.mean(truths), rel=1e-6)
    assert motion_row["angles"] == 2 and motion_row["low_percent"] == pytest.approx(motion_row["high_percent"])
    assert raw["coverage"].between(0, 1).all() and (raw["abstained"] == 0).all()


def test_the_cameras_own_blur_is_that_of_sharp_frames_without_noise(estimates):
    """Noise moves what an estimator reads of them."""
    noisy = estimates[estimates.kernel == "sharp"].assign(target_sigma_dn=20.0)
    noisy["estimate"] /= 2
    both = divided_by_sharp(pd.concat([estimates, noisy, noisy, noisy], ignore_index=True))
    alone = divided_by_sharp(estimates)
    assert both["estimate"].to_numpy()[: len(alone)] == pytest.approx(alone["estimate"].to_numpy())
    assert both["estimate"].to_numpy()[len(alone) :] == pytest.approx(0.5)


def test_an_interval_that_ends_at_the_truth_holds_it():
    """Of a patch without noise whose interval begins at zero."""
    held = coverage(np.array([0.0, 1.0, np.nan]), np.array([2.0, 3.0, 1.0]), np.array([0.0, 3.0, 0.5]))
    assert np.array_equal(held, [1.0, 1.0, np.nan], equal_nan=True)


def test_calibration_needs_the_sharp_frame(estimates):
    with pytest.raises(InputError, match="measure with the kernel 'sharp'"):
        divided_by_sharp(estimates[estimates.kernel != "sharp"])


def test_abstentions_are_counted_and_left_out(estimates):
    some = estimates.copy()
    gone = (some.patch == 0) & (some.frame == some.frame.iloc[0])
    some.loc[gone, ["estimate", "low", "high"]] = np.nan
    some.loc[gone, "abstained"] = True
    summary = summarise(divided_by_sharp(some), 1, 0)
    row = summary[summary.blur_kind == "defocus"].iloc[0]
    total = estimates[["frame", "patch"]].drop_duplicates()
    assert row["abstained"] == 1 and row["count"] == len(total) - 1 and row["amae_percent"] < 1e-6


def test_bootstrap_intervals_hold_the_value_and_are_repeatable(estimates):
    rough = estimates.copy()
    rough["estimate"] = (rough["estimate"] + stream(1, "e").normal(0, 0.05, len(rough))).clip(0, 1)
    one, two = (summarise(rough, 1, 100) for _ in range(2))
    pd.testing.assert_frame_equal(one, two)
    assert (one["low_percent"] <= one["amae_percent"]).all() and (one["amae_percent"] <= one["high_percent"]).all()
    assert (one["low_percent"] < one["high_percent"]).all() and (one["patch_error_percent"] > 0).all()


def test_metrics_are_nested_and_leave_the_sharp_frame_out(estimates):
    summary = pd.concat([summarise(estimates, 1, 0),
                         summarise(divided_by_sharp(estimates), 1, 0, calibrated=True)])  # fmt: skip
    result = table_one_metrics(summary)
    assert set(result) == {"raw", "calibrated"} and "sharp" not in result["raw"]
    cells = [result["raw"][kind]["7"]["amae_percent"] for kind in ("defocus", "linear_motion")]
    assert result["raw"]["mean_amae_percent"] == pytest.approx(np.mean(cells))
