"""Tiles for noise and patches for blur: all of a small frame, an even selection of a large one, always inside."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from data_makers import picture

from pipeline import noise
from pipeline.cli import main
from pipeline.condition import ConditionMonitor, noise_of_frame
from pipeline.condition.frame_tiles import MOST_PATCHES, MOST_TILES, STEP_PX, frame_tiles
from pipeline.datasets.patches import cut, tiles
from pipeline.errors import InputError
from pipeline.streams import stream


@pytest.mark.parametrize("shape", [(370, 1224), (768, 896), (128, 128), (90, 300)])
def test_a_frame_of_few_tiles_is_covered(shape):
    assert frame_tiles(shape, 128) == tiles(shape, min(128, *shape), "cover")


@pytest.mark.parametrize("shape", [(1080, 1920), (1200, 1920), (2160, 3840), (1920, 1080), (400, 9000), (3000, 3000)])
@pytest.mark.parametrize("most", [1, 2, 7, 30, MOST_TILES])
def test_a_large_frame_gets_an_even_selection(shape, most):
    chosen = frame_tiles(shape, 128, most)
    assert most / 2 <= len(chosen) <= most and len(set(chosen)) == len(chosen)
    for starts, length in (
        (sorted({tile.y_px for tile in chosen}), shape[0]),
        (sorted({tile.x_px for tile in chosen}), shape[1]),
    ):
        assert starts[0] >= 0 and starts[-1] <= length - 128
        assert all(start % STEP_PX == 0 for start in starts[:-1])
        if len(starts) > 1:
            assert starts[0] == 0 and starts[-1] == length - 128
            steps = np.diff(starts)
            assert steps.max() - steps.min() <= 2 * STEP_PX
    assert [(tile.y_px, tile.x_px) for tile in chosen] == sorted((tile.y_px, tile.x_px) for tile in chosen)


@pytest.mark.parametrize(("size_px", "shape"), [(8, (25, 105)), (11, (34, 144)), (14, (29, 255))])
def test_tiles_smaller_than_two_blocks_are_all_different(size_px, shape):
    chosen = frame_tiles(shape, size_px)
    assert len(set(chosen)) == len(chosen) <= MOST_TILES
    grey = np.rint(stream(0, "small tiles", size_px).normal(128, 5, shape)) / 255
    state = noise_of_frame(noise.create("immerkaer"), grey.astype(np.float32), size_px)
    assert state.grid[0] * state.grid[1] == len(state.patches)


def test_full_hd_is_sampled_alike_along_and_across():
    chosen = frame_tiles((1080, 1920), 128)
    assert len({tile.y_px for tile in chosen}) == 6 and len({tile.x_px for tile in chosen}) == 9


def test_bad_numbers_are_refused():
    with pytest.raises(InputError, match="at least 1"):
        frame_tiles((1080, 1920), 128, 0)
    with pytest.raises(InputError, match="most_tiles"):
        ConditionMonitor(most_tiles=0)
    with pytest.raises(InputError, match="most_patches"):
        ConditionMonitor(most_patches=0)


def test_the_monitor_gives_the_same_noise_by_a_selection_as_by_all_tiles():
    """Noise of 6 DN on a ramp, which the network for correlated noise need not see; the map knows where tiles lie."""
    draw = stream(0, "frame tiles")
    ramp = np.linspace(60, 190, 1152)[None].repeat(768, axis=0)
    frame = (np.rint(ramp + draw.normal(0, 6, ramp.shape)).clip(0, 255) / 255).astype(np.float32)
    every, selected = (ConditionMonitor(most_tiles=most).frame(frame).noise for most in (1000, 12))
    assert len(every.patches) == 54 and len(selected.patches) == 12 and selected.grid == (3, 4)
    assert selected.summary.value == pytest.approx(every.summary.value, abs=0.1)
    known = np.isfinite(selected.map_dn)
    assert selected.map_dn.shape == every.map_dn.shape == (96, 144) and known.mean() == pytest.approx(12 / 54, abs=0.01)
    assert np.array_equal(selected.estimate.sigma_dn.shape, (12,))
    assert cut(frame, selected.patches).shape == (12, 1, 128, 128)


@pytest.mark.parametrize("shape", [(720, 1280), (768, 896), (370, 1224), (192, 192)])
def test_blur_of_a_common_frame_is_estimated_on_all_of_it(shape):
    assert frame_tiles(shape, 192, MOST_PATCHES) == tiles(shape, 192, "cover")


def test_the_monitor_gives_the_same_blur_by_a_selection_of_patches_as_by_all():
    """One blur over a picture of 35 patches, six of which are selected; the map is that of the six."""
    frame = np.tile(picture("blur of a selection"), (3, 3))[:960, :1344].astype(np.float32)
    frame = (np.rint(cv2.GaussianBlur(frame, (0, 0), 1.5)) / 255).astype(np.float32)
    every, selected = (
        ConditionMonitor(noise_name="immerkaer", most_patches=most).frame(frame).blur for most in (1000, 6)
    )
    assert every.grid == (5, 7) and selected.grid == (2, 3) and selected.map_mtf.shape == (2, 3, 2, 8)
    assert np.abs(selected.summary.value - every.summary.value).max() < 0.03
    assert (selected.summary.low <= every.summary.value).all() and (every.summary.value <= selected.summary.high).all()


def test_blur_of_a_frame_smaller_than_a_patch_is_abstained_from():
    assert ConditionMonitor(noise_name="immerkaer").frame(np.full((191, 500), 0.5, np.float32)).blur.grid == (0, 0)


@pytest.mark.parametrize(
    ("command", "options"),
    [("health", {"most_tiles", "most_patches"}), ("watch", {"most_tiles", "most_patches"}), ("noise", {"most_tiles"})],
)
def test_the_commands_take_as_many_tiles_and_patches_by_default_as_the_monitor(command, options):
    defaults = {one.name: one.default for one in main.get_command(None, command).params}
    monitors = {"most_tiles": MOST_TILES, "most_patches": MOST_PATCHES}
    assert {name: defaults[name] for name in options} == {name: monitors[name] for name in options}
