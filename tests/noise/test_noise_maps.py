"""Local noise: maps of cells laid over a frame."""

import numpy as np
import pytest
from data_makers import picture

from pipeline import noise
from pipeline.datasets.patches import cut, tiles
from pipeline.noise.maps import CELL_PX, CellEstimator, pasted
from pipeline.streams import stream


@pytest.mark.parametrize("shape", [(256, 384), (200, 300), (135, 131)])
def test_cells_are_pasted_where_their_patches_lie(shape):
    ramp = np.add.outer(np.arange(shape[0]), 2.0 * np.arange(shape[1])).astype(np.float32)
    squares = tiles(shape, 128, "cover")
    cells = cut(ramp, squares)[:, 0].reshape(len(squares), 16, 8, 16, 8).mean((2, 4))
    result = pasted(cells, squares, shape)
    assert result.shape == tuple(-(-side // CELL_PX) for side in shape)
    assert np.isfinite(result).all()
    rows, columns = np.indices(result.shape) * CELL_PX + CELL_PX / 2
    assert np.abs(result - (rows + 2 * columns)).max() <= 3 * CELL_PX  # less than a cell in both directions
    if not any(side % CELL_PX for side in shape):
        assert np.allclose(result, rows - 0.5 + 2 * (columns - 0.5))


def test_unknown_cells_stay_unknown_unless_another_patch_knows():
    squares = tiles((128, 192), 128, "cover")
    cells = np.full((2, 16, 16), 3.0, np.float32)
    cells[0] = np.nan
    result = pasted(cells, squares, (128, 192))
    assert np.isnan(result[:, :8]).all()
    assert (result[:, 8:] == 3).all()


def test_an_estimate_with_cells_is_the_estimate():
    estimator = noise.create("cellwise")
    assert isinstance(estimator, CellEstimator)
    assert not isinstance(noise.create("pca"), CellEstimator)
    clean = picture("cells").astype(np.float32)[:128, :256]
    noisy = np.rint(np.clip(clean + stream(0, "cells").normal(0, 9, clean.shape), 0, 255)).astype(np.float32) / 255
    noisy[:, 128:] = 1.0
    patches = np.stack([noisy[:, :128], noisy[:, 128:]])[:, None]
    result, cells = estimator.estimate_cells(patches)
    alone = estimator.estimate(patches)
    assert np.array_equal(result.sigma_dn, alone.sigma_dn, equal_nan=True)
    assert cells.shape == (2, 16, 16)
    assert np.sqrt(np.mean(cells[0].astype(float) ** 2)) == pytest.approx(result.sigma_dn[0], rel=1e-3)
    assert result.abstained.tolist() == [False, True]
