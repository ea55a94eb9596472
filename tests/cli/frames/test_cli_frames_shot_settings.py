"""Exposure time and ISO of pictures by their EXIF data."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image, features

from pipeline.cli.frames.shot_settings import exif

EXIF_IFD, EXPOSURE_TIME, ISO, TYPE, OUTPUT, RECOMMENDED, SPEED = 0x8769, 33434, 34855, 0x8830, 0x8831, 0x8832, 0x8833


AVIF = pytest.mark.skipif(not features.check("avif"), reason="AVIF: this Pillow was built without it")


def picture_with(path: Path, **tags: object) -> Path:
    data = Image.Exif()
    data.get_ifd(EXIF_IFD).update({EXPOSURE_TIME: 0.004, **{int(name[1:]): value for name, value in tags.items()}})
    Image.fromarray(np.zeros((20, 20), np.uint8)).save(path, exif=data.tobytes())
    return path


@pytest.mark.parametrize("suffix", ["jpg", "png", "tif", "webp", pytest.param("avif", marks=AVIF)])
def test_exposure_and_iso_are_read_of_every_format_that_holds_exif_data(tmp_path, suffix):
    assert exif(picture_with(tmp_path / f"a.{suffix}", **{f"t{ISO}": 400})) == pytest.approx((0.004, 400))


@pytest.mark.parametrize(
    ("tags", "iso"),
    [
        ({ISO: 400}, 400.0),
        ({ISO: 65534, TYPE: 2, RECOMMENDED: 51200}, 65534.0),
        ({ISO: 65535}, None),  # only stated to be more
        ({ISO: 65535, TYPE: 2, RECOMMENDED: 102400}, 102400.0),
        ({ISO: 65535, TYPE: 1, OUTPUT: 204800, RECOMMENDED: 100}, 204800.0),
        ({ISO: 65535, TYPE: 3, SPEED: 409600, OUTPUT: 1}, 409600.0),
        ({ISO: 65535, TYPE: 6, SPEED: 80000}, 80000.0),
        ({ISO: 65535, RECOMMENDED: 102400}, 102400.0),
        ({ISO: 65535, TYPE: 2, RECOMMENDED: 0}, None),
        ({}, None),
    ],
)
def test_iso_beyond_sixteen_bits_is_read_from_the_further_tags(tmp_path, tags, iso):
    path = picture_with(tmp_path / "a.jpg", **{f"t{tag}": value for tag, value in tags.items()})
    exposure_s, sensitivity = exif(path)
    assert exposure_s == pytest.approx(0.004) and sensitivity == iso
