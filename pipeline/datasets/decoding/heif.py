"""HEIF pictures, as telephones (HEIC) and some cameras (HIF, 10 bit) store them. libheif decodes (pillow-heif).

libheif turns and mirrors the picture as the file states for display (properties ``irot`` and ``imir``, ISO/IEC
23008-12); that is undone here, since labels, rows and columns of the sensor refer to the pixels as stored. Of several
pictures in a file the primary one is read. Values of more than 8 bits are scaled to 65535.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.datasets.decoding.pictures import AGAIN, SMALLEST_PX, WHITE, BadPicture, Picture
from pipeline.errors import DECODER_ERRORS

if TYPE_CHECKING:
    from pillow_heif import HeifImage

SUFFIXES = frozenset({".heic", ".heif", ".hif"})
_HEIF = frozenset({b"heic", b"heix", b"heim", b"heis", b"hevc", b"hevx", b"hevm", b"hevs", b"mif1", b"msf1"})
_AVIF = frozenset({b"avif", b"avis"})
_TURN, _MIRROR = b"irot", b"imir"


@dataclass(frozen=True)
class Heif:
    """A decoded HEIF picture, with what its file states about it.

    Attributes:
        picture: pixels as stored.
        turn: how it is to be turned or mirrored for display, in words; empty where it is not.
        transfer: transfer characteristic of its colours (ITU-T H.273); 2, unspecified, where none is stated.
        transparent: whether a pixel is not opaque.
    """

    picture: Picture
    turn: str
    transfer: int
    transparent: bool


def container(path: Path) -> str:
    """``"heif"`` or ``"avif"``, by the brands in a file's first box (ISO/IEC 14496-12, 4.3); empty for other files.

    AVIF files, which Pillow reads, may have a brand of HEIF as well, also as the first.
    """
    try:
        with path.open("rb") as file:
            start = file.read(256)
    except OSError:
        return ""
    kind, content = next(_boxes(start), (b"", b""))
    brands = {content[at : at + 4] for at in range(0, len(content), 4) if at != 4} if kind == b"ftyp" else set()
    return "avif" if brands & _AVIF else "heif" if brands & _HEIF else ""


def is_heif(path: Path) -> bool:
    """Whether a file is a HEIF picture, by what is in it."""
    return container(path) == "heif"


def read_heif(path: Path, *, smallest_px: int = SMALLEST_PX) -> Heif:
    """Decode a HEIF file completely, or say why it cannot be used.

    Args:
        path: the file.
        smallest_px: both sides must be at least this long.

    Raises:
        BadPicture: it cannot be decoded, or is too small.
    """
    try:
        data = path.read_bytes()
        image = _primary(data)
        values = np.array(image)  # a copy: the memory is freed with the picture of libheif
        steps = _display_steps(data)
    except DECODER_ERRORS as error:
        raise BadPicture(path, f"a HEIF picture that cannot be decoded ({str(error).strip()}); {AGAIN}") from None
    pixels = values[..., :3] if values.ndim == 3 else values  # with an alpha channel grey comes as colour
    for kind, value in reversed(steps):
        pixels = np.rot90(pixels, -value) if kind == _TURN else np.flip(pixels, axis=value)
    height, width = pixels.shape[:2]
    if min(height, width) < smallest_px:
        raise BadPicture(path, f"too small: {width}x{height} px, expected at least {smallest_px} px on either side")
    information: dict[str, Any] = dict(image.info)
    greatest, white = (1 << int(information["bit_depth"])) - 1, WHITE
    if pixels.dtype == np.uint16:
        pixels, white = np.rint(pixels * (WHITE / greatest)).astype(np.uint16), greatest
    picture = Picture(np.ascontiguousarray(pixels), image.has_alpha, white)
    transparent = image.has_alpha and bool((values[..., -1] < greatest).any())
    profile = information.get("nclx_profile") or {}
    transfer = int(profile.get("transfer_characteristics", 2))
    return Heif(picture, _words(steps), transfer, transparent)


def exif(path: Path) -> bytes:
    """EXIF data of the primary picture, which is not decoded; empty where it has none or cannot be read."""
    try:
        stored: Any = _primary(path.read_bytes()).info.get("exif")
        return stored or b""
    except DECODER_ERRORS:
        return b""


def _primary(data: bytes) -> HeifImage:
    """The primary picture of a file, not yet decoded; by one thread."""
    import pillow_heif

    pillow_heif.options.DECODE_THREADS = 1
    pillow_heif.options.THUMBNAILS = pillow_heif.options.DEPTH_IMAGES = pillow_heif.options.AUX_IMAGES = False
    file = pillow_heif.open_heif(data, convert_hdr_to_8bit=False, hdr_to_16bit=False)
    return file[file.primary_index]


def _words(steps: Sequence[tuple[bytes, int]]) -> str:
    words = [f"rotation {90 * value} degrees" if kind == _TURN else "mirrored" for kind, value in steps]
    return ", ".join(words)


def _display_steps(data: bytes) -> list[tuple[bytes, int]]:
    """What is done to the primary picture for display, in order.

    Returns:
        ``irot`` with the quarter turns counter-clockwise, or ``imir`` with the axis that is reversed: 0 for rows, 1
        for columns.
    """
    meta = next((body for kind, body in _boxes(data) if kind == b"meta"), b"")
    boxes = dict(_boxes(meta[4:]))
    version, primary = boxes[b"pitm"][0], boxes[b"pitm"][4:]
    item = int.from_bytes(primary[: 4 if version else 2])
    properties = list(_boxes(boxes.get(b"iprp", b"")))
    held = [each for kind, body in properties if kind == b"ipco" for each in _boxes(body)]
    steps = []
    for index in (index for kind, body in properties if kind == b"ipma" for index in _associated(body, item)):
        kind, body = held[index - 1] if 0 < index <= len(held) else (b"", b"")
        value = body[0] & (3 if kind == _TURN else 1) if body else 0
        if (kind == _TURN and value) or kind == _MIRROR:
            steps.append((kind, value))
    return steps


def _associated(table: bytes, item: int) -> list[int]:
    """Numbers, from 1 on, of an item's properties, by the content of the box ``ipma``."""
    identifier = ">I" if table[0] else ">H"
    wide = table[3] & 1
    (count,), at = struct.unpack_from(">I", table, 4), 8
    for _ in range(count):
        (current,) = struct.unpack_from(identifier, table, at)
        at += struct.calcsize(identifier)
        number, at = table[at], at + 1
        stored = table[at : at + number * (1 + wide)]
        at += len(stored)
        if current == item:  # the top bit says that a reader must know the property
            indices = struct.unpack(f">{number}{'H' if wide else 'B'}", stored)
            return [index & (0x7FFF if wide else 0x7F) for index in indices]
    return []


def _boxes(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Kind and content of the boxes that follow one another (ISO/IEC 14496-12, 4.2)."""
    at = 0
    while at + 8 <= len(data):
        size, kind = struct.unpack_from(">I4s", data, at)
        begin = at + 8
        if size == 1:
            (size,), begin = struct.unpack_from(">Q", data, begin), begin + 8
        end = at + size if size else len(data)
        if end < begin:
            return
        yield kind, data[begin:end]
        at = end
