"""Evaluation of noise estimators: truth beside every answer, statistics that count abstentions."""

from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest
from data_makers import picture

from pipeline import noise, tables
from pipeline.datasets.corrupted import CameraSettings
from pipeline.datasets.frame import Frame
from pipeline.datasets.patches import tiles
from pipeline.noise.evaluation import evaluate_frame, metrics, summarise


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    path = tmp_path_factory.mktemp("frame") / "a.png"
    smooth = cv2.GaussianBlur(picture("a"), (0, 0), 2)
    smooth[:128, :128] = 255  # one saturated tile
    cv2.imwrite(str(path), smooth)
    squares = tiles((320, 448), 128)
    found = evaluate_frame(
        Frame("made_up", "a", Path(path)),
        squares,
        noise.create("pca"),
        ["dcsn", "photon"],
        [0, 10],
        CameraSettings(),
        1,
    )
    return tables.NOISE_ESTIMATES.conform(pd.DataFrame(found).assign(estimator="pca"))


def test_every_tile_of_every_cell_is_there(rows):
    assert len(rows) == 2 * 2 * 6
    assert rows.groupby(["effect", "level_dn"]).size().eq(6).all()


def test_truth_is_the_noise_really_present(rows):
    dcsn = rows[(rows["effect"] == "dcsn") & (rows["level_dn"] == 10)]
    assert dcsn["true_sigma_dn"].iloc[0] < 7  # half of the saturated tile's noise is clipped away
    assert np.allclose(dcsn["true_sigma_dn"].iloc[1:], 10, atol=0.6)
    assert (rows.loc[rows["level_dn"] == 0, "true_sigma_dn"] < 1e-3).all()


def test_estimates_lie_near_the_truth(rows):
    open_tiles = rows[(rows["patch"] > 0) & (rows["level_dn"] == 10)]
    assert (open_tiles["sigma_dn"] - open_tiles["true_sigma_dn"]).abs().median() < 0.6


def test_abstentions_are_counted_not_dropped(rows):
    clean = rows[(rows["effect"] == "dcsn") & (rows["level_dn"] == 0)]
    assert clean["abstained"].iloc[0]
    assert clean["reason"].iloc[0]
    summary = tables.NOISE_SUMMARY.conform(summarise(rows, 1, 50))
    cell = summary[(summary["effect"] == "dcsn") & (summary["level_dn"] == 0)].iloc[0]
    assert cell["abstained"] == clean["abstained"].sum() >= 1
    assert cell["abstained"] + cell["count"] == 6


def test_metrics_are_nested_by_effect_and_level(rows):
    nested = metrics(summarise(rows, 1, 50))
    assert set(nested) == {"dcsn", "photon"}
    assert set(nested["dcsn"]) == {"0", "10"}
    assert abs(nested["dcsn"]["10"]["median_dn"] - 10) < 1
