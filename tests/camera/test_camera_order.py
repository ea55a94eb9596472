"""Order of photon noise and blur, and the light they act in: moments, levels, defaults, refusals."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.camera import chain, linear_light, psf
from pipeline.camera.corruption import corrupt
from pipeline.camera.linear_light import ADC_BITS
from pipeline.camera.sensor import Sensor
from pipeline.camera.steps import steps
from pipeline.camera.tone_curve import decode, encode
from pipeline.errors import InputError
from pipeline.streams import stream

DISC = psf.create("defocus", 11)
SENSOR = Sensor(full_well_e=1_000.0)
GREY = np.full((300, 300), 0.4, np.float32)


def formed(order):
    effects = chain.Effects(photon=True, quantise=False)
    return chain.expose(GREY, effects, stream(1, "order"), sensor=SENSOR, psf=DISC, order=order)


def test_order_of_a_camera_leaves_photon_noise_poisson_and_white():
    """400 electrons behind an 11 px disc: variance 400 and white; the paper's order gives 400 sum(psf^2)."""
    for order, variance in (("detector", 400.0), ("paper", 400.0 * float((DISC.astype(float) ** 2).sum()))):
        noise = formed(order).image.astype(float) * 1_000 - 400
        assert noise.var() == pytest.approx(variance, rel=0.05)
        correlation = float((noise[:, 1:] * noise[:, :-1]).mean() / noise.var())
        assert (abs(correlation) < 0.02) if order == "detector" else (correlation > 0.85)


def test_order_is_known_to_the_truth_and_to_the_steps():
    for order in ("paper", "detector"):
        frame = formed(order)
        np.testing.assert_allclose(frame.noise_dn, frame.image * 255 - frame.clean_dn, atol=2e-3)
        names = [step.name for step in steps(frame)]
        assert names[1:3] == (["photon", "optics"] if order == "paper" else ["optics", "photon"])


@pytest.mark.parametrize("order", ["paper", "detector"])
@pytest.mark.parametrize("light", ["encoded", "linear"])
def test_the_last_step_before_rounding_is_nearly_the_frame(order, light):
    ramp = np.linspace(0.25, 0.8, 300, dtype=np.float32)[None] * np.ones((300, 1), np.float32)
    options = {"generator": stream(3, "steps"), "psf": DISC, "order": order, "light": light, "reach": "frame"}
    result = steps(corrupt(ramp, "photon", sigma_dn=8.0, **options))
    assert np.allclose(result[0].image, ramp, atol=1e-3)
    before, after = result[-2].image, result[-1].image
    allowed = np.full_like(before, 1.5 / 255)
    if light == "linear":  # in the dark half a step of the 12-bit converter is more than that
        half_step = np.float32(0.5 / (2**ADC_BITS - 1))
        ends = [encode(decode(before) + sign * half_step) for sign in (-1, 1)]
        allowed = np.maximum(allowed, np.abs(np.subtract(ends, before)).max(axis=0) + 0.6 / 255)
    assert (np.abs(before - after) < allowed).all() and np.mean(allowed > 1.5 / 255) < 0.01


@pytest.mark.parametrize("order", ["paper", "detector"])
@pytest.mark.parametrize("light", ["encoded", "linear"])
@pytest.mark.parametrize("noise_source", ["photon", "dcsn", "combined"])
def test_order_and_light_meet_the_level(order, light, noise_source):
    ramp = np.linspace(0.25, 0.8, 300, dtype=np.float32)[None] * np.ones((300, 1), np.float32)
    frame = corrupt(
        ramp,
        noise_source,
        sigma_dn=8.0,
        generator=stream(2, "level"),
        psf=DISC,
        order=order,
        light=light,
        reach="frame",
    )
    assert frame.unclipped_sigma_dn == pytest.approx(8.0, rel=0.02)
    assert frame.clipped_sigma_dn == pytest.approx(8.0, rel=0.03)
    assert (frame.order, frame.light) == (order, light)
    assert np.array_equal(np.rint(frame.image * 255), frame.image_8bit)


@pytest.mark.parametrize("light", ["encoded", "linear"])
def test_a_level_at_the_source_is_that_of_the_noise_before_the_optics(light):
    def options(reach):
        return {"generator": stream(5, "reach"), "psf": DISC, "light": light, "reach": reach}

    frame = corrupt(GREY, "photon", sigma_dn=8.0, **options("source"))
    source_dn = frame.encoded_dn(frame.signal_e + frame.noise_e["photon"]) - frame.encoded_dn(frame.signal_e)
    assert source_dn.std() == pytest.approx(8.0, rel=0.02)
    # what arrives is smoothed: of white noise sqrt(sum psf^2) is left
    left = float(np.sqrt((DISC.astype(float) ** 2).sum()))
    assert frame.unclipped_sigma_dn == pytest.approx(8.0 * left, rel=0.05)
    assert corrupt(GREY, "photon", sigma_dn=8.0, **options("frame")).unclipped_sigma_dn == pytest.approx(8.0, rel=0.02)


def test_order_without_blur_is_the_same_bytes():
    one, other = (
        corrupt(GREY, "combined", sigma_dn=10.0, generator=stream(3, "same"), order=order)
        for order in ("paper", "detector")
    )
    assert one.image.tobytes() == other.image.tobytes()


def test_linear_light_blurs_light_and_leaves_level_zero_alone():
    edge = np.where(np.arange(200) < 100, 0.1, 0.9).astype(np.float32)[None] * np.ones((100, 1), np.float32)
    line = psf.create("linear_motion", 11)
    encoded, linear = (
        corrupt(edge, "dcsn", sigma_dn=0.0, generator=stream(4, "edge"), psf=line, light=light).image
        for light in ("encoded", "linear")
    )
    middle = 99
    assert encoded[50, middle] == pytest.approx(0.1 + 0.8 * 5 / 11, abs=0.01)
    expected = (0.1**2.2 + (0.9**2.2 - 0.1**2.2) * 5 / 11) ** (1 / 2.2)
    assert linear[50, middle] == pytest.approx(expected, abs=0.01)
    same = corrupt(edge, "dcsn", sigma_dn=0.0, generator=stream(4, "edge"), light="linear").image
    assert same.tobytes() == edge.tobytes()


@pytest.mark.parametrize("noise_source", ["photon", "readout"])
def test_the_target_in_linear_light_is_noise_that_black_has_left(noise_source):
    """A third of the frame is nearly black: noise below black, which no picture shows, does not count."""
    dark = np.where(np.arange(192) < 64, 0.02, 0.6).astype(np.float32)[None] * np.ones((192, 1), np.float32)
    made = corrupt(dark, noise_source, sigma_dn=10.0, generator=stream(4, "dark"), light="linear")
    assert (made.clean_dn + made.noise_dn).min() >= -1e-4
    assert made.unclipped_sigma_dn == pytest.approx(10.0, rel=2e-3)
    assert made.clipped_sigma_dn == pytest.approx(10.0, rel=0.02)  # the frame has it, but for rounding


def test_the_target_in_linear_light_is_reached_where_every_nth_pixel_lies_in_few_columns():
    """Of 1200 x 1000 px every 20th would be taken, all of them on the posts of a fence with a period of 20 px."""
    fence = np.where(np.arange(1000) % 20 < 8, 0.05, 0.8).astype(np.float32)[None] * np.ones((1200, 1), np.float32)
    made = corrupt(fence, "readout", sigma_dn=10.0, generator=stream(4, "fence"), light="linear")
    assert made.unclipped_sigma_dn == pytest.approx(10.0, rel=0.02)


def test_pictures_of_usual_sizes_keep_their_grid_in_linear_light():
    """The factor on the noise, and with it every byte, is found on the pixels that it always was."""
    for width, height in (
        (1242, 375), (1920, 1200), (896, 768), (448, 384), (640, 480), (1280, 720), (1920, 1080), (192, 192), (64, 48),
        (90, 60),
    ):  # fmt: skip
        assert linear_light._stride(width * height, width) == max(1, width * height // linear_light.GRID_PIXELS)
    for width, height in ((4000, 3000), (3200, 2400), (6000, 4000), (3840, 2160), (80, 8000)):
        step = linear_light._stride(width * height, width)
        assert len(set((np.arange(0, width * height, step) % width).tolist())) >= min(100, width)
        assert width * height / step == pytest.approx(linear_light.GRID_PIXELS, rel=0.35)


def test_order_refuses_unknown_words_and_the_authors_program():
    with pytest.raises(InputError, match="did you mean 'detector'"):
        corrupt(GREY, "photon", sigma_dn=5.0, generator=stream(1, "x"), order="detectr")
    with pytest.raises(InputError, match=r"camera\.light"):
        corrupt(GREY, "photon", sigma_dn=5.0, generator=stream(1, "x"), light="linaer")
    with pytest.raises(InputError, match="authors' program"):
        corrupt(GREY, "photon", sigma_dn=5.0, generator=stream(1, "x"), order="detector", camera="authors")
    with pytest.raises(InputError, match="no noise"):
        corrupt(np.zeros((32, 32), np.float32), "photon", sigma_dn=5.0, generator=stream(1, "x"), light="linear")
