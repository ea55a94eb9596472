"""Noise and MTF as estimated on objects: where they are measured, that they follow the truth, empty frames."""

from __future__ import annotations

import dataclasses

import numpy as np
import pandas as pd
import pytest
from data_makers import make_folder

from pipeline.datasets.folder import Folder
from pipeline.detection.classes import CLASS_MAPS
from pipeline.detection.settings import EvaluationSettings
from pipeline.errors import InputError
from pipeline.executor import run_map
from pipeline.experiments import iopc
from pipeline.experiments.condition import sweep_kernels
from pipeline.experiments.settings import MeasureSettings
from pipeline.experiments.summarise import condition_medians
from pipeline.experiments.tables import CONDITIONS

MEASURE = MeasureSettings(mtf="spectral", sigma="cellwise", patch_px=192, tile_px=128, per_frame=3)
JUDGE = EvaluationSettings(
    rule="paper", iou_threshold=0.5, min_height_px=25, min_visible_fraction=0.3, bootstrap_draws=50
)
WORDS = CLASS_MAPS["sim"]
BLURS = sweep_kernels("linear_motion", [0, 11], [0], "nominal", 1)


def places(frame, measure=MEASURE, criteria=JUDGE):
    (item,) = iopc.on_objects([frame], WORDS, measure, criteria)
    return item.patches["mtf"], item.patches["sigma_dn"]


def look(frames, **options):
    return iopc.measure(iopc.on_objects(frames, WORDS, MEASURE, JUDGE), BLURS, "dcsn", (0.0, 10.0), MEASURE, **options)


@pytest.fixture(scope="module")
def frames(tmp_path_factory):
    return Folder("folder", make_folder(tmp_path_factory.mktemp("data"), frames=2)).frames()


@pytest.fixture(scope="module")
def table(frames):
    return look(frames)


def test_places_overlap_objects_and_are_at_most_so_many(frames):
    frame = frames[0]  # a car at (40, 130) .. (170, 200), and an ignored traffic light
    patches, over = places(frame)
    assert 0 < len(patches) <= 3 and 0 < len(over) <= 3
    for index in (*patches, *over):
        assert index.x_px < 170 and index.x_px + index.size_px > 40
        assert index.y_px < 200 and index.y_px + index.size_px > 130
    every = places(frame, MEASURE.model_copy(update={"per_frame": None}))[1]
    assert {(tile.x_px, tile.y_px) for tile in over} <= {(tile.x_px, tile.y_px) for tile in every}
    # The car is 70 px high: then there is no object.
    assert places(frame, criteria=JUDGE.model_copy(update={"min_height_px": 100})) == ([], [])


def test_medians_follow_the_noise_and_the_blur_put_in(table):
    result = condition_medians(table, 1, 50)
    assert len(result) == 4 and list(result.columns) == list(CONDITIONS.columns)
    noisy = result[result["target_sigma_dn"] == 10]
    assert np.abs(noisy["sigma_dn"] - noisy["clipped_sigma_dn"]).max() < 1.5
    sharp, blurred = (result[result["kernel"] == kernel.name]["true_mtf"].iloc[0] for kernel in BLURS)
    assert sharp == 1.0 and blurred == pytest.approx(0.5 + 0.5 * np.sinc(11 * 6 / 111), abs=0.01)
    quiet = result[result["target_sigma_dn"] == 0].set_index("kernel")["mtf"]
    assert quiet[BLURS[1].name] < quiet["sharp"] - 0.1
    assert ((result["sigma_low_dn"] <= result["sigma_dn"]) & (result["sigma_dn"] <= result["sigma_high_dn"])).all()


@pytest.mark.full("measuring again takes 6 s")
def test_workers_change_nothing(frames, table):
    again = look(frames, executor=lambda function, items, label: run_map(function, items, workers=2))
    pd.testing.assert_frame_equal(again, table)


def test_frames_without_objects_give_no_row_and_none_at_all_are_refused(frames, table):
    empty = dataclasses.replace(frames[0], boxes=())
    assert set(look([empty, frames[1]])["frame"]) == {frames[1].name}
    with pytest.raises(InputError, match="no frame has an object .*its labels say nothing"):
        look([empty])
    others = [dataclasses.replace(frames[0].boxes[0], label=word) for word in ("bus", "tree")]
    buses = dataclasses.replace(frames[0], boxes=tuple(others * 2))
    with pytest.raises(InputError, match=r"no frame has an object .*its labels say 'bus' \(2\), 'tree' \(2\)"):
        look([buses])


def test_an_abstention_is_counted_and_no_number(table):
    silent = table.assign(estimate=np.nan, abstained=True)
    result = condition_medians(silent, 1, 50)
    assert result["sigma_dn"].isna().all() and result["mtf"].isna().all()
    assert (result["tiles_abstained"] == result["tiles"]).all() and (result["tiles"] > 0).all()
