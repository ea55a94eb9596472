"""One picture file of a user, of any format that is read: its pixels, and what its metadata hold."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.errors import DECODER_ERRORS

if TYPE_CHECKING:
    from PIL import Image

    from pipeline.datasets.decoding.pictures import Picture
    from pipeline.datasets.decoding.video_coding import Coding

_ORIENTATION = 0x0112


@dataclass(frozen=True)
class PictureFile:
    """A decoded file.

    Attributes:
        picture: pixels as stored.
        turn: how it is to be turned or mirrored for display, in words; empty where it is not.
        transparent: whether a pixel is not opaque.
        curve: name of its transfer curve, where that is far from those of sRGB and BT.709; else empty.
    """

    picture: Picture
    turn: str = ""
    transparent: bool = False
    curve: str = ""


def read_file(path: Path, least_px: int) -> PictureFile:
    """Decode a picture file completely, or say why it cannot be used.

    Args:
        path: the file; what is in it counts, not its name.
        least_px: both sides must be at least this long.

    Raises:
        BadPicture: it cannot be used.
    """
    from pipeline.datasets.decoding import heif
    from pipeline.datasets.decoding.pictures import read_picture
    from pipeline.datasets.decoding.video_decoder import CURVES

    if heif.is_heif(path):
        stored = heif.read_heif(path, smallest_px=least_px)
        return PictureFile(stored.picture, stored.turn, stored.transparent, CURVES.get(stored.transfer, ""))
    picture = read_picture(path, smallest_px=least_px)
    orientation = _orientation(path)
    turn = f"orientation {orientation}" if orientation else ""
    return PictureFile(picture, turn, picture.alpha and _has_transparent_pixels(path))


def coding_of_picture(path: Path) -> Coding:
    """How a picture was stored: an AVIF file by AV1, a HEIF file mostly by HEVC, others as their pixels show."""
    from pipeline.datasets.decoding.heif import container
    from pipeline.datasets.decoding.video_coding import UNKNOWN, coding_of_items

    codec = {"heif": "hevc", "avif": "av1"}.get(container(path))
    return coding_of_items(path).or_by(codec) if codec else UNKNOWN


def exif(path: Path, group: int) -> Mapping[int, object]:
    """Tags of a group (IFD) of a picture file's EXIF data; empty where it has none.

    Raises:
        Exception: one of `pipeline.errors.DECODER_ERRORS` or ``PIL.Image.DecompressionBombError``.
    """
    from PIL import Image

    from pipeline.datasets.decoding import heif

    if heif.is_heif(path):
        tags = Image.Exif()
        tags.load(heif.exif(path))
        return tags.get_ifd(group)
    with warnings.catch_warnings(), _opened(path) as picture:
        warnings.simplefilter("ignore")  # Pillow's remarks on metadata
        return picture.getexif().get_ifd(group)  # of a TIFF or PNG file while it is open


def _opened(path: Path) -> Image.Image:
    from pipeline.datasets.decoding.pictures import open_with_pillow

    with path.open("rb") as file:
        start = file.read(12)
    return open_with_pillow(path, start)


def _orientation(path: Path) -> int:
    """Orientation 2..8 (EXIF, TIFF) of a picture that is to be turned or mirrored for display; else 0.

    Costs no decoding.
    """
    from PIL import Image

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Pillow's remarks on metadata
        try:
            with _opened(path) as opened:
                if opened.format != "TIFF" and "exif" not in opened.info:
                    return 0
                stored = opened.getexif().get(_ORIENTATION)
        except (*DECODER_ERRORS, Image.DecompressionBombError):
            return 0
    return stored if isinstance(stored, int) and 2 <= stored <= 8 else 0


def _has_transparent_pixels(path: Path) -> bool:
    """Whether a pixel of a picture with an alpha channel, which was read before, is not opaque."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Pillow's remarks on metadata and size
        with _opened(path) as opened:
            return any(opened.convert("RGBA").getchannel("A").histogram()[:255])
