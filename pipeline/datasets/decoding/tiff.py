"""Headers of TIFF files: what decoders leave out of account, and pixels as they are stored.

Pillow reads 16-bit WhiteIsZero as its negative, 12-bit values without their depth, and neither other depths nor most
floats; it and OpenCV turn and mirror pixels as the orientation asks. Source: TIFF Revision 6.0, Adobe, 1992.
"""

from __future__ import annotations

import io
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.errors import DECODER_ERRORS

if TYPE_CHECKING:
    from numpy.typing import NDArray

SIGNED, FLOAT = 2, 3
"""Values of the tag SampleFormat; 1 is unsigned."""
PACKED_BITS = (10, 12, 14)
_MAGIC = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_WHITE_IS_ZERO, _BLACK_IS_ZERO, _RGB = 0, 1, 2
_SEPARATE_PLANES = 2  # of the tag PlanarConfiguration


@dataclass(frozen=True)
class TiffHeader:
    """Tags of the first page.

    Attributes:
        width, height: as stored, pixels.
        bits: of a value.
        sample_format: 1 unsigned, 2 signed, 3 float.
        photometric: 0 WhiteIsZero, 1 BlackIsZero, 2 RGB; others are neither grey nor RGB.
        orientation: 1..8; 1 is as stored.
        pages: more than one page follows.
        end: number of bytes that the file must have for its pixels; 0 where the header does not say.
        plane_by_plane: each channel of several is stored in a plane of its own, not beside the others of its pixel.
    """

    width: int
    height: int
    bits: int
    sample_format: int
    photometric: int
    orientation: int
    pages: bool
    end: int
    plane_by_plane: bool

    @property
    def grey_or_rgb(self) -> bool:
        """Whether its values are grey levels or red, green and blue."""
        return self.photometric in (_WHITE_IS_ZERO, _BLACK_IS_ZERO, _RGB)

    @property
    def white_is_zero(self) -> bool:
        """Whether 0 is white."""
        return self.photometric == _WHITE_IS_ZERO


def read_header(data: bytes) -> TiffHeader | None:
    """The header of a TIFF file; None for another file or one whose header is broken."""
    from PIL.TiffImagePlugin import ImageFileDirectory_v2

    if data[:4] not in _MAGIC:
        return None
    big = data[2:4] in (b"+\0", b"\0+")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Pillow's remarks on odd tags
        try:
            tags = ImageFileDirectory_v2(data[: 16 if big else 8])
            file = io.BytesIO(data)
            file.seek(tags.next)
            tags.load(file)
            bits, formats = _integers(tags.get(258, 1)), _integers(tags.get(339, 1))
            offsets, counts = _integers(tags.get(273, tags.get(324, ()))), _integers(tags.get(279, tags.get(325, ())))
            orientation = tags.get(274, 1)
            return TiffHeader(
                int(tags[256]),
                int(tags[257]),
                max(bits),
                max(formats),
                int(tags.get(262, _BLACK_IS_ZERO)),
                orientation if orientation in range(1, 9) else 1,
                tags.next != 0,
                max((start + count for start, count in zip(offsets, counts, strict=False)), default=0),
                tags.get(284) == _SEPARATE_PLANES and max(_integers(tags.get(277, 1))) > 1,
            )
        except DECODER_ERRORS:
            return None


def _integers(value: Any) -> tuple[int, ...]:
    return tuple(int(item) for item in (value if isinstance(value, (tuple, list)) else (value,)))


def blackest_zero(pixels: NDArray[Any], header: TiffHeader) -> NDArray[Any]:
    """Pixels whose 0 is black, from decoded ones of 16 bits or floats; those of 8 bits are turned over by decoders."""
    if not header.white_is_zero or pixels.dtype == np.uint8:
        return pixels
    return (1 if pixels.dtype.kind == "f" else np.iinfo(pixels.dtype).max) - pixels


def as_stored(pixels: NDArray[Any], orientation: int) -> NDArray[Any]:
    """Pixels as the file stores them, from those that a decoder has turned and mirrored for display.

    Args:
        pixels: (H, W) or (H, W, C).
        orientation: by the file's header.
    """
    turn = {
        2: lambda: pixels[:, ::-1],
        3: lambda: pixels[::-1, ::-1],
        4: lambda: pixels[::-1],
        5: lambda: pixels.swapaxes(0, 1),
        6: lambda: np.rot90(pixels),
        7: lambda: np.rot90(pixels, 2).swapaxes(0, 1),
        8: lambda: np.rot90(pixels, -1),
    }.get(orientation)
    return pixels if turn is None else np.ascontiguousarray(turn())
