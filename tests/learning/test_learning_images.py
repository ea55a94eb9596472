"""Procedural pictures: reproducible, in range, of natural statistics, upright."""

import numpy as np
import pytest

from pipeline.learning import dead_leaves, images, streets, textures
from pipeline.streams import stream


@pytest.mark.parametrize("draw", [dead_leaves.draw, streets.draw])
def test_pictures_are_in_range_and_have_structure(draw):
    for number in range(3):
        image = draw(stream(number, "test"), 96)
        assert image.shape == (96, 96) and image.dtype == np.float32
        assert image.min() >= 0 and image.max() <= 255 and image.std() > 3


def test_a_picture_is_a_function_of_seed_purpose_and_number():
    first = images.picture(5, 1, size_px=96)
    assert np.array_equal(first, images.picture(5, 1, size_px=96))
    for other in (images.picture(6, 1, size_px=96), images.picture(5, 2, size_px=96)):
        assert not np.array_equal(first, other)
    assert not np.array_equal(first, images.picture(5, 1, "validation image", size_px=96))


def test_the_bank_is_drawn_once(tmp_path, monkeypatch):
    small = lambda index, seed, purpose: np.full((4, 4), index, np.uint8)  # noqa: E731
    monkeypatch.setattr(images, "picture", small)
    made = images.bank(3, 1, folder=tmp_path)
    monkeypatch.setattr(images, "picture", None)
    assert np.array_equal(made, images.bank(3, 1, folder=tmp_path))
    assert made[:, 0, 0].tolist() == [0, 1, 2]


@pytest.mark.parametrize("exponent", [0.5, 1.0, 1.5])
def test_power_law_fields_have_their_slope(exponent):
    field = textures.power_law(stream(1, "test", exponent), 256, exponent)
    assert abs(float(field.mean())) < 1e-4 and abs(float(field.std()) - 1) < 1e-3
    power = np.abs(np.fft.rfft2(field)) ** 2
    radius = np.hypot(np.fft.fftfreq(256)[:, None], np.fft.rfftfreq(256)[None])
    inside = (radius > 0.02) & (radius < 0.4)
    slope = np.polyfit(np.log(radius[inside]), np.log(power[inside]), 1)[0]
    assert slope == pytest.approx(-2 * exponent, abs=0.1)


def test_views_are_in_range_and_repeatable():
    tile = images.picture(0, 1, size_px=160)
    for number in range(20):
        view = images.view(tile, stream(number, "view"), 120)
        assert view.shape == (120, 120) and view.dtype == np.float32
        assert view.min() >= 0 and view.max() <= 1
        assert np.array_equal(view, images.view(tile, stream(number, "view"), 120))
    with pytest.raises(ValueError):
        images.view(tile[:100, :100], stream(0, "view"), 120)


@pytest.mark.parametrize("size_px", [96, 160])
def test_views_leave_their_tile_as_it_is(size_px):
    """Bars are drawn in place: into the bank, where the view is a whole tile."""
    tile = images.picture(0, 1, size_px=160)
    tile.setflags(write=False)
    kept = tile.copy()
    views = [images.view(tile, stream(number, "view"), size_px) for number in range(40)]
    assert np.array_equal(tile, kept) and len(views) == 40


def test_views_hold_more_detail_along_the_vertical():
    """Upright scenes: on average power falls faster along the horizontal axis of frequency."""
    white = stream(0, "white").integers(0, 256, (256, 256)).astype(np.uint8)
    difference = []
    for number in range(60):
        power = np.abs(np.fft.fft2(images.view(white, stream(number, "v"), 128))) ** 2
        along_x, along_y = power[0, 20:50].mean(), power[20:50, 0].mean()
        difference.append(np.log(along_y / along_x))
    assert np.mean(difference) > 0.1


def test_outlines_stay_near_their_centre():
    for kind in textures.OUTLINES:
        corners = textures.outline(stream(1, kind), kind, (50.0, 60.0), 10.0)
        assert corners.shape[1] == 2 and np.abs(corners - [50, 60]).max() < 17
