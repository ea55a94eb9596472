"""Corruption by target: sigma reached, identity, order independence, MTF50, local truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.camera import chain, corruption, mtf, psf
from pipeline.camera.chain import PRESETS
from pipeline.camera.sensor import Sensor
from pipeline.camera.truth import local_sigma
from pipeline.errors import InputError
from pipeline.streams import stream

EFFECTS = sorted(PRESETS)
GREY = np.full((256, 384), 128, np.uint8)


def frame(name: str = "a") -> np.ndarray:
    """A frame of random blocks, 60 to 190 DN."""
    small = stream(0, "frame", name).integers(60, 190, (8, 12))
    return np.kron(small, np.ones((16, 16))).astype(np.uint8)


@pytest.mark.parametrize("noise_source", EFFECTS)
@pytest.mark.parametrize("sigma_dn", [1.0, 5.0, 15.0])
def test_levels_sigma_is_reached_where_nothing_clips(noise_source, sigma_dn):
    made = corruption.corrupt(frame(), noise_source, sigma_dn=sigma_dn, generator=stream(1, noise_source))
    assert made.unclipped_sigma_dn == pytest.approx(sigma_dn, rel=1e-4)
    if made.clipped_fraction == 0.0:
        rounding = 1 / 12
        assert np.sqrt(made.clipped_sigma_dn**2 - rounding) == pytest.approx(sigma_dn, rel=0.02)
    seen = made.image_8bit.astype(float) - frame()
    assert seen.std() == pytest.approx(np.hypot(sigma_dn, np.sqrt(1 / 12)), rel=0.02)
    assert abs(seen.mean()) < 4 * sigma_dn / np.sqrt(seen.size) + 0.02


@pytest.mark.parametrize("noise_source", EFFECTS)
@pytest.mark.parametrize("camera", corruption.CAMERAS)
def test_levels_zero_is_the_identity_bit_for_bit(noise_source, camera):
    eight = stream(2, "zero").integers(0, 256, (33, 47), dtype=np.uint8)
    real = stream(3, "zero").random((33, 47), dtype=np.float32)
    for image in (eight, real):
        made = corruption.corrupt(image, noise_source, sigma_dn=0.0, generator=stream(4, "zero"), camera=camera)
        same = image.astype(np.float32) / np.float32(255) if image.dtype == np.uint8 else image
        assert made.image.dtype == np.float32 and np.array_equal(made.image, same)
        assert made.unclipped_sigma_dn == 0.0
    assert np.array_equal(made.image, real)


@settings(max_examples=25)
@given(
    height=st.integers(8, 40),
    width=st.integers(8, 40),
    noise_source=st.sampled_from(EFFECTS),
    sigma_dn=st.floats(0.5, 60.0),
    blurred=st.booleans(),
)
def test_levels_any_frame_stays_on_the_8bit_grid(height, width, noise_source, sigma_dn, blurred):
    image = stream(5, "any", height, width).integers(0, 256, (height, width), dtype=np.uint8)
    kernel = psf.create("defocus", 3) if blurred else None
    made = corruption.corrupt(image, noise_source, sigma_dn=sigma_dn, generator=stream(6, "any"), psf=kernel)
    assert made.image.shape == image.shape and made.image.dtype == np.float32
    assert made.image.min() >= 0 and made.image.max() <= 1
    np.testing.assert_array_equal(made.image, made.image_8bit.astype(np.float32) / np.float32(255))
    assert 0 <= made.clipped_fraction <= 1


def test_levels_of_one_stream_share_their_noise():
    low, high = (corruption.corrupt(frame(), "combined", sigma_dn=s, generator=stream(7, "x")) for s in (5.0, 10.0))
    np.testing.assert_allclose(high.noise_dn, 2 * low.noise_dn, rtol=1e-4, atol=1e-4)
    assert (low.temperature_k, low.exposure_s) == (high.temperature_k, high.exposure_s)


@pytest.mark.parametrize("shape", [(64, 64), (180, 240), (100, 130)])
@pytest.mark.parametrize("options", [{"light": "encoded"}, {"light": "linear"}, {"camera": "authors"}])
def test_levels_noise_without_a_difference_between_pixels_reaches_none(shape, options):
    """At 233 K no electron is freed in a microsecond; rounding errors of sums were scaled to 10 DN: a black frame."""
    grey = np.full(shape, 128, np.uint8)
    with pytest.raises(InputError, match="give no noise on this frame"):
        corruption.corrupt(
            grey, "dcsn", sigma_dn=10.0, generator=stream(1, "x"), temperature_k=233.0, exposure_s=1e-6, **options
        )


def test_levels_are_of_the_scatter_not_of_a_shift():
    """Dark current whose mean stays in the frame is brighter by it, not noisier."""
    noise = 500 + 20 * stream(1, "shift").standard_normal((200, 300), dtype=np.float32)
    drawn, sensor = chain.Drawn({"dark": noise}, 300.0, 0.1), Sensor()
    scale = corruption.noise_scale_to_reach(drawn, 5.0, sensor)
    assert scale * noise.std() * sensor.dn_per_electron == pytest.approx(5.0, rel=1e-3)


def test_levels_photon_noise_grows_with_the_root_of_light():
    halves = np.repeat(np.uint8([[40, 160]]), 200, 1).repeat(200, 0)
    noise = corruption.corrupt(halves, "photon", sigma_dn=8.0, generator=stream(8, "x")).noise_dn
    assert noise[:, 200:].std() / noise[:, :200].std() == pytest.approx(2.0, rel=0.02)
    flat = corruption.corrupt(halves, "readout", sigma_dn=8.0, generator=stream(8, "x")).noise_dn
    assert flat[:, 200:].std() / flat[:, :200].std() == pytest.approx(1.0, rel=0.02)


def test_levels_reach_source_or_frame():
    kernel = psf.create("defocus", 7)
    made = {
        reach: corruption.corrupt(frame(), "combined", sigma_dn=8.0, generator=stream(9, "x"), psf=kernel, reach=reach)
        for reach in ("source", "frame")
    }
    assert made["frame"].unclipped_sigma_dn == pytest.approx(8.0, rel=1e-3)
    assert made["source"].unclipped_sigma_dn < 8.0
    sharp = corruption.corrupt(frame(), "combined", sigma_dn=8.0, generator=stream(9, "x"))
    assert made["source"].noise_scale == pytest.approx(sharp.noise_scale)


def test_levels_hybrid_is_declared_and_near_the_exact():
    made = {
        p: corruption.corrupt(frame(), "photon", sigma_dn=10.0, generator=stream(10, "x"), poisson=p)
        for p in ("exact", "hybrid")
    }
    assert {name: each.poisson for name, each in made.items()} == {"exact": "exact", "hybrid": "hybrid"}
    difference = made["exact"].noise_dn - made["hybrid"].noise_dn
    assert 0 < difference.std() < 0.3


@pytest.mark.parametrize("kind", ["defocus", "linear_motion", "gaussian"])
@pytest.mark.parametrize("target", [0.08, 0.2, 0.45])
def test_levels_mtf50_is_reached(kind, target):
    _, kernel = corruption.psf_for_mtf50(kind, target)
    assert np.min(mtf.mtf50(kernel)) == pytest.approx(target, rel=1e-3)


@pytest.mark.parametrize(
    ("kind", "angle_deg", "target"),
    [("defocus", 0, 0.99), ("gaussian", 0, 0.999), ("linear_motion", 0, 0.97), ("linear_motion", 45, 0.995)],
)
def test_levels_mtf50_is_reached_near_nyquist(kind, angle_deg, target):
    """There MTF50 changes by percents where size does by 1e-4 px."""
    size_px, kernel = corruption.psf_for_mtf50(kind, target, angle_deg=angle_deg)
    assert np.min(mtf.mtf50(kernel)) == pytest.approx(target, rel=1e-3)
    np.testing.assert_array_equal(kernel, psf.create(kind, size_px, angle_deg))


def test_levels_mtf50_that_no_size_has_is_refused_with_those_that_can_be():
    """The effective disc has odd nominal diameters only: MTF50 jumps between them."""
    with pytest.raises(InputError, match="within 0.1 %.*ask for") as error:
        corruption.psf_for_mtf50("defocus", 0.25, diameter="effective")
    values = [float(word) for word in str(error.value).split("ask for ")[1].split(" or ")]
    halves = [np.min(mtf.mtf50(psf.create("defocus", size, diameter="effective"))) for size in (3, 5)]
    assert values[0] < 0.25 < values[1] and values == pytest.approx(sorted(halves), rel=1e-3)
    with pytest.raises(InputError, match="ask for 0.5"):
        corruption.psf_for_mtf50("defocus", 0.9, diameter="effective")


def test_levels_mtf50_of_a_disc_follows_theory():
    # 2 J1(x) / x = 1/2 at x = 2.2151, x = pi d f
    size_px, _ = corruption.psf_for_mtf50("defocus", 2 * 0.05)
    assert size_px == pytest.approx(2.2151 / (np.pi * 0.05), rel=0.01)


@dataclass
class Tile:
    x_px: int
    y_px: int
    size_px: int


def test_levels_local_sigma_is_what_is_really_there():
    image = GREY.copy()
    image[:, 128:256] = 255
    made = corruption.corrupt(image, "readout", sigma_dn=12.0, generator=stream(13, "x"))
    rows = [(0, 0, 128), (128, 0, 128), (256, 128, 128)]
    before, after = (local_sigma(made, rows, when) for when in ("before", "after"))
    np.testing.assert_allclose(before, 12.0, rtol=0.03)
    # a saturated tile keeps the lower half of its noise: deviation sqrt(1/2 - 1/(2 pi)) of the whole
    np.testing.assert_allclose(after, [12.0, 12.0 * np.sqrt(0.5 - 0.5 / np.pi), 12.0], rtol=0.03)
    np.testing.assert_array_equal(after, local_sigma(made, [Tile(*row) for row in rows]))
    assert local_sigma(made, []).shape == (0,)


def test_levels_bad_input_is_refused_with_a_reason():
    good = {"sigma_dn": 5.0, "generator": stream(14, "x")}
    for changes, message in (
        ({"sigma_dn": -1.0}, "sigma_dn"),
        ({"sigma_dn": float("nan")}, "sigma_dn"),
        ({"camera": "author"}, "did you mean 'authors'"),
        ({"reach": "everywhere"}, "reach"),
        ({"temperature_k": 0.0}, "kelvin"),
    ):
        with pytest.raises(InputError, match=message):
            corruption.corrupt(GREY, "dcsn", **{**good, **changes})
    with pytest.raises(InputError, match="black frames"):
        corruption.corrupt(np.zeros((8, 8), np.uint8), "photon", **good)
    with pytest.raises(InputError, match="nonlinear_motion"):
        corruption.psf_for_mtf50("nonlinear_motion", 0.2)
    with pytest.raises(InputError, match="above 0.01.* and below 1"):
        corruption.psf_for_mtf50("defocus", 1.2)
    with pytest.raises(InputError, match="tile at"):
        local_sigma(corruption.corrupt(GREY, "dcsn", **good), [(300, 0, 128)])
    with pytest.raises(InputError, match="when"):
        local_sigma(corruption.corrupt(GREY, "dcsn", **good), [], "during")  # type: ignore[arg-type]


def test_levels_conditions_can_be_fixed():
    made = corruption.corrupt(
        GREY, "combined", sigma_dn=5.0, generator=stream(15, "x"), temperature_k=310.0, exposure_s=0.25
    )
    assert (made.temperature_k, made.exposure_s) == (310.0, 0.25)
    assert made.sensor == Sensor()


@pytest.mark.shared
def test_levels_on_a_real_frame(shared):
    import cv2

    path = sorted((shared / "realdata/kitti/training/image_2").glob("*.png"))[0]
    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    made = corruption.corrupt(image, "photon", sigma_dn=25.0, generator=stream(16, "x"))
    assert made.unclipped_sigma_dn == pytest.approx(25.0, rel=1e-3)
    assert 20.0 < made.clipped_sigma_dn < 25.0  # clipping takes some away; the paper's program reaches 23 to 25
    assert 0.0 < made.clipped_fraction < 0.2
