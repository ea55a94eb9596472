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
from pipeline.noise.evaluation import coverage, evaluate_frame, metrics, saturated_share, summarise


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


def test_the_noise_as_added_is_kept_beside_what_clipping_left(rows):
    dcsn = rows[(rows["effect"] == "dcsn") & (rows["level_dn"] == 10)]
    assert np.allclose(dcsn["added_sigma_dn"], 10, atol=0.3)  # in the saturated tile too
    assert dcsn["true_sigma_dn"].iloc[0] < 0.7 * dcsn["added_sigma_dn"].iloc[0]
    photon = rows[(rows["effect"] == "photon") & (rows["level_dn"] == 10)]
    assert photon["added_sigma_dn"].iloc[0] == photon["added_sigma_dn"].max() > 11  # white has the most photons
    assert (rows.loc[rows["level_dn"] == 0, "added_sigma_dn"] == 0).all()


def test_the_saturated_share_is_that_of_the_sharp_frame(rows):
    assert (rows.loc[rows["patch"] == 0, "saturated_share"] > 0.95).all()
    assert (rows.loc[rows["patch"] > 1, "saturated_share"] < 0.3).all()
    halves = np.zeros((2, 1, 4, 4), np.float32) + 0.5
    halves[0, 0, :2] = 1.0
    halves[0, 0, 3] = 0.4 / 255
    assert saturated_share(halves).tolist() == [0.75, 0.0]


def test_coverage_counts_intervals_that_hold_the_noise_added(rows):
    assert coverage(rows).isna().all()  # PCA has none
    assert np.isnan(summarise(rows, 1, 10)["coverage"]).all()
    told = rows.copy()
    told["low_dn"], told["high_dn"] = told["added_sigma_dn"] - 1, told["added_sigma_dn"] + 1
    away = told["patch"] == 1
    told.loc[away, ["low_dn", "high_dn"]] += 5
    told.loc[told["patch"] == 2, ["low_dn", "high_dn"]] = np.nan
    summary = summarise(told, 1, 10)
    assert np.allclose(summary["coverage"], 4 / 5)
    assert metrics(summary)["dcsn"]["10"]["coverage"] == pytest.approx(0.8)
    assert "coverage" not in metrics(summarise(rows, 1, 10))["dcsn"]["10"]


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
