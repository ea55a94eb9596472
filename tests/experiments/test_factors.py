"""Factors behind Table I: storage as JPEG, dark borders, and effects that are recovered where they are known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.camera import authors, mtf
from pipeline.camera.psf.kernel import Kernel
from pipeline.camera.psf.linear_motion import create as motion
from pipeline.datasets.frame import Frame
from pipeline.errors import InputError
from pipeline.experiments import factors
from pipeline.experiments.condition import Condition
from pipeline.experiments.frames import TestFrame
from pipeline.streams import stream

LINE = Kernel("line", "linear_motion", 3.0, 0.0, np.asarray(motion(3.0, 0.0), np.float32))


def column(settings: dict[str, str], error: float, frames: int = 4) -> factors._Column:
    """An estimator whose every estimate misses a flat MTF of one half by as much."""
    truth = np.full((1, 2, 8), 0.5)
    estimates = {f"f{number}": np.full((2, 1, 2, 8), 0.5 + error) for number in range(frames)}
    return factors._Column("photos", "pmp", settings, ("defocus", 3.0), estimates, truth, 2 * frames, 0)


def test_jpeg_changes_a_small_kernel_and_keeps_its_sum() -> None:
    kernel = np.pad(np.asarray(motion(3.0, 30.0), float), 11)
    stored = factors.through_jpeg(kernel)
    assert stored.shape == kernel.shape and stored.sum() == pytest.approx(1)
    assert mtf.amae(mtf.sample(stored), mtf.sample(kernel)) > 2.0  # ringing about the support
    finest = factors.through_jpeg(kernel, 100)
    assert mtf.amae(mtf.sample(finest), mtf.sample(kernel)) < mtf.amae(mtf.sample(stored), mtf.sample(kernel))


def test_the_dark_boundary_is_the_authors_blur() -> None:
    sharp = stream(1, "test", "dark").uniform(size=(40, 50)).astype(np.float32)
    formed = factors.DarkBoundary()(sharp, Frame("photos", "a", Path("a.png")), Condition(LINE), 1)
    expected = authors.blur_8bit(np.rint(sharp.astype(float) * 255), LINE.psf)
    assert np.array_equal(np.rint(formed.image * 255), expected)
    assert formed.true_mtf == pytest.approx(mtf.sample(LINE.psf))
    assert np.all(formed.clipped_sigma_dn([]) == 0)


def test_a_known_effect_is_recovered_over_all_combinations_of_the_others() -> None:
    columns = [
        column({"storage": storage, "kernel_px": size}, 0.02 + 0.1 * (storage == "JPEG") + 0.03 * (size == "31 px"))
        for storage in factors.SETTINGS["storage"]
        for size in factors.SETTINGS["kernel_px"]
    ]
    effects = factors._Columns(columns, 50, 1).effects()
    whole = effects[effects["blur_kind"] == factors.ALL].set_index("factor")
    assert list(whole.index) == ["kernel_px", "storage"]  # a factor with one setting has no effect to state
    assert whole.loc["storage", "effect_percent"] == pytest.approx(10.0)
    assert whole.loc["kernel_px", "effect_percent"] == pytest.approx(3.0)
    assert whole.loc["storage", "first_percent"] == pytest.approx(3.5)  # mean of 2 and 5
    assert whole.loc["storage", "low_percent"] == pytest.approx(10.0) == whole.loc["storage", "high_percent"]
    assert set(effects.loc[effects["kernel_size_px"] == 3.0, "blur_kind"]) == {"defocus"}


def test_the_interval_covers_frames_that_disagree() -> None:
    first, second = column({"storage": "as estimated"}, 0.0), column({"storage": "JPEG"}, 0.1)
    second.estimates["f0"][:] = 0.9  # one frame is hit harder
    row = factors._Columns([first, second], 200, 1).effects().iloc[0]
    assert row["low_percent"] <= row["effect_percent"] <= row["high_percent"]
    assert row["high_percent"] > row["low_percent"]


def test_patches_of_other_frames_are_refused() -> None:
    frames = {name: [TestFrame(Frame("photos", name, Path("a.png")), {"mtf": []})] for name in ("objects", "grid")}
    with pytest.raises(InputError, match="different frames"):
        factors.measure(frames, [LINE], ())
