"""The benchmark of noise behind codecs: shots, truth and counts are what it says."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import pytest

from benchmarks import coded_noise
from pipeline.camera.processing.codec import Codec
from pipeline.errors import InputError

if TYPE_CHECKING:
    from pathlib import Path


def test_truth_without_a_codec_is_the_noise_added():
    frame = np.full((160, 192), 120, np.uint8)
    taken = coded_noise.shots(frame, Codec("none"), 5.0, "flat")
    places = coded_noise.places(frame.shape, 3, np.random.default_rng(1))
    assert taken.shape == (coded_noise.SHOTS, 160, 192)
    assert coded_noise.true_dn(taken, places) == pytest.approx(5.0, rel=0.02)
    assert np.array_equal(taken, coded_noise.shots(frame, Codec("none"), 5.0, "flat"))


@pytest.mark.parametrize("codec", [Codec("jpeg", 60), Codec("h264", 23)])
def test_frames_without_noise_come_back_alike_from_a_codec(codec):
    frame = np.tile(np.linspace(20, 220, 192), (160, 1)).astype(np.uint8)
    taken = coded_noise.shots(frame, codec, 0.0, "ramp")
    assert coded_noise.true_dn(taken, coded_noise.places(frame.shape, 2, np.random.default_rng(1))).max() == 0


@pytest.mark.parametrize(
    ("name", "shape"),
    [("scaled 0.7", (112, 134)), ("aliased 0.5", (80, 96)), ("turned", (160, 192)), ("nlm", (160, 192))],
)
def test_shots_are_filtered(name, shape):
    frame = np.full((160, 192), 120, np.uint8)
    taken = coded_noise.shots(frame, name, 8.0, "flat")
    assert taken.shape == (coded_noise.SHOTS, *shape) and taken.dtype == np.uint8
    assert 0 < np.sqrt(taken.var(axis=0, ddof=1).mean()) < 7


def test_sharpening_makes_noise_stronger():
    taken = coded_noise.shots(np.full((160, 192), 120, np.uint8), "sharpened", 5.0, "flat")
    assert np.sqrt(taken.var(axis=0, ddof=1).mean()) == pytest.approx(5.0 * np.sqrt(3**2 + 4 * 0.5**2), rel=0.02)


def test_noise_of_linear_light_lies_in_the_shadows():
    frame = np.repeat(np.array([[40, 200]], np.uint8), 96, axis=1).repeat(160, axis=0)
    for name, ratio in (("photons 2.2", (40 / 200) ** 0.1), ("readout 2.2", (40 / 200) ** 1.2)):
        taken = coded_noise.shots(frame, name, 4.0, "two greys", name)
        deviation = np.sqrt(taken.var(axis=0, ddof=1).reshape(160, 2, 96).mean(axis=(0, 2)))
        assert np.sqrt((deviation**2).mean()) == pytest.approx(4.0, rel=0.03)
        assert deviation[1] / deviation[0] == pytest.approx(ratio, rel=0.06)
    assert not coded_noise.shots(frame, "readout 2.2", 0.0, "none").var(axis=0).any()


def test_answers_are_counted():
    nan = np.nan
    table = pd.DataFrame(
        [(5.0, 5.9, 5.0, 7.0, "", 0.05, 7.0), (5.0, 6.1, 5.5, 7.0, "", 0, 7.0), (0.4, 0.0, 0.0, 0.5, "", 0, 0.5),
         (5.0, nan, nan, nan, "compressed", 0, 6.0), (5.0, nan, nan, nan, "compressed", 0, 4.0),
         (5.0, nan, nan, nan, "uncertain", 0, nan), (5.0, nan, nan, nan, "uncertain", 0, nan),
         (5.0, 9.0, 8.0, 9.9, "", 0.06, 9.9)],
        columns=["true_dn", "sigma_dn", "low_dn", "high_dn", "reason", "saturated", "at_most_dn"],
    )  # fmt: skip
    counts = coded_noise.summarised(table)
    assert (counts["count"], counts["answered"], counts["wrong"], counts["saturated"]) == (7, 3, 1, 1)
    assert counts["held_fraction"] == pytest.approx(2 / 3, abs=1e-4)
    assert counts["compressed_fraction"] == 0.5
    assert (counts["bounded"], counts["bound_dn"], counts["bound_held_fraction"]) == (2, 5.0, 0.5)


def test_black_and_white_pixels_are_saturated():
    patches = np.full((2, 1, 4, 4), 0.5, np.float32)
    patches[1, 0, 0] = 0, 1, 0.004, 0.996
    assert coded_noise.saturated_fraction(patches).tolist() == [0, 2 / 16]


def test_a_dataset_is_named_by_kind_and_folder(tmp_path: Path):
    for text in ("kitti", "kitti=", "=kitti:x"):
        with pytest.raises(InputError, match="expected NAME=KIND:ROOT"):
            coded_noise.parse(text)
    with pytest.raises(InputError, match="no folder"):
        coded_noise.parse(f"kitti=kitti:{tmp_path / 'none'}")
