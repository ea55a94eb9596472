"""HEIF pictures: pixels as stored, depths, what is refused, and how coarsely they were quantised."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from data_makers import picture
from heif_makers import heic
from PIL import Image

from pipeline.datasets.decoding.heif import exif, is_heif, read_heif
from pipeline.datasets.decoding.pictures import BadPicture
from pipeline.datasets.decoding.video_coding import UNKNOWN, Coding, coding_of_items
from pipeline.streams import stream

SCENE = picture("heif", 256, 128)
STEPS = [(b"irot", turns) for turns in (1, 2, 3)] + [(b"imir", axis) for axis in (0, 1)]


def stored(path: Path, *arguments: object, **options: object) -> Path:
    path.write_bytes(heic(*arguments, **options))
    return path


def test_a_lossless_picture_comes_back_as_it_was(tmp_path):
    path = stored(tmp_path / "a.heic", SCENE, -1)
    heif = read_heif(path)
    assert is_heif(path) and np.array_equal(heif.picture.pixels, SCENE)
    assert (heif.turn, heif.transfer, heif.transparent, heif.picture.white) == ("", 13, False, 65535)


def test_colours_come_in_the_order_of_the_picture(tmp_path):
    colours = np.dstack([SCENE, SCENE // 2, 255 - SCENE])
    pixels = read_heif(stored(tmp_path / "a.heic", colours, 4)).picture.pixels
    assert pixels.shape == colours.shape and pixels.dtype == np.uint8
    assert np.abs(pixels.astype(int) - colours).mean() < 2


def test_values_of_ten_bits_keep_them(tmp_path):
    deep = (SCENE.astype(np.uint16) << 2) + 3
    result = read_heif(stored(tmp_path / "a.hif", deep, -1)).picture
    assert result.pixels.dtype == np.uint16 and result.white == 1023
    assert np.array_equal(result.file_values(), deep)


@pytest.mark.parametrize("display", [*((step,) for step in STEPS), *itertools.permutations(STEPS, 2)])
def test_pixels_are_those_stored_however_they_are_turned_and_mirrored_for_display(tmp_path, display):
    heif = read_heif(stored(tmp_path / "a.heic", SCENE, -1, display=display))
    assert np.array_equal(heif.picture.pixels, SCENE)
    assert ("rotation" in heif.turn) == any(kind == b"irot" for kind, _ in display)
    assert ("mirrored" in heif.turn) == any(kind == b"imir" for kind, _ in display)


def test_tiles_are_joined_and_a_small_picture_beside_them_is_not_taken(tmp_path):
    path = stored(tmp_path / "a.heic", SCENE, -1, tiles=4, display=[(b"irot", 1)], thumbnail=SCENE[::2, ::2])
    heif = read_heif(path)
    assert np.array_equal(heif.picture.pixels, SCENE) and heif.turn == "rotation 90 degrees"


@pytest.mark.parametrize("grey", [True, False])
def test_colours_beneath_an_alpha_channel_count_and_transparent_pixels_are_known(tmp_path, grey):
    pixels = SCENE if grey else np.dstack([SCENE, SCENE // 2, 255 - SCENE])
    plain = read_heif(stored(tmp_path / "plain.heic", pixels, -1)).picture
    for lowest in (255, 0):
        alpha = np.full(SCENE.shape, 255, np.uint8)
        alpha[:40, :40] = lowest
        heif = read_heif(stored(tmp_path / "a.heic", pixels, -1, alpha=alpha, display=[(b"irot", 1)]))
        assert np.allclose(heif.picture.grey(), plain.grey(), atol=1e-6)
        assert (plain.alpha, heif.picture.alpha, heif.transparent) == (False, True, lowest == 0)


def test_exif_data_are_read_without_decoding(tmp_path):
    tags = Image.Exif()
    tags[0x0110] = "camera"
    path = stored(tmp_path / "a.heic", SCENE, exif=tags.tobytes()[6:])
    read = Image.Exif()
    read.load(exif(path))
    assert read[0x0110] == "camera"
    assert exif(stored(tmp_path / "b.heic", SCENE)) == exif(tmp_path / "absent.heic") == b""


@pytest.mark.parametrize("share", [0.001, 0.05, 0.5, 0.999])
def test_a_file_that_ends_early_is_refused(tmp_path, share):
    data = heic(SCENE)
    (tmp_path / "a.heic").write_bytes(data[: max(round(share * len(data)), 12)])
    assert is_heif(tmp_path / "a.heic")
    with pytest.raises(BadPicture, match=r"a\.heic: a HEIF picture that cannot be decoded \(.+\); copy .* again$"):
        read_heif(tmp_path / "a.heic")


def test_small_pictures_are_refused(tmp_path):
    with pytest.raises(BadPicture, match="too small: 256x128 px, expected at least 200 px on either side"):
        read_heif(stored(tmp_path / "a.heic", SCENE), smallest_px=200)


def test_a_damaged_file_gives_a_picture_or_the_projects_own_error(tmp_path):
    data = heic(SCENE, tiles=2, display=[(b"irot", 1)], thumbnail=SCENE[::2, ::2])
    draw, path, refused = stream(0, "damaged HEIF"), tmp_path / "a.heic", 0
    for number in range(200):
        damaged, end = bytearray(data), (data.index(b"mdat"), len(data))[number % 2]
        for _ in range(int(draw.integers(1, 16))):
            damaged[int(draw.integers(12, end))] = int(draw.integers(256))
        path.write_bytes(damaged)
        try:
            read_heif(path)
        except BadPicture:
            refused += 1
        exif(path), coding_of_items(path)
    assert 20 < refused < 180


def test_other_files_are_none(tmp_path):
    Image.fromarray(SCENE).save(tmp_path / "a.jpg")
    (tmp_path / "b.heic").write_bytes(b"")
    assert not any(is_heif(tmp_path / name) for name in ("a.jpg", "b.heic", "absent.heic"))
    assert coding_of_items(tmp_path / "a.jpg").quantiser is None
    assert coding_of_items(tmp_path / "b.heic") == coding_of_items(tmp_path / "absent.heic") == UNKNOWN


@pytest.mark.parametrize("tiles", [1, 2])
def test_the_quantiser_is_that_of_the_picture_and_not_of_the_small_one(tmp_path, tiles):
    coarse, fine = (stored(tmp_path / f"{q}.heic", SCENE, q, tiles=tiles, thumbnail=SCENE[::2, ::2]) for q in (40, 16))
    assert coding_of_items(coarse) == Coding("hevc", 37)  # 3 below that set: key frames get finer quantisers
    assert coding_of_items(fine) == Coding("hevc", 13)
