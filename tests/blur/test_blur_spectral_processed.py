"""Noise that a camera has processed: the second network takes over, the interval widens, others stay as they were."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline import blur
from pipeline.blur import spectral
from pipeline.camera.processing import presets
from pipeline.camera.processing.develop import grey
from pipeline.learning import images
from pipeline.streams import stream


@pytest.fixture(scope="module")
def scenes():
    tiles = [images.picture(index, 5, "processed test", size_px=384) for index in range(6)]
    return [tile[50:258, 50:258].astype(np.float32) / 255 for tile in tiles]


def shots(scenes, iso):
    camera = presets.named("reflex").at_iso(iso)
    generator = stream(1, "processed", iso)
    pictures = [grey(camera.shoot(np.repeat(scene[..., None] ** 2.2, 3, axis=2), generator)) for scene in scenes]
    return np.stack([picture[8:200, 8:200] for picture in pictures])[:, None] / np.float32(255)


def test_frames_without_processed_noise_are_answered_by_the_main_network(scenes):
    patches = np.stack([scene[8:200, 8:200] for scene in scenes])[:, None].round(3).astype(np.float32)
    both, main = (blur.create("spectral", processed=flag).predict(patches) for flag in (True, False))
    quiet = both[2] - main[2] < 1e-6
    assert quiet.mean() >= 0.5
    assert np.array_equal(both[0][quiet], main[0][quiet])


def test_the_scale_holds_the_distance_of_the_networks(scenes):
    patches = np.stack([scene[8:200, 8:200] for scene in scenes])[:, None].round(3).astype(np.float32)
    both = blur.create("spectral").predict_members(patches)
    main, scale, sigma_dn = blur.create("spectral", processed=False).predict(patches)
    quiet = both.hidden.sigma_dn - sigma_dn < 1e-6
    assert np.array_equal(both.members[:, 0], both.mtf) and quiet.any()
    apart = scale + np.abs(main - both.members[:, 1])
    assert np.allclose(both.scale[quiet], apart[quiet], atol=1e-6) and (both.scale >= apart - 1e-6).all()


def test_noisy_and_quiet_shots_of_a_scene_agree_better_and_within_the_interval(scenes):
    noisy, quiet = shots(scenes, 12800), shots(scenes, 0)
    both, main = blur.create("spectral"), blur.create("spectral", processed=False)
    reference = main.estimate(quiet).mtf
    estimate = both.estimate(noisy)
    alone = np.abs(main.estimate(noisy).mtf - reference).mean()
    assert np.abs(estimate.mtf - reference).mean() < 0.8 * alone
    assert ((estimate.low <= reference) & (reference <= estimate.high)).mean() >= 0.85


def test_the_joined_answer_is_the_processed_one_where_its_noise_exceeds_by_two():
    estimator = blur.create("spectral")
    shape = (3, 2, 8)
    main = (np.full(shape, 0.8, np.float32), np.full(shape, 0.01, np.float32), np.zeros(3, np.float32))
    other = (np.full(shape, 0.4, np.float32), np.full(shape, 0.02, np.float32), np.float32([0.5, 1.4, 3.0]))
    mtf, scale, sigma = estimator._joined(main, other, spectral._second_share(main, other))
    assert mtf[:, 0, 0] == pytest.approx([0.8, 0.6, 0.4]) and sigma == pytest.approx([0, 0.7, 3.0])
    assert scale[0, 0, 0] == pytest.approx(0.01 + 0.4)  # and the distance of the networks
    assert estimator.interval * scale[2, 0, 0] >= 0.4 + estimator.interval * 0.01  # reaches both


def test_of_a_patch_that_is_refused_no_network_s_answer_is_left(scenes):
    patches = np.stack([scenes[0][8:200, 8:200], np.full((192, 192), 0.5)])[:, None].astype(np.float32)
    answer = blur.create("spectral").estimate(patches)
    assert answer.abstained.tolist() == [False, True] and answer.members.shape[1] == 2
    assert np.isnan(answer.members[1]).all() and np.isfinite(answer.members[0]).all()
