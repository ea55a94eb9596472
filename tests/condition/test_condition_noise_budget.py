"""The noise budget of a frame: frames drawn from a sensor agree with it, and each change of it is told by its cause."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from data_makers import picture

from pipeline import noise
from pipeline.camera import sensor as sensors
from pipeline.camera.exposure import Camera
from pipeline.camera.tone_curve import decode
from pipeline.condition.estimate import NoiseState, noise_of_frame
from pipeline.condition.noise_budget import SOURCES, FrameBudget, level_variances, noise_budget
from pipeline.errors import InputError
from pipeline.streams import stream

EXPOSURE_S, GAIN = 0.008, 8.0
CAMERA = Camera(
    sensors.named("automotive_3um"), radiance_at_full_scale=1.0, reference_exposure_s=EXPOSURE_S, adc_bits=12
)


@lru_cache
def scene() -> np.ndarray:
    """(384, 640) in [.1, .9]: dark on the left, bright on the right, with smooth structure."""
    ramp = np.linspace(0.15, 0.85, 640)[None, :] * np.ones((384, 1))
    shapes = np.kron(stream(1, "budget").random((12, 20)), np.ones((32, 32))) - 0.5
    return ramp + 0.1 * shapes


def taken(gain: float = GAIN, camera: Camera = CAMERA, added_dn: float = 0.0, pattern: float = 0.0) -> np.ndarray:
    """The scene by a camera at a gain, equally bright at any."""
    light = decode(scene(), camera.gamma) * (1.0 + pattern * stream(2, "pattern").standard_normal(scene().shape))
    image = camera.expose(np.maximum(light, 0.0) / gain, EXPOSURE_S, gain, stream(3, "budget")).image
    noisy = 255.0 * image + added_dn * stream(4, "added").standard_normal(image.shape)
    return np.clip(np.rint(noisy), 0, 255).astype(np.float32) / np.float32(255)


@lru_cache
def estimator() -> Any:
    return noise.create(noise.DEFAULT)


def budget(image: np.ndarray, **options: Any) -> FrameBudget:
    """With the gain that is assumed, whatever that of the picture."""
    return noise_budget(image, noise_of_frame(estimator(), image), CAMERA, EXPOSURE_S, GAIN, **options)


def amount(result: FrameBudget, kind: str) -> float:
    (explanation,) = [item for item in result.explanations if item.kind == kind]
    return explanation.amount


def test_levels_follow_photon_transfer():
    """Variance = K^2 (e + D + r^2) + (p m)^2 + q in linear light, EMVA Standard 1288."""
    linear = replace(CAMERA, gamma=1.0, temperature_k=330.0)
    kinds = level_variances(linear, 0.5, GAIN, 0.02)
    grey, sensor = np.arange(20, 200), linear.sensor
    k = GAIN * 255.0 / sensor.full_well_e
    dark = sensor.dark_electrons(330.0, 0.5)
    r2 = sensor.read_noise_e**2 + (sensor.read_noise_after_gain_e / GAIN) ** 2
    rounding = (255.0 / 4095.0) ** 2 / 12.0 + 1.0 / 12.0
    expected = [k * grey, k**2 * dark, k**2 * r2, (0.02 * grey) ** 2, rounding]
    for source, variance, formula in zip(SOURCES, kinds, expected, strict=True):
        assert variance[20:200] == pytest.approx(formula * np.ones(180), rel=0.01), source
    coarse = level_variances(replace(linear, adc_bits=8), 0.5, GAIN, 0.0)
    assert coarse[-1, 100] == pytest.approx(1.0 / 12.0, rel=0.01)  # rounded once
    fine = level_variances(linear, 0.5, GAIN, 0.0, is_8_bit=False)
    assert fine[-1, 100] == pytest.approx((255.0 / 4095.0) ** 2 / 12.0, rel=0.01)  # by the converter only


def test_the_black_level_of_raw_frames_is_no_light():
    """Light x well / gain electrons at 16 + 239 x DN, whatever the black level adds."""
    camera, black_dn = replace(CAMERA, gamma=1.0), 16.0
    light = 0.03 + 0.2 * scene()
    electrons = stream(5, "raw").poisson(light * camera.sensor.full_well_e / GAIN)
    read_e = camera.sensor.at_gain(GAIN).readout_sigma_e(camera.temperature_k)
    charge = electrons + read_e * stream(6, "raw").standard_normal(light.shape)
    grey_dn = black_dn + (255.0 - black_dn) * charge * GAIN / camera.sensor.full_well_e
    image = np.rint(grey_dn * 257.0).astype(np.float32) / np.float32(65535)
    state = noise_of_frame(estimator(), image)
    known, ignored = (noise_budget(image, state, camera, EXPOSURE_S, GAIN, black_dn=level) for level in (black_dn, 0.0))
    assert known.verdict == "agrees" and known.ratio == pytest.approx(1.0, abs=0.08)
    shot, read = (light.mean() * camera.sensor.full_well_e / GAIN, read_e**2)
    assert known.shares["readout"] == pytest.approx(read / (shot + read), rel=0.2)
    assert known.shares["rounding"] < 0.01
    assert ignored.ratio < 0.9


def test_a_frame_of_the_sensor_agrees_with_it_and_names_its_sources():
    result = budget(taken())
    assert result.verdict == "agrees" and result.explanations == () and result.tiles >= 10
    assert result.ratio == pytest.approx(1.0, abs=0.06) and result.ratio_low < 1.0 < result.ratio_high
    assert result.dominant == "photon" and sum(result.shares.values()) == pytest.approx(1.0)


@pytest.mark.parametrize(("factor", "verdict"), [(2.0, "more"), (0.5, "less")])
def test_a_gain_unlike_that_assumed_is_told(factor: float, verdict: str):
    result = budget(taken(GAIN * factor))
    assert result.verdict == verdict and amount(result, "gain") == pytest.approx(factor, rel=0.1)


def test_noise_added_behind_the_tone_curve_is_told():
    result = budget(taken(added_dn=4.0))
    assert result.verdict == "more" and result.explanations[0].kind == "added"
    assert amount(result, "added") == pytest.approx(4.0, rel=0.1)


def test_readout_noise_stronger_than_that_of_the_sensor_is_told():
    noisy = replace(CAMERA, sensor=replace(CAMERA.sensor, read_noise_e=25.0))
    result = budget(taken(camera=noisy))
    assert result.verdict == "more" and result.explanations[0].kind == "dark or readout"
    read = np.hypot(CAMERA.sensor.read_noise_e or 0.0, CAMERA.sensor.read_noise_after_gain_e / GAIN)
    assert amount(result, "dark or readout") == pytest.approx(25.0 / read, rel=0.15)


def test_fixed_pattern_is_told_and_expected_where_it_is_known():
    image = taken(pattern=0.1)
    unknown, known = budget(image), budget(image, pattern_fraction=0.1)
    assert unknown.verdict == "more" and unknown.explanations[0].kind == "pattern"
    assert amount(unknown, "pattern") == pytest.approx(0.1, rel=0.15)
    assert known.verdict == "agrees" and known.dominant == "pattern" and known.ratio == pytest.approx(1.0, abs=0.1)
    assert budget(taken(), pattern_fraction=0.05).verdict == "agrees"  # a camera may have corrected any part of it


def state(**changes: Any) -> tuple[np.ndarray, NoiseState]:
    image = taken()
    return image, replace(noise_of_frame(estimator(), image), **changes)


def test_processed_or_unknown_noise_is_not_compared():
    image, processed = state(correlation=0.5)
    result = noise_budget(image, processed, CAMERA, EXPOSURE_S, GAIN)
    assert result.verdict == "unknown" and "processed" in result.reason and np.isnan(result.ratio)
    black = np.zeros((256, 256), np.float32)
    nothing = noise_budget(black, noise_of_frame(estimator(), black), CAMERA, EXPOSURE_S, GAIN)
    assert nothing.verdict == "unknown" and "no estimate" in nothing.reason and nothing.dominant == ""
    dark = budget(taken() * np.float32(0.05))  # noise in the deepest shadows is cut off at black
    assert dark.verdict == "unknown" and ("clipped" in dark.reason or "no estimate" in dark.reason)


def test_an_uncertain_estimate_is_undecided_and_a_denoised_picture_has_no_single_cause():
    image, known = state()
    tiles = len(known.estimate)
    uncertain = replace(known.estimate, sigma_dn=np.zeros(tiles), low_dn=np.zeros(tiles), high_dn=np.full(tiles, 9.0))
    result = noise_budget(image, replace(known, estimate=uncertain), CAMERA, EXPOSURE_S, GAIN)
    assert result.verdict == "undecided" and result.explanations == () and result.ratio == 0.0
    certain = replace(uncertain, high_dn=np.full(tiles, 0.1))
    result = noise_budget(image, replace(known, estimate=certain), CAMERA, EXPOSURE_S, GAIN)
    assert result.verdict == "less" and result.explanations == ()


def test_what_cannot_be_compared_is_refused():
    image, known = state()
    for options, name in (
        ({"exposure_s": 0.0}, "exposure_s"),
        ({"gain": 0.5}, "gain"),
        ({"pattern_fraction": -0.1}, "pattern_fraction"),
        ({"black_dn": 255.0}, "black_dn"),
        ({"image": picture("small", 100, 100) / 255.0}, "does not hold"),
    ):
        values: dict[str, Any] = {"image": image, "exposure_s": EXPOSURE_S, "gain": GAIN} | options
        with pytest.raises(InputError, match=name):
            noise_budget(noise=known, camera=CAMERA, **values)
