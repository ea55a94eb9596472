"""Image formation in linear light: means, variances and check values of real sensors, saturation, blur, settings."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.camera.exposure import SATURATED_LEVEL, Camera, Motion, _of_codes, kernels, noise_generator
from pipeline.camera.sensor import Sensor, named
from pipeline.camera.tone_curve import decode, encode, noise_after_curve, noise_before_curve, slope
from pipeline.errors import InputError

SIDE = 400
PROSILICA = named("prosilica_gc1380h")


def flat(level: float) -> np.ndarray:
    """Radiance that gives this fraction of full scale at 8 ms, gain 1, light 1."""
    return np.full((SIDE, SIDE), 2.5 * level, np.float32)


def linear(sensor: Sensor, **options) -> Camera:
    return Camera(sensor, gamma=1.0, adc_bits=16, **options)


@pytest.mark.parametrize(
    ("name", "shot", "read"),
    [
        ("prosilica_gc1380h", (1.52, 2.28, 3.05, 6.10), (0.23, 0.51, 0.91, 3.65)),
        ("ev76c661", (1.97, 2.94, 3.93, 7.87), (0.73, 1.63, 2.91, 11.7)),
    ],
)
def test_exposure_noise_budget_equals_published_check_values(name, shot, read):
    camera = linear(named(name))
    for gain, shot_dn, read_dn in zip((1.0, 2.24, 4.0, 16.0), shot, read, strict=True):
        half = 0.5 * camera.sensor.full_well_e / gain  # electrons that give mid grey at this gain
        budget = camera.budget(half, gain, 0.001)
        assert float(budget.shot) == pytest.approx(shot_dn, rel=0.005)
        assert float(budget.read) == pytest.approx(read_dn, abs=0.006 if gain < 16 else 0.06)


@pytest.mark.parametrize("gain", [1.0, 4.0, 16.0])
@pytest.mark.parametrize("noise_gain", ["physical", "linear"])
def test_exposure_mean_and_variance_of_frames_equal_the_closed_form(gain, noise_gain):
    camera = linear(PROSILICA, noise_gain=noise_gain)
    frame = camera.expose(flat(0.4), 0.008 / gain, gain, noise_generator(1, "flat", gain))
    dn = frame.image.astype(np.float64) * 255
    budget = camera.budget(frame.electrons[0, 0], gain, 0.008 / gain)
    variance = float(budget.total) ** 2 + 1 / 12  # 8 bits
    assert dn.mean() == pytest.approx(0.4 * 255, abs=5 * np.sqrt(variance / dn.size) + 0.01)
    assert dn.var() == pytest.approx(variance, rel=5 * np.sqrt(2 / dn.size) + 0.005)


@pytest.mark.parametrize("gain", [4.0, 16.0])
def test_exposure_read_noise_behind_the_gain_stage_is_divided_by_the_gain(gain):
    """Of 2.5 e- at base gain 1.8 e- are left at 16: in the dark a fifth of the variance."""
    sensor = named("automotive_3um")
    camera, exposure_s = linear(sensor), 0.008 / gain
    frame = camera.expose(flat(0.02), exposure_s, gain, noise_generator(2, "behind", gain))
    mean_e = 0.02 * 12_000 / gain
    read_e2 = 1.8**2 + (1.735 / gain) ** 2
    variance_e2 = mean_e + sensor.dark_electrons(camera.temperature_k, exposure_s) + read_e2
    variance = (255 * gain / 12_000) ** 2 * variance_e2
    assert float(camera.budget(mean_e, gain, exposure_s).total) == pytest.approx(np.sqrt(variance), rel=1e-4)
    assert (255.0 * frame.image).var(dtype=float) == pytest.approx(variance + 1 / 12, rel=5 * np.sqrt(2 / SIDE**2))


def test_exposure_rounding_of_the_converter_is_that_of_a_ramp():
    levels = np.linspace(0.0, 255.0, 255_001)
    rounded = np.rint(levels) - levels
    assert float(Camera(adc_bits=8).budget(0.0, 1.0, 0.001).rounding) == pytest.approx(rounded.std(), rel=1e-3)


def test_exposure_mean_does_not_depend_on_the_dark_signal():
    """It is subtracted whole: 2 % of it would be 0.5 DN here."""
    camera = linear(Sensor(read_noise_e=0.0), temperature_k=330.0)
    assert camera.sensor.dark_electrons(330.0, 0.2) > 2_000
    frame = camera.expose(flat(0.4) * np.float32(0.04), 0.2, 1.0, noise_generator(6, "dark mean"))
    assert 255 * frame.image.mean(dtype=float) == pytest.approx(0.4 * 255, abs=0.02)


def test_exposure_motion_runs_counter_clockwise_from_horizontal():
    (kernel,) = kernels(Motion(1_000.0, 30.0), 0.015)
    rows, columns = np.indices(kernel.shape)
    right, up = (columns - columns.mean()).ravel(), (rows.mean() - rows).ravel()
    weights = kernel.ravel().astype(float)
    across, along = np.linalg.eigh(np.cov(np.stack([right, up]), aweights=weights, ddof=0))[1].T
    assert np.degrees(np.arctan2(along[1], along[0])) % 180 == pytest.approx(30.0, abs=1.0)
    assert across @ along == pytest.approx(0.0, abs=1e-12)


def test_exposure_variance_grows_with_the_mean_by_the_system_gain():
    camera = linear(PROSILICA)
    levels = np.array([0.1, 0.3, 0.5, 0.7, 0.85])
    frames = [camera.expose(flat(x), 0.002, 4.0, noise_generator(1, "transfer", float(x))).image for x in levels]
    means, variances = np.array([(255 * f.mean(dtype=float), (255.0 * f).var(dtype=float)) for f in frames]).T
    selected = np.polyfit(means, variances, 1)[0]
    assert selected == pytest.approx(4 * 255 / 14_000, rel=0.02)


def test_exposure_gain_for_time_follows_the_root_for_shot_noise_and_the_factor_for_read_noise():
    camera = linear(named("paper"))
    short, long = camera.budget(1_000.0, 8.0, 0.001), camera.budget(8_000.0, 1.0, 0.008)
    assert float(short.shot / long.shot) == pytest.approx(np.sqrt(8), rel=1e-9)
    assert float(short.read / long.read) == pytest.approx(8, rel=1e-9)
    worst = linear(named("paper"), noise_gain="linear")
    ratio = worst.budget(1_000.0, 8.0, 0.008).shot / worst.budget(8_000.0, 1.0, 0.008).shot
    assert float(ratio) == pytest.approx(8, rel=1e-9)


def test_exposure_shot_noise_behind_blur_is_poisson_and_white():
    camera = linear(Sensor(read_noise_e=0.0, dark_figure_na_per_cm2=0.0, full_well_e=1_000.0))
    frame = camera.expose(flat(0.4), 0.008, 1.0, noise_generator(3, "white"), motion=Motion(defocus_px=11.0))
    electrons = frame.image.astype(np.float64) * 1_000
    assert electrons.var() == pytest.approx(400 + (1_000 / 255) ** 2 / 12, rel=0.02)
    noise = electrons - electrons.mean()
    neighbours = float((noise[:, 1:] * noise[:, :-1]).mean() / noise.var())
    assert abs(neighbours) < 4 / np.sqrt(noise.size)


def test_exposure_dark_current_grows_with_time_and_temperature():
    cold, hot = (linear(PROSILICA, temperature_k=t) for t in (293.15, 333.15))
    assert float(hot.budget(0.0, 1.0, 1.0).dark / cold.budget(0.0, 1.0, 1.0).dark) == pytest.approx(
        np.sqrt(266.7 / 12.91), rel=0.01
    )
    assert float(hot.budget(0.0, 1.0, 4.0).dark) == pytest.approx(2 * float(hot.budget(0.0, 1.0, 1.0).dark))


def test_exposure_after_the_tone_curve_sigma_is_the_median_of_the_pixels():
    camera = Camera(named("paper"))
    y = np.linspace(0.05, 0.9, SIDE, dtype=np.float32)[:, None] * np.ones((1, SIDE), np.float32) * 2.5
    frame = camera.expose(y, 0.002, 4.0, noise_generator(4, "tone"))
    clean = 255 * encode(frame.electrons * 4 / 20_000)
    rows = (255 * frame.image - clean).std(axis=1)
    assert frame.sigma_dn == pytest.approx(np.median(rows), rel=0.05)


@pytest.mark.parametrize(
    ("level", "gain", "exposure_s"),
    [(0.05, 8.0, 0.002), (0.2, 16.0, 0.004), (0.2, 1.0, 0.008), (0.01, 30.0, 0.002), (0.9, 16.0, 0.004)],
)
def test_exposure_sigma_is_that_of_pixels_over_many_shots_in_the_dark_and_near_white(level, gain, exposure_s):
    """The curve bends in the dark, and noise is clipped: linear noise times the slope misses up to a fifth."""
    camera = Camera(named("paper"))
    radiance = level * camera.radiance_at_full_scale * camera.reference_exposure_s / (gain * exposure_s)
    shots = np.full((256, 256), radiance, np.float32)
    frame = camera.expose(shots, exposure_s, gain, noise_generator(8, "shots"))
    rounded = float((255 * frame.image).std())
    assert frame.sigma_dn == pytest.approx(np.sqrt(rounded**2 - 1 / 12), rel=0.02)
    assert float(camera.sigma_dn_at(level, gain, exposure_s)) == pytest.approx(frame.sigma_dn, rel=0.01)


def test_exposure_saturates_at_the_well_and_at_the_converter():
    camera = Camera(PROSILICA)
    bright = camera.expose(flat(3.0), 0.008, 1.0, noise_generator(5, "bright"))
    assert bright.saturated_fraction > 0.99 and bright.sigma_dn == 0.0
    scene = flat(0.2)
    lamps = scene.copy()
    lamps[:, : SIDE * 3 // 5] *= 10  # three fifths of the pixels are white: the others have the noise
    both = [camera.expose(each, 0.008, 1.0, noise_generator(5, "lamps")).sigma_dn for each in (scene, lamps)]
    assert both[1] == pytest.approx(both[0], rel=1e-6)
    gained = camera.expose(flat(0.5), 0.008, 4.0, noise_generator(5, "bright"))
    assert gained.saturated_fraction > 0.99
    black = camera.expose(flat(0.0), 0.008, 1.0, noise_generator(5, "bright"))
    assert black.image.max() < 0.2 and np.isfinite(black.sigma_dn)


def test_exposure_spreads_the_light_of_a_lamp_beyond_the_well():
    """Saturation is of the pixels behind the optics: defocus spreads all of a lamp's light, not eight wells of it."""
    camera = linear(PROSILICA)
    lamp = np.zeros((64, 64), np.float32)
    lamp[32, 32] = 200 * camera.sensor.full_well_e / camera.electrons(np.ones((1, 1), np.float32), 0.008, 1.0)[0, 0]
    motion = Motion(defocus_px=9)
    frame = camera.expose(lamp, 0.008, 1.0, noise_generator(1, "lamp"), motion=motion)
    (psf,) = kernels(motion, 0.008)
    assert frame.electrons.max() == pytest.approx(200 * camera.sensor.full_well_e * psf.max(), rel=1e-3)
    assert frame.saturated_fraction == pytest.approx(np.count_nonzero(psf * 200 > 1) / lamp.size, rel=0.1)


def test_exposure_full_wells_read_below_white_by_the_dark_signal():
    camera = linear(Sensor(read_noise_e=0.0), temperature_k=330.0)
    dark = camera.sensor.dark_electrons(330.0, 0.1)
    frame = camera.expose(flat(5.0), 0.1, 1.0, noise_generator(5, "hot"))
    assert dark > 1_000
    np.testing.assert_allclose(frame.image * 255, 255 * (1 - dark / camera.sensor.full_well_e), atol=0.51)


@given(exposure_ms=st.floats(0.05, 40), gain=st.floats(1, 30), factor=st.floats(0.2, 5))
@settings(max_examples=60, deadline=None)
def test_exposure_compensated_by_gain_keeps_the_brightness(exposure_ms, gain, factor):
    camera = Camera(PROSILICA)
    one = camera.electrons(flat(0.2)[:4, :4], exposure_ms / 1e3) * gain
    other = camera.electrons(flat(0.2)[:4, :4], factor * exposure_ms / 1e3) * (gain / factor)
    np.testing.assert_allclose(one, other, rtol=1e-5)


@given(speed=st.floats(100, 3_000), first=st.floats(0.05, 20), more=st.floats(1.0, 3.0))
@settings(max_examples=40, deadline=None)
def test_exposure_longer_times_never_blur_less(speed, first, more):
    moving = Motion(speed)
    one, other = moving.length_px(first / 1e3), moving.length_px(more * first / 1e3)
    assert other >= one
    spread = [sum(float((k.astype(float) ** 2).sum()) for k in kernels(moving, t / 1e3)) for t in (first, more * first)]
    if one > 2:
        assert spread[1] <= spread[0] * (1 + 1e-6)


def test_exposure_common_random_numbers_and_same_bytes():
    camera = Camera(PROSILICA)
    first, again = (camera.expose(flat(0.3), 0.004, 2.0, noise_generator(6, "a")) for _ in range(2))
    assert first.image.tobytes() == again.image.tobytes()
    other = camera.expose(flat(0.3), 0.002, 4.0, noise_generator(6, "a"))
    a, b = (frame.image.ravel() - frame.image.mean() for frame in (first, other))
    assert np.corrcoef(a, b)[0, 1] > 0.9


def test_exposure_tone_curve_is_undone_and_ends_at_black():
    levels = np.linspace(0.0, 1.2, 50)
    np.testing.assert_allclose(decode(encode(levels)), levels, atol=1e-12)
    np.testing.assert_array_equal(encode(-levels), 0.0)
    np.testing.assert_array_equal(decode(-levels), 0.0)
    np.testing.assert_array_equal(encode(-levels, 1.0), -levels)  # without a curve noise goes on below black


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"noise_gain": "phyiscal"}, "did you mean 'physical'"),
        ({"gamma": 0.0}, "camera.gamma"),
        ({"adc_bits": 4}, "adc_bits"),
        ({"sensor": Sensor(gain=2.0)}, "setting per frame"),
    ],
)
def test_exposure_refuses_wrong_cameras(change, words):
    with pytest.raises(InputError, match=words):
        Camera(**change)


def test_exposure_refuses_wrong_frames_and_settings():
    camera = Camera()
    for arguments, words in (
        ((flat(0.1), 0.0, 1.0), "exposure_s"),
        ((flat(0.1), 0.01, -1.0), "gain"),
        ((flat(-0.1), 0.01, 1.0), "at least 0"),
        ((np.zeros(3, np.float32), 0.01, 1.0), "height, width"),
        ((np.ma.masked_less(flat(0.1), 1.0), 0.01, 1.0), "radiance: masked pixels"),
    ):
        with pytest.raises(InputError, match=words):
            camera.expose(*arguments, noise_generator(1, "x"))
    with pytest.raises(InputError, match="speed_px_s"):
        camera.expose(flat(0.1), 0.01, 1.0, noise_generator(1, "x"), motion=Motion(-1.0))
    with pytest.raises(InputError, match="light"):
        camera.electrons(flat(0.1), 0.01, -1.0)


@pytest.mark.parametrize("noise_gain", ["physical", "linear"])
def test_exposure_at_gains_below_base_iso_is_refused(noise_gain):
    """A full well of half of full scale was delivered as 186 DN without saturation or noise."""
    camera = Camera(named("imx255"), noise_gain=noise_gain)
    assert camera.expose(flat(10.0), 0.008, 1.0, noise_generator(1, "base")).saturated_fraction == 1.0
    with pytest.raises(InputError, match="gain is a factor of at least 1"):
        camera.expose(flat(10.0), 0.008, 0.5, noise_generator(1, "base"))


@pytest.mark.parametrize("noise_gain", ["physical", "linear"])
def test_exposure_far_beyond_the_well_is_white_for_any_sensor(noise_gain):
    camera = Camera(Sensor(full_well_e=1e6), noise_gain=noise_gain)
    frame = camera.expose(flat(50.0)[:40, :40], 0.008, 4.0, noise_generator(7, "white"))
    assert frame.image.min() > 0.98


@pytest.mark.parametrize("bits", [8, 12, 14])
@pytest.mark.parametrize("gamma", [1.0, 2.2])
def test_exposure_every_number_of_the_converter_has_the_grey_level_of_the_tone_curve(bits, gamma):
    image, saturated_from = _of_codes(bits, gamma)
    linear_level = np.arange(2**bits) / (2**bits - 1)
    np.testing.assert_allclose(image, linear_level ** (1 / gamma), atol=0.5 / 255 + 1e-6)
    np.testing.assert_array_equal(np.rint(image * 255), image * np.float32(255))
    assert saturated_from == np.count_nonzero(linear_level < SATURATED_LEVEL)


def test_noise_before_the_curve_is_the_inverse_of_noise_after_it():
    levels, before = np.meshgrid([0.005, 0.05, 0.2, 0.6, 0.95], [1e-3, 0.01, 0.05, 0.15])
    after = noise_after_curve(levels, before)
    np.testing.assert_allclose(noise_before_curve(levels, after), before, rtol=0.02)
    weak = noise_after_curve(np.array([0.2]), np.array([1e-3]))
    np.testing.assert_allclose(weak, 1e-3 * slope(np.array([0.2])), rtol=1e-3)


def test_noise_without_a_curve_is_kept_but_for_clipping():
    np.testing.assert_allclose(noise_after_curve(np.array([0.5]), np.array([0.02]), 1.0), 0.02, rtol=1e-3)
    black = noise_after_curve(np.array([0.0]), np.array([0.02]), 1.0)  # half of a normal distribution, half zeros
    np.testing.assert_allclose(black, 0.02 * np.sqrt(0.5 - 1 / (2 * np.pi)), rtol=5e-3)


def test_noise_that_white_does_not_cut_ends_at_black_where_there_is_no_light():
    weak = noise_after_curve(np.array([0.2, 0.8]), np.array([1e-3, 1e-3]), clip_white=False)
    np.testing.assert_allclose(weak, 1e-3 * slope(np.array([0.2, 0.8])), rtol=2e-3)
    white = noise_after_curve(np.array([1.0]), np.array([0.02]), 1.0, clip_white=False)
    np.testing.assert_allclose(white, 0.02, rtol=1e-3)  # nothing is cut
    square_root = noise_after_curve(np.array([0.0]), np.array([0.02]), 2.0, clip_white=False)
    mean, square = 0.41109, np.sqrt(1 / (2 * np.pi))  # of sqrt(max(z, 0)): 2^(1/4) Gamma(3/4) / (2 sqrt(pi))
    np.testing.assert_allclose(square_root, np.sqrt(0.02 * (square - mean**2)), rtol=0.02)
