"""Textures: periodic, filtered rightly, bright as stated, the same every time."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.errors import InputError
from pipeline.scenes.textures import Library, Texture, library
from pipeline.scenes.textures.library import RECIPES
from pipeline.scenes.textures.masonry import lay
from pipeline.scenes.textures.noise import grain, power_noise
from pipeline.scenes.textures.strokes import blades, leaves
from pipeline.streams import stream

SMALL = library(0, 256)
FIELDS = ("fbm", "cloud")
FACTORS = ("fabric", "stripe", "hair")


@pytest.mark.parametrize("name", sorted(RECIPES))
def test_texture_repeats_without_a_seam(name):
    texture = SMALL[name]
    albedo = texture.levels[0][..., 0].astype(float)
    for axis in (0, 1):
        step = np.abs(np.diff(albedo, axis=axis)).mean(axis=1 - axis)
        seam = np.abs(np.take(albedo, 0, axis) - np.take(albedo, -1, axis)).mean()
        # the seam is a step like any other (joints of masonry are the largest steps there are)
        assert seam <= 1.05 * step.max() + 1e-6


@pytest.mark.parametrize("name", sorted(RECIPES))
def test_sampling_is_periodic(name):
    texture = SMALL[name]
    uv = stream(1, "test").uniform(0, texture.size_m, (200, 2))
    first, slope = texture.sample(uv, 0.01)
    moved = uv + np.array([3 * texture.size_m, -2 * texture.size_m])
    again, slope_again = texture.sample(moved, 0.01)
    spread = texture.levels[0].std()
    # 1/32 texel of interpolation and the rounding of uv are allowed
    assert np.abs(first - again).mean() < 0.05 * spread
    assert np.abs(slope - slope_again).mean() < 0.05 * max(spread, np.abs(slope).mean())


@pytest.mark.parametrize("name", sorted(set(RECIPES) - set(FIELDS) - set(FACTORS)))
def test_albedos_are_those_of_real_surfaces(name):
    texture = SMALL[name]
    albedo = texture.levels[0][..., 0]
    assert 0.1 < texture.mean_albedo < 0.65
    assert albedo.min() > 0.015
    assert albedo.max() < 0.95
    assert albedo.std() / albedo.mean() > 0.05


@pytest.mark.parametrize("name", FACTORS)
def test_cloth_is_a_factor_near_one(name):
    assert SMALL[name].mean_albedo == pytest.approx(1.0, abs=0.12)


@pytest.mark.parametrize("name", FIELDS)
def test_fields_are_standardised(name):
    field = SMALL[name].levels[0][..., 0]
    assert field.mean() == pytest.approx(0, abs=1e-3)
    assert field.std() == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize("name", ["asphalt", "brick", "grass"])
def test_a_huge_footprint_sees_the_mean(name):
    texture = SMALL[name]
    albedo, slope = texture.sample(stream(2, "test").uniform(-9, 9, (300, 2)), 50.0)
    np.testing.assert_allclose(albedo, texture.mean_albedo, rtol=0.01)
    assert np.abs(slope).max() < 1e-3


def test_contrast_falls_with_the_footprint():
    texture = SMALL["cobble"]
    uv = stream(3, "test").uniform(0, texture.size_m, (4000, 2))
    spread = [float(texture.sample(uv, foot)[0].std()) for foot in (0.005, 0.02, 0.06, 0.2, 0.8)]
    assert all(a >= b * 0.999 for a, b in pairwise(spread))
    assert spread[-1] < 0.2 * spread[0]


def test_texel_centres_are_returned_as_stored():
    texture = SMALL["plank"]
    rows, columns = np.mgrid[0:40, 0:40]
    uv = np.stack([columns.ravel() + 0.5, rows.ravel() + 0.5], axis=1) * texture.texel_m
    albedo, _ = texture.sample(uv, texture.texel_m / 8)
    np.testing.assert_allclose(albedo, texture.levels[0][:40, :40, 0].ravel(), atol=2e-3)


def test_slopes_are_the_derivatives_of_the_relief():
    size, side, relief = 2.0, 256, 0.01
    u = (np.arange(side) + 0.5) / side * size
    height = np.sin(2 * np.pi * 3 * u / size)[None] + 0.5 * np.cos(2 * np.pi * 2 * u / size)[:, None]
    texture = Texture(np.full((side, side), 0.3), height, size, relief)
    points = stream(4, "test").uniform(0, size, (500, 2))
    albedo, slope = texture.sample(points, 0.001)
    np.testing.assert_allclose(albedo, 0.3, atol=1e-6)
    expected_u = relief * 6 * np.pi / size * np.cos(6 * np.pi * points[:, 0] / size)
    expected_v = -relief * 2 * np.pi / size * np.sin(4 * np.pi * points[:, 1] / size)
    np.testing.assert_allclose(slope[:, 0], expected_u, atol=0.02 * relief * 6 * np.pi / size)
    np.testing.assert_allclose(slope[:, 1], expected_v, atol=0.02 * relief * 6 * np.pi / size)


@pytest.mark.parametrize("shape", [(100, 100), (64, 32), (2, 2)])
def test_a_texture_wants_a_power_of_two(shape):
    with pytest.raises(InputError, match="texture"):
        Texture(np.ones(shape), np.ones(shape), 1.0)


def test_the_library_draws_lazily_and_always_the_same():
    first, second, other = Library(0, 128), Library(0, 128), Library(1, 128)
    assert not first._drawn
    # the order of asking must not matter
    a = first["stone"].levels[0]
    second["grass"]
    np.testing.assert_array_equal(a, second["stone"].levels[0])
    assert np.abs(a - other["stone"].levels[0]).max() > 0.1
    assert set(first) == set(RECIPES)
    assert len(first) == len(RECIPES)
    assert library(0, 256) is SMALL


def test_an_unknown_texture_is_named_with_the_nearest():
    with pytest.raises(InputError, match="did you mean 'asphalt'"):
        SMALL["asfalt"]
    assert "asfalt" not in SMALL


@given(st.floats(0.3, 1.5))
def test_power_noise_has_its_spectrum(exponent):
    field = power_noise(stream(5, "test"), 128, exponent)
    assert field.mean() == pytest.approx(0, abs=1e-4)
    assert field.std() == pytest.approx(1, abs=1e-4)
    power = np.abs(np.fft.fft2(field)) ** 2
    frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(128), np.fft.fftfreq(128)))
    band = (frequency > 0.03) & (frequency < 0.4)
    slope = np.polyfit(np.log(frequency[band]), np.log(power[band]), 1)[0]
    assert slope == pytest.approx(-2 * exponent, abs=0.15)


def test_stretched_noise_is_drawn_out_along_the_axis_stated():
    field = power_noise(stream(6, "test"), 256, 1.0, stretch_u=0.2)
    across, along = np.abs(np.diff(field, axis=1)).mean(), np.abs(np.diff(field, axis=0)).mean()
    assert across > 1.5 * along


def test_grain_is_a_gaussian_of_white_noise():
    field = grain(stream(7, "test"), 256, 2.0).astype(float)
    for lag in (1, 3):
        seen = (field * np.roll(field, lag, 1)).mean()
        assert seen == pytest.approx(np.exp(-(lag**2) / (4 * 2.0**2)), abs=0.05)


@pytest.mark.parametrize("draw", [blades, leaves])
def test_strewn_things_cross_the_border(draw):
    field = draw(stream(8, "test"), 128, 400, (6, 14), 0.2, 0.05)
    assert field.shape == (128, 128)
    inner = np.abs(np.diff(field, axis=0)).mean()
    seam = np.abs(field[0] - field[-1]).mean()
    assert seam < 1.6 * inner
    assert field.std() > 0.02


def test_courses_have_as_many_pieces_as_asked():
    wall = lay(stream(9, "test"), 240, 6, 8, 0.004)
    assert len(np.unique(wall.tone)) <= 48
    assert (wall.body[15] < 0.5).sum() == pytest.approx(240 * 6 * 2 * 0.004 * 1.1, abs=10)
    row, next_row = wall.along[15], wall.along[45]
    # the next row is shifted by half a piece
    np.testing.assert_allclose(np.mod(row - next_row, 1), 0.5, atol=1e-3)
