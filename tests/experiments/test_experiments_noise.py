"""Evaluation of noise estimators: truth beside every answer, statistics that count abstentions."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from data_makers import picture

from pipeline import noise as estimators
from pipeline.datasets.frame import Frame
from pipeline.datasets.patches import tiles
from pipeline.experiments import noise
from pipeline.experiments.condition import grid, sharp_kernel
from pipeline.experiments.frames import TestFrame
from pipeline.experiments.metrics import noise_metrics
from pipeline.experiments.run import Method, Registered, run
from pipeline.experiments.summarise import coverage
from pipeline.experiments.tables import measurements_of

SOURCES, LEVELS = ["dcsn", "photon"], [0, 10]


@pytest.fixture(scope="module")
def frames(tmp_path_factory):
    path = tmp_path_factory.mktemp("frame") / "a.png"
    smooth = cv2.GaussianBlur(picture("a"), (0, 0), 2)
    smooth[:128, :128] = 255  # one saturated tile
    cv2.imwrite(str(path), smooth)
    return [TestFrame(Frame("made_up", "a", Path(path)), {"sigma_dn": tiles((320, 448), 128)})]


@pytest.fixture(scope="module")
def rows(frames):
    method = Method("pca", "sigma_dn", Registered(estimators.create, "pca"))
    return run(frames, grid([sharp_kernel()], SOURCES, LEVELS), [method])


class Windowed:
    """Measures behind a window that it multiplies the given pixels by."""

    def estimate(self, patches):
        patches *= np.hanning(patches.shape[-1]).astype(patches.dtype)
        return estimators.create("pca").estimate(patches)


def test_an_estimator_that_works_in_place_does_not_change_those_beside_it(frames, rows):
    windowed = Method("windowed", "sigma_dn", Windowed())
    pca = Method("pca", "sigma_dn", Registered(estimators.create, "pca"))
    both = run(frames, grid([sharp_kernel()], SOURCES, LEVELS), [windowed, pca])
    beside = both[both["estimator"] == "pca"].reset_index(drop=True)
    assert beside["estimate"].equals(rows["estimate"])
    assert not both.loc[both["estimator"] == "windowed", "estimate"].reset_index(drop=True).equals(rows["estimate"])


def test_every_tile_of_every_cell_is_there(rows):
    assert len(rows) == 2 * 2 * 6
    assert rows.groupby(["noise_source", "target_sigma_dn"]).size().eq(6).all()


def test_truth_is_the_noise_really_present(rows):
    dcsn = rows[(rows["noise_source"] == "dcsn") & (rows["target_sigma_dn"] == 10)]
    assert dcsn["truth"].iloc[0] < 7  # half of the saturated tile's noise is clipped away
    assert np.allclose(dcsn["truth"].iloc[1:], 10, atol=0.6)
    assert (rows.loc[rows["target_sigma_dn"] == 0, "truth"] < 1e-3).all()


def test_the_noise_as_added_is_kept_beside_what_clipping_left(rows):
    dcsn = rows[(rows["noise_source"] == "dcsn") & (rows["target_sigma_dn"] == 10)]
    assert np.allclose(dcsn["unclipped_truth"], 10, atol=0.3)  # in the saturated tile too
    assert dcsn["truth"].iloc[0] < 0.7 * dcsn["unclipped_truth"].iloc[0]
    photon = rows[(rows["noise_source"] == "photon") & (rows["target_sigma_dn"] == 10)]
    assert photon["unclipped_truth"].iloc[0] == photon["unclipped_truth"].max() > 11  # white has the most photons
    assert (rows.loc[rows["target_sigma_dn"] == 0, "unclipped_truth"] == 0).all()


def test_the_saturated_fraction_is_that_of_the_sharp_frame(rows):
    assert (rows.loc[rows["patch"] == 0, "saturated_fraction"] > 0.95).all()
    assert (rows.loc[rows["patch"] > 1, "saturated_fraction"] < 0.3).all()


def test_coverage_counts_intervals_that_hold_the_noise_added(rows):
    ends = (rows[name].to_numpy(float) for name in ("low", "high", "unclipped_truth"))
    assert np.isnan(coverage(*ends)).all()  # PCA has none
    assert np.isnan(noise.summarise(rows, 1, 10)["coverage"]).all()
    with_intervals = rows.copy()
    with_intervals["low"], with_intervals["high"] = (
        with_intervals["unclipped_truth"] - 1,
        with_intervals["unclipped_truth"] + 1,
    )
    away = with_intervals["patch"] == 1
    with_intervals.loc[away, ["low", "high"]] += 5
    with_intervals.loc[with_intervals["patch"] == 2, ["low", "high"]] = np.nan
    summary = noise.summarise(with_intervals, 1, 10)
    assert np.allclose(summary["coverage"], 4 / 5)
    assert noise_metrics(summary)["dcsn"]["10"]["coverage"] == pytest.approx(0.8)
    assert "coverage" not in noise_metrics(noise.summarise(rows, 1, 10))["dcsn"]["10"]


def test_estimates_lie_near_the_truth(rows):
    open_tiles = rows[(rows["patch"] > 0) & (rows["target_sigma_dn"] == 10)]
    assert (open_tiles["estimate"] - open_tiles["truth"]).abs().median() < 0.6


def test_abstentions_are_counted_not_dropped(rows):
    clean = rows[(rows["noise_source"] == "dcsn") & (rows["target_sigma_dn"] == 0)]
    assert clean["abstained"].iloc[0] and clean["reason"].iloc[0]
    summary = noise.summarise(rows, 1, 50)
    cell = summary[(summary["noise_source"] == "dcsn") & (summary["target_sigma_dn"] == 0)].iloc[0]
    assert cell["abstained"] == clean["abstained"].sum() >= 1
    assert cell["abstained"] + cell["count"] == 6


def test_metrics_are_nested_by_effect_and_level(rows):
    nested = noise_metrics(noise.summarise(rows, 1, 50))
    assert set(nested) == {"dcsn", "photon"}
    assert set(nested["dcsn"]) == {"0", "10"}
    assert abs(nested["dcsn"]["10"]["median_dn"] - 10) < 1


def test_the_library_call_writes_the_same_table_and_summary(frames, rows):
    result = noise.measure({"pca": Registered(estimators.create, "pca")}, frames, SOURCES, LEVELS, draws=20)
    assert list(result.summary["target_sigma_dn"]) == [0, 10, 0, 10]  # in the order asked for
    named = measurements_of(result.estimates, "sigma_dn")
    open_tiles = named[(named["patch"] > 0) & (named["target_sigma_dn"] == 10)]
    assert (open_tiles["estimate"] - open_tiles["truth"]).abs().median() < 0.6
    assert set(result.estimates["estimator"]) == {"pca"} and len(result.estimates) == len(rows)
