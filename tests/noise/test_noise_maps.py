"""Local noise: the truth of a place, maps of cells laid over a frame, and what the report is given to draw."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from data_makers import picture

from pipeline import noise
from pipeline.datasets.corrupted import CameraSettings
from pipeline.datasets.frame import Frame
from pipeline.datasets.patches import cut, tiles
from pipeline.noise.maps import CELL_PX, CellEstimator, local_truth, pasted, shown_maps
from pipeline.streams import stream


def test_local_truth_follows_the_noise_of_each_place():
    draw = stream(0, "local truth").standard_normal((200, 300)).astype(np.float32)
    draw[:, :150] *= 4
    draw[:, 150:] *= 12
    found = local_truth(draw)
    assert found.shape == (25, 38)
    assert np.allclose(found[:, :15], 4, rtol=0.12)
    assert np.allclose(found[:, 23:], 12, rtol=0.12)


def test_local_truth_is_zero_beside_strong_noise():
    """A running sum must not turn the rounding of what it passed into noise, or into a root of less than nothing."""
    noise_dn = np.zeros((160, 320), np.float32)
    noise_dn[:, :80] = stream(0, "beside").normal(0, 90, (160, 80))
    noise_dn[:40] = stream(0, "above").normal(0, 90, (40, 320))
    assert (local_truth(noise_dn)[12:, 16:] < 1e-3).all()


@pytest.mark.parametrize("shape", [(256, 384), (200, 300), (135, 131)])
def test_cells_are_pasted_where_their_patches_lie(shape):
    ramp = np.add.outer(np.arange(shape[0]), 2.0 * np.arange(shape[1])).astype(np.float32)
    squares = tiles(shape, 128, "cover")
    cells = cut(ramp, squares)[:, 0].reshape(len(squares), 16, 8, 16, 8).mean((2, 4))
    found = pasted(cells, squares, shape)
    assert found.shape == tuple(-(-side // CELL_PX) for side in shape)
    assert np.isfinite(found).all()
    rows, columns = np.indices(found.shape) * CELL_PX + CELL_PX / 2
    assert np.abs(found - (rows + 2 * columns)).max() <= 3 * CELL_PX  # less than a cell in both directions
    if not any(side % CELL_PX for side in shape):
        assert np.allclose(found, rows - 0.5 + 2 * (columns - 0.5))


def test_unknown_cells_stay_unknown_unless_another_patch_knows():
    squares = tiles((128, 192), 128, "cover")
    cells = np.full((2, 16, 16), 3.0, np.float32)
    cells[0] = np.nan
    found = pasted(cells, squares, (128, 192))
    assert np.isnan(found[:, :8]).all()
    assert (found[:, 8:] == 3).all()


def test_an_estimate_with_cells_is_the_estimate():
    estimator = noise.create("cellwise")
    assert isinstance(estimator, CellEstimator)
    assert not isinstance(noise.create("pca"), CellEstimator)
    clean = picture("cells").astype(np.float32)[:128, :256]
    noisy = np.rint(np.clip(clean + stream(0, "cells").normal(0, 9, clean.shape), 0, 255)).astype(np.float32) / 255
    noisy[:, 128:] = 1.0
    patches = np.stack([noisy[:, :128], noisy[:, 128:]])[:, None]
    found, cells = estimator.estimate_cells(patches)
    alone = estimator.estimate(patches)
    assert np.array_equal(found.sigma_dn, alone.sigma_dn, equal_nan=True)
    assert cells.shape == (2, 16, 16)
    assert np.sqrt(np.mean(cells[0].astype(float) ** 2)) == pytest.approx(found.sigma_dn[0], rel=1e-3)
    assert found.abstained.tolist() == [False, True]


def test_shown_maps_hold_frame_truth_and_answer(tmp_path):
    path = tmp_path / "a.png"
    cv2.imwrite(str(path), cv2.GaussianBlur(picture("a"), (0, 0), 1))
    frame, camera = Frame("made_up", "a", Path(path)), CameraSettings()
    arrays, said = shown_maps(frame, noise.create("cellwise"), ["readout", "dcsn", "photon"], 10.0, camera, 1)
    assert said["effects"] == ["photon", "dcsn"]
    for effect in said["effects"]:
        seen, added, found = (arrays[f"{effect}_{part}"] for part in ("seen", "added", "found"))
        assert seen.shape == (320, 448)
        assert seen.dtype == np.uint8
        assert added.shape == found.shape == (40, 56)
        assert abs(np.median(found) - np.median(added)) < 1.5
    light = cv2.resize(arrays["dcsn_seen"].astype(float), (56, 40), interpolation=cv2.INTER_AREA)
    assert np.corrcoef(light.ravel(), arrays["photon_added"].ravel())[0, 1] > 0.7
    assert abs(np.corrcoef(light.ravel(), arrays["dcsn_added"].ravel())[0, 1]) < 0.2
    again = shown_maps(frame, noise.create("cellwise"), ["readout", "dcsn", "photon"], 10.0, camera, 1)
    assert all(np.array_equal(arrays[name], again[0][name]) for name in arrays)
    assert shown_maps(frame, noise.create("pca"), ["dcsn"], 10.0, camera, 1) is None
    assert shown_maps(frame, noise.create("cellwise"), ["readout"], 10.0, camera, 1)[1]["effects"] == ["readout"]
