"""Under strong noise the patches of one blur follow those that still show it."""

import numpy as np
import pytest

from pipeline import blur
from pipeline.blur import noise_consensus
from pipeline.camera import mtf
from pipeline.camera.blur import blur as convolve
from pipeline.camera.psf.linear_motion import create as motion
from pipeline.learning import images
from pipeline.streams import stream

NOISY_DN, QUIET_DN = 25.0, 8.0


def values(*levels):
    return np.stack([np.full((2, 8), level) for level in levels])


ESTIMATES, SCALES = values(0.2, 0.5, 0.7), values(0.01, 0.2, 0.2)


def led(sigma_dn, **options):
    doubts = noise_consensus.doubt(ESTIMATES, SCALES)
    return noise_consensus.led(ESTIMATES, SCALES, doubts, np.full(3, sigma_dn), **options)


def test_below_8_dn_every_patch_keeps_its_estimate():
    assert np.array_equal(led(QUIET_DN), ESTIMATES)


def test_under_strong_noise_the_surest_patch_leads():
    assert led(NOISY_DN) == pytest.approx(values(0.2, 0.2, 0.2))


def test_patches_that_are_equally_sure_are_led_by_their_median():
    answer = noise_consensus.led(ESTIMATES, values(0.2, 0.2, 0.2), np.ones(3), np.full(3, NOISY_DN))
    assert answer == pytest.approx(values(0.5, 0.5, 0.5))


def test_a_patch_with_another_blur_keeps_its_estimate_unless_all_are_known_to_share_it():
    scales = values(0.01, 0.2, 0.05)
    doubts = noise_consensus.doubt(ESTIMATES, scales)
    answer = noise_consensus.led(ESTIMATES, scales, doubts, np.full(3, NOISY_DN))
    assert answer == pytest.approx(values(0.2, 0.2, 0.7))
    answer = noise_consensus.led(ESTIMATES, scales, doubts, np.full(3, NOISY_DN), alike=True)
    assert answer == pytest.approx(values(0.2, 0.2, 0.2))


def test_between_both_levels_answers_move_gradually():
    assert led(12.0) == pytest.approx(values(0.2, 0.35, 0.45))


def test_doubt_does_not_depend_on_how_strong_the_blur_is():
    """Scales in proportion to the slope of the MTF over its logit."""
    levels = np.array([0.1, 0.3, 0.5])
    slopes = levels * (1 - levels) + noise_consensus.LEAST_SLOPE
    assert noise_consensus.doubt(values(*levels), values(*(0.2 * slopes))) == pytest.approx(0.2)


def test_a_patch_without_structure_takes_the_blur_from_one_with(monkeypatch):
    """Motion under 25 DN; a faint patch beside a strong one is read better by `fused` than alone."""
    tiles = [images.view(images.picture(i, 4, "test consensus"), stream(4, "test consensus", i), 192) for i in (2, 3)]
    scene = np.stack([tiles[0], 0.5 + 0.1 * (tiles[1] - 0.5)])[:, None].clip(0, 1)
    psf = motion(9.0, 0.0)
    noise = NOISY_DN / 255 * stream(4, "test consensus noise").standard_normal(scene.shape)
    patches = (np.rint((convolve(scene, psf) + noise).clip(0, 1) * 255) / 255).astype(np.float32)
    estimator = blur.create("fused", shared_blur="always")
    monkeypatch.setattr(estimator, "deconvolution", lambda pixels: np.full((2, 1, 2, 8), np.nan))
    monkeypatch.setattr("pipeline.blur.fused.deconvolution_pays", lambda mtf, scale: np.zeros(len(mtf)))
    together, alone = estimator.estimate(patches), estimator.spectral.estimate(patches)
    lonely = blur.create("fused", shared_blur="never")
    monkeypatch.setattr(lonely, "deconvolution", estimator.deconvolution)
    known = mtf.sample(psf)
    error, before = (np.abs(result.mtf - known).mean(axis=(1, 2)) for result in (together, alone))
    assert error[1] < 0.7 * before[1] and error[0] == pytest.approx(before[0], abs=1e-6)
    assert np.allclose(lonely.estimate(patches).mtf, alone.mtf)
    assert ((together.low <= together.mtf) & (together.mtf <= together.high)).all()
