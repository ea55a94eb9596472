"""The condition as estimated on objects: where it is measured, that it follows the truth, what an empty frame gives."""

from __future__ import annotations

import dataclasses
from functools import partial

import numpy as np
import pandas as pd
import pytest
from data_makers import make_folder

from pipeline.curves import measured
from pipeline.curves.measured import CONDITIONS, MEASURED, Measurement
from pipeline.datasets.conditions import kernels
from pipeline.datasets.corrupted import CameraSettings
from pipeline.datasets.folder import Folder
from pipeline.detection.classes import CLASS_MAPS
from pipeline.executor import run_map

HOW = Measurement("spectral", "cellwise", 192, 128, 3, lowest_px=25, least_visible=0.3)
LOOK = partial(HOW.look, words=CLASS_MAPS["sim"], effect="dcsn", levels_dn=(0.0, 10.0), camera=CameraSettings(), seed=1)
BLURS = kernels("linear_motion", [0, 11], [0], "nominal", 1)


@pytest.fixture(scope="module")
def frames(tmp_path_factory):
    return Folder("folder", make_folder(tmp_path_factory.mktemp("data"), frames=2)).frames()


@pytest.fixture(scope="module")
def rows(frames):
    return [row for frame in frames for kernel in BLURS for row in LOOK((frame, kernel))]


def test_places_overlap_objects_and_are_at_most_so_many(frames):
    frame = frames[0]  # a car at (40, 130) .. (170, 200), and an ignored traffic light
    patches, over = HOW.places(frame, (320, 448), CLASS_MAPS["sim"])
    assert 0 < len(patches) <= 3 and 0 < len(over) <= 3
    for place in (*patches, *over):
        assert place.x_px < 170 and place.x_px + place.size_px > 40
        assert place.y_px < 200 and place.y_px + place.size_px > 130
    every = dataclasses.replace(HOW, per_frame=None).places(frame, (320, 448), CLASS_MAPS["sim"])[1]
    assert {(tile.x_px, tile.y_px) for tile in over} <= {(tile.x_px, tile.y_px) for tile in every}
    high = dataclasses.replace(HOW, lowest_px=100)  # the car is 70 px high: then there is no object
    assert high.places(frame, (320, 448), CLASS_MAPS["sim"]) == ([], [])


def test_medians_follow_the_noise_and_the_blur_put_in(rows):
    table = MEASURED.conform(pd.DataFrame(rows))
    found = measured.summarise(table, 1, 50)
    assert len(found) == 4 and list(found.columns) == list(CONDITIONS.columns)
    noisy = found[found["level_dn"] == 10]
    assert np.abs(noisy["sigma_dn"] - noisy["true_sigma_dn"]).max() < 1.5
    sharp, blurred = (found[found["kernel"] == kernel.name]["true_mtf"].iloc[0] for kernel in BLURS)
    assert sharp == 1.0 and blurred == pytest.approx(0.5 + 0.5 * np.sinc(11 * 6 / 111), abs=0.01)
    quiet = found[found["level_dn"] == 0].set_index("kernel")["mtf"]
    assert quiet[BLURS[1].name] < quiet["sharp"] - 0.1
    assert ((found["sigma_low_dn"] <= found["sigma_dn"]) & (found["sigma_dn"] <= found["sigma_high_dn"])).all()


def test_workers_change_nothing(frames, rows):
    work = [(frame, kernel) for frame in frames for kernel in BLURS]
    again = [row for found in run_map(LOOK, work, workers=2) for row in found]
    pd.testing.assert_frame_equal(MEASURED.conform(pd.DataFrame(again)), MEASURED.conform(pd.DataFrame(rows)))


def test_a_frame_without_objects_gives_no_row(frames):
    assert LOOK((dataclasses.replace(frames[0], boxes=()), BLURS[0])) == []


def test_an_abstention_is_counted_and_no_number(rows):
    table = MEASURED.conform(pd.DataFrame(rows))
    silent = table.assign(estimate=np.nan, abstained=True)
    found = measured.summarise(silent, 1, 50)
    assert found["sigma_dn"].isna().all() and found["mtf"].isna().all()
    assert (found["tiles_abstained"] == found["tiles"]).all() and (found["tiles"] > 0).all()
