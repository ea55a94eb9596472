"""Pictures: any common file to grey levels, or a clear word on why not.

| file | what happens |
|---|---|
| 8-bit grey | divided by 255 |
| 16-bit grey or colour | divided by 65535, whatever part of the range it uses; see `Picture.fewer_bits` |
| PGM or PPM; TIFF and JPEG 2000 of 10, 12 or 14 bits | divided by the greatest value that the header states |
| float (TIFF) of 32 or 64 bits | taken as it is; every value must be a number in [0, 1] |
| TIFF whose 0 is white (WhiteIsZero) | turned over |
| colour (RGB, palette, CMYK) | BT.601 luma: 0.299 R + 0.587 G + 0.114 B, not rounded |
| alpha channel | dropped; the colour beneath counts |
| rotation (EXIF, TIFF) | not applied: labels, rows and columns of the sensor refer to the pixels as stored |
| TIFF colours of more than 8 bits stored plane by plane | `BadPicture` |
| empty, truncated, not a picture, several pages, NaN, out of range, signed, too small | `BadPicture` with the reason |

Pillow decodes, because it notices files that end early: OpenCV returns a JPEG whose lower half is missing
as if it were whole, and writes to standard error about harmless oddities of TIFF directories. Where Pillow would
squeeze 16-bit colour to 8 bit, OpenCV decodes the file after Pillow has found it whole; so it does TIFF files of depths
and floats that Pillow does not read (`pipeline.datasets.decoding.tiff`), if they hold all the bytes that their header
states.
"""

from __future__ import annotations

import io
import re
import stat
import warnings
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING

import numpy as np

from pipeline.camera.quantise import to_8bit
from pipeline.datasets.decoding import tiff
from pipeline.errors import DECODER_ERRORS, InputError

if TYPE_CHECKING:
    from PIL import Image

SUFFIXES = frozenset({".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp", ".pgm", ".ppm"})
FEWER_BITS = (8, 10, 12, 14)
"""Depths whose values some cameras and programs store in 16 bits as they are."""
PNG_END = b"IEND\xaeB`\x82"  # the last chunk with its checksum
DEFLATE_RATIO = 1032  # PNG's compression cannot shrink data further
WHITE = (1 << 16) - 1
AGAIN = "copy or download the file again"
"""Remedy for a file that is not whole."""
SMALLEST_PX = 16  # below this neither side holds enough pixels for any filter in this package

_NETPBM = re.compile(rb"P([2356])" + 3 * rb"(?:\s|#[^\r\n]*)+([0-9]+)" + rb"\s")  # width, height, greatest value
_JPEG_2000 = b"\xff\x4f\xff\x51"  # start of a codestream, and of its SIZ marker
_NETPBM_PLAIN = b"23"  # kinds whose values are written as decimal numbers

_ALPHA_MODES = {"LA", "RGBA", "PA", "La", "RGBa"}
_PAGED_FORMATS = {"TIFF", "GIF", "PNG", "WEBP"}  # not MPO: a telephone's JPEG with a small second picture


class BadPicture(InputError):
    """A picture that cannot be used.

    Attributes:
        path: the file.
        reason: why, in a few words.
    """

    def __init__(self, path: str | Path, reason: str) -> None:
        self.path, self.reason = Path(path), reason
        super().__init__(f"{path}: {reason}")

    def __reduce__(self) -> tuple[type[BadPicture], tuple[Path, str]]:
        return BadPicture, (self.path, self.reason)  # so that it crosses from a worker process


@dataclass(frozen=True)
class Picture:
    """A decoded picture.

    Attributes:
        pixels: (H, W) or (H, W, 3) RGB; uint8, uint16, or float32 in [0, 1].
        alpha: whether the file had an alpha channel (dropped).
        white: of uint16 pixels the file's value that was scaled to 65535: 4095 where its header states 12 bits.
    """

    pixels: np.ndarray
    alpha: bool = False
    white: int = WHITE

    @property
    def colour(self) -> bool:
        return self.pixels.ndim == 3

    @property
    def bits(self) -> int:
        return 8 * self.pixels.dtype.itemsize

    def fewer_bits(self) -> int | None:
        """The depth that 16-bit pixels may really have, by their greatest value; a guess, they may just be dark.

        Returns:
            the least of `FEWER_BITS` that holds every value; None where none does, for other pixels, and for zeros.
        """
        greatest = int(self.pixels.max(initial=0)) if self.pixels.dtype == np.uint16 else 0
        return next((bits for bits in FEWER_BITS if 0 < greatest < 1 << bits), None)

    def file_values(self) -> np.ndarray:
        """The pixels in the values of the file (DN): uint16 ones are scaled back. Same shape and type."""
        if self.pixels.dtype != np.uint16 or self.white == WHITE:
            return self.pixels
        return np.rint(self.pixels * (self.white / WHITE)).astype(np.uint16)

    def unit(self) -> np.ndarray:
        """The pixels as float32 in [0, 1], same shape."""
        if self.pixels.dtype.kind == "f":
            return self.pixels
        return self.pixels.astype(np.float32) / np.float32(np.iinfo(self.pixels.dtype).max)

    def grey(self) -> np.ndarray:
        """Grey levels; see `read_grey`."""
        import cv2

        values = self.unit()
        return np.clip(cv2.cvtColor(values, cv2.COLOR_RGB2GRAY), 0, 1) if self.colour else values


def read_grey(path: str | Path, *, smallest_px: int = SMALLEST_PX) -> np.ndarray:
    """A picture file as grey levels.

    Args:
        path: a picture in one of the formats `SUFFIXES`.
        smallest_px: both sides must be at least this long.

    Returns:
        (H, W) float32 in [0, 1].

    Raises:
        BadPicture: the file cannot be used; the reason is named.
    """
    return read_picture(path, smallest_px=smallest_px).grey()


def read_grey8(path: str | Path, *, smallest_px: int = SMALLEST_PX) -> np.ndarray:
    """A picture file as 8-bit grey levels: `read_grey` times 255, rounded. (H, W) uint8."""
    return to_8bit(read_grey(path, smallest_px=smallest_px))


def picture_size(path: str | Path) -> tuple[int, int] | None:
    """Width and height in pixels from the header alone, or None where it cannot be read. Costs no decoding."""
    from PIL import Image, UnidentifiedImageError

    if not Path(path).is_file():
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            with Image.open(path) as opened:
                width, height = opened.size
                if opened.format == "TIFF":  # whose size is that of the turned picture
                    width, height = opened.tag_v2[256], opened.tag_v2[257]  # type: ignore[attr-defined]
                return int(width), int(height)
        except UnidentifiedImageError:  # of TIFF files some are read all the same
            header = tiff.read_header(Path(path).read_bytes())
            return None if header is None else (header.width, header.height)
        except (*DECODER_ERRORS, Image.DecompressionBombError):
            return None


def read_picture(path: str | Path, *, smallest_px: int = SMALLEST_PX) -> Picture:
    """Decode a picture file completely, or say why it cannot be used.

    Args:
        path: the file.
        smallest_px: both sides must be at least this long.

    Returns:
        the picture, colour channels in the order red, green, blue.

    Raises:
        BadPicture: see the table above.
    """
    try:
        if not stat.S_ISREG(Path(path).stat().st_mode):  # a pipe would be waited for without end
            raise BadPicture(path, "cannot be read (a folder, pipe or device, and no file)")
        data = Path(path).read_bytes()
    except FileNotFoundError:
        raise BadPicture(path, "no such file") from None
    except OSError as error:
        raise BadPicture(path, f"cannot be read ({error.strerror})") from None
    if not data:
        raise BadPicture(path, f"empty file (0 bytes); {AGAIN}")
    picture = _decode(path, data)
    height, width = picture.pixels.shape[:2]
    if min(height, width) < smallest_px:
        raise BadPicture(path, f"too small: {width}x{height} px, expected at least {smallest_px} px on either side")
    if picture.pixels.dtype not in (np.uint8, np.uint16, np.float32):
        raise BadPicture(path, f"pixels are {picture.pixels.dtype}, expected 8 or 16 bit, or 32-bit float in [0, 1]")
    if picture.pixels.dtype == np.float32:
        _check_range(path, picture.pixels)
    return picture


def _decode(path: str | Path, data: bytes) -> Picture:
    from PIL import Image, UnidentifiedImageError

    header = tiff.read_header(data)
    if header is not None and header.plane_by_plane and header.bits > 8:  # Pillow and OpenCV return other pixels
        reason = f"colours of {header.bits} bits stored plane by plane; store them interleaved, for example by"
        raise BadPicture(path, f"{reason} tiffcp -p contig")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Pillow's remarks on metadata; what matters is raised
        try:
            with open_with_pillow(io.BytesIO(data), data) as opened:
                _refuse_by_header(path, data, opened, header)
                if opened.format == "PPM" and (deep := _read_deep_netpbm(path, data)) is not None:
                    return deep
                opened.load()
                _refuse_incomplete(path, data, opened)
                alpha = opened.mode in _ALPHA_MODES or "transparency" in opened.info
                bits = _depth(opened, data, header)
                pixels = _pixels(path, data, opened, bits, header)
                return _picture(pixels, alpha, bits, header)
        except UnidentifiedImageError:
            if header is not None:
                return _read_other_tiff(path, data, header)
            raise BadPicture(path, "not a picture, or its header is broken; expected PNG, JPEG or TIFF") from None
        except Image.DecompressionBombError as error:
            size = str(error).partition(",")[0].lower()  # behind it stands a guess at an attack
            raise BadPicture(path, f"too large: {size}; cut it into parts") from None
        except DECODER_ERRORS as error:
            defect = "truncated" if "truncated" in str(error).lower() else "cannot be decoded"
            raise BadPicture(path, f"{defect} ({error}); {AGAIN}") from None


def open_with_pillow(file: str | Path | IO[bytes], start: bytes) -> Image.Image:
    """A picture file opened by Pillow; of the files of ISO media (``ftyp``) only AVIF.

    A reader of HEIF may be registered with Pillow, as imageio does: it takes AVIF files with a brand of HEIF first, and
    fails.

    Args:
        file: see ``PIL.Image.open``, whose errors are raised.
        start: its first 12 bytes, or more.
    """
    from PIL import Image

    if start[4:8] != b"ftyp":
        return Image.open(file)
    Image.init()  # else a format that is named is looked for among the commonest only
    return Image.open(file, formats=("AVIF",))


def _png_row_bits(data: bytes, opened: Image.Image) -> int:
    """Bits of a row of pixels by the header of a PNG file."""
    depth, colour = data[24], data[25]  # the IHDR chunk comes first
    return opened.width * depth * {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}.get(colour, 1)


def _refuse_by_header(
    path: str | Path, data: bytes, opened: Image.Image, header: tiff.TiffHeader | None = None
) -> None:
    """Refuse, before memory is taken for its pixels, what the header shows to be unusable.

    Raises:
        BadPicture: several pages, signed values, a broken PNG header, or fewer bytes than any compression needs for the
            stated size.
    """
    if header is not None and header.sample_format == tiff.SIGNED:
        raise BadPicture(path, "holds signed integers, expected unsigned ones of 8 or 16 bit, or float in [0, 1]")
    pages = getattr(opened, "n_frames", 1)
    if opened.format in _PAGED_FORMATS and pages > 1:
        tool = ", for example by tiffsplit" if opened.format == "TIFF" else ""
        raise BadPicture(path, f"holds {pages} pages or frames, expected one; store each in a file of its own{tool}")
    if opened.format != "PNG":
        return
    if data[12:16] != b"IHDR":
        raise BadPicture(path, f"its PNG header is broken; {AGAIN}")
    expected = opened.height * _png_row_bits(data, opened) // 8
    if expected > DEFLATE_RATIO * len(data):
        raise BadPicture(path, f"truncated: {len(data)} bytes cannot hold the {expected} its header states; {AGAIN}")


def _refuse_incomplete(path: str | Path, data: bytes, opened: Image.Image) -> None:
    """Refuse what Pillow fills in silently in a loaded BMP or PNG.

    Missing rows of a PNG are black, so the data are counted only where the last row is.

    Raises:
        BadPicture: the padding of a last row, an end marker, a palette or rows are missing.
    """
    if opened.format == "BMP" and len(data) < (size := int.from_bytes(data[2:6], "little")):
        raise BadPicture(path, f"truncated: {len(data)} bytes, its header states {size}; {AGAIN}")
    if opened.format != "PNG":
        return
    if PNG_END not in data:
        raise BadPicture(path, f"truncated: the PNG end marker is missing; {AGAIN}")
    if opened.mode == "P" and not (opened.palette and opened.palette.palette):
        raise BadPicture(path, f"its colour palette is missing; {AGAIN}")
    if opened.info.get("interlace") or np.asarray(opened)[-1].any():
        return
    expected = opened.height * (1 + (_png_row_bits(data, opened) + 7) // 8)  # each row begins with its filter
    count = _png_pixel_bytes(data)
    if count < expected:
        raise BadPicture(path, f"truncated: {count} bytes of pixels, its header states {expected}; {AGAIN}")


def _png_pixel_bytes(data: bytes) -> int:
    """Number of decompressed bytes in the IDAT chunks of a PNG file."""
    content, start, count = zlib.decompressobj(), 8, 0
    while start + 8 <= len(data):
        length, name = int.from_bytes(data[start : start + 4]), data[start + 4 : start + 8]
        if name == b"IDAT":
            count += len(content.decompress(data[start + 8 : start + 8 + length]))
        start += length + 12
    return count


def _pixels(
    path: str | Path, data: bytes, opened: Image.Image, bits: int, header: tiff.TiffHeader | None
) -> np.ndarray:
    """(H, W) or (H, W, 3) uint8, uint16 or float32 from an opened picture that has loaded without an error."""
    mode = opened.mode
    if bits > 8 and not mode.startswith(("I", "F")) and (header is None or header.grey_or_rgb):
        return _read_deep(path, data, bits, header)
    if mode == "L":
        return np.asarray(opened)
    if mode in {"1", "LA", "La"}:
        return np.asarray(opened.convert("L"))
    if mode.startswith("I;16") or (mode == "I" and opened.format == "PNG"):  # older Pillow opens 16-bit PNG as "I"
        values = np.asarray(opened).astype(np.uint16)
        # fewer bits are shifted to the top of JPEG 2000 files, not of TIFF files
        return _scaled(values >> (0 if header is not None else 16 - bits), (1 << bits) - 1)
    if mode == "F":
        return np.asarray(opened, dtype=np.float32)
    if mode in {"RGB", "RGBA", "RGBX", "RGBa", "P", "PA", "CMYK", "YCbCr"}:
        return np.asarray(opened.convert("RGB"))
    raise BadPicture(path, f"pixel format {mode!r} is not supported, expected 8 or 16 bit, or float in [0, 1]")


def _picture(pixels: np.ndarray, alpha: bool, bits: int, header: tiff.TiffHeader | None) -> Picture:
    """A picture whose 0 is black, as it is stored."""
    white = (1 << bits) - 1 if pixels.dtype == np.uint16 else WHITE
    if header is not None:
        pixels = tiff.as_stored(tiff.blackest_zero(pixels, header), header.orientation)
    return Picture(pixels, alpha, white)


def _depth(opened: Image.Image, data: bytes, header: tiff.TiffHeader | None) -> int:
    """Bits of a value by the file's header, where Pillow may have reduced them to 8; else 8."""
    if opened.format == "PNG":
        return max(data[24], 8)  # in the IHDR chunk
    if opened.format == "JPEG2000" and (begin := data.find(_JPEG_2000)) >= 0:
        return max((data[begin + 42] & 0x7F) + 1, 8)  # of the first component, in the SIZ marker
    return max(header.bits, 8) if header is not None else 8


def _scaled(values: np.ndarray, white: int) -> np.ndarray:
    """Values of which the greatest is white, as uint16 up to 65535."""
    return values.astype(np.uint16) if white == WHITE else np.rint(values * (WHITE / white)).astype(np.uint16)


def _read_deep(path: str | Path, data: bytes, bits: int, header: tiff.TiffHeader | None) -> np.ndarray:
    """(H, W, 3) or (H, W) uint16 or float from a PNG, TIFF or JPEG 2000 file with more than 8 bits a value."""
    import cv2

    log_level = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)  # it remarks on odd TIFF tags
    try:
        decoded = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:  # a header that states an impossible size
        decoded = None
    finally:
        cv2.utils.logging.setLogLevel(log_level)
    if decoded is None or decoded.dtype == np.uint8:
        raise BadPicture(path, f"holds values of {bits} bits that cannot be decoded, expected 8 or 16; {AGAIN}")
    pixels: np.ndarray = decoded if decoded.ndim == 2 else np.ascontiguousarray(decoded[..., 2::-1])  # BGR, BGRA to RGB
    if pixels.dtype != np.uint16:
        return pixels
    # here fewer bits are shifted to the top of TIFF files, not of JPEG 2000 files
    return _scaled(np.right_shift(pixels, 16 - bits if header is not None else 0), (1 << bits) - 1)


def _read_other_tiff(path: str | Path, data: bytes, header: tiff.TiffHeader) -> Picture:
    """A TIFF file of a depth, or of floats, that Pillow does not read.

    Raises:
        BadPicture: it is none that OpenCV reads, is not whole, or holds several pages.
    """
    from PIL import Image

    real = header.sample_format == tiff.FLOAT
    words = f"{'floating-point' if real else 'integer'} values of {header.bits} bits"
    depths = (32, 64) if real else (*tiff.PACKED_BITS, 16)
    if not header.grey_or_rgb or header.bits not in depths or header.sample_format == tiff.SIGNED:
        raise BadPicture(path, f"a TIFF file of {words} that is not read, expected 8 or 16 bit, or float in [0, 1]")
    if header.pages:
        raise BadPicture(path, "holds several pages, expected one; store each in a file of its own")
    if header.end > len(data):
        raise BadPicture(path, f"truncated: {len(data)} bytes, its header states {header.end}; {AGAIN}")
    limit = 2 * (Image.MAX_IMAGE_PIXELS or np.inf)
    if header.width * header.height > limit:
        size = f"image size ({header.width}x{header.height} px) exceeds limit of {limit} pixels"
        raise BadPicture(path, f"too large: {size}; cut it into parts")
    pixels = _read_deep(path, data, header.bits, header)
    return _picture(pixels.astype(np.float32) if real else pixels, False, header.bits, header)


def _read_deep_netpbm(path: str | Path, data: bytes) -> Picture | None:
    """(H, W) or (H, W, 3) uint16, of which 65535 is the greatest value that a PGM or PPM file states.

    Of these files Pillow reads grey as 32 bit, pixel by pixel, and squeezes colour to 8 bit.

    Returns:
        None for a file of 8 bit or of another kind.

    Raises:
        BadPicture: it is truncated, or has values that are no numbers or above the greatest that it states.
    """
    header = _NETPBM.match(data)
    if header is None or not 255 < (maxval := int(header[4])) < 1 << 16:
        return None
    width, height = int(header[2]), int(header[3])
    shape = (height, width, 3) if header[1] in b"36" else (height, width)
    count = int(np.prod(shape))
    if header[1] in _NETPBM_PLAIN:
        body = re.sub(rb"#[^\r\n]*", b"", data[header.end() :])
        values = np.array(body.split(maxsplit=count)[:count]).astype(np.int64)  # ValueError: not a number
    else:
        values = np.frombuffer(data, ">u2", count=min(count, (len(data) - header.end()) // 2), offset=header.end())
    if len(values) < count:
        raise BadPicture(path, f"truncated: {len(values)} values, its header states {count}; {AGAIN}")
    low, high = int(values.min(initial=0)), int(values.max(initial=0))
    if low < 0 or high > maxval:
        raise BadPicture(path, f"values from {low} to {high}, its header states 0 to {maxval}")
    return Picture(_scaled(values, maxval).reshape(shape), white=maxval)


def _check_range(path: str | Path, pixels: np.ndarray) -> None:
    if not np.isfinite(pixels).all():
        count = int((~np.isfinite(pixels)).sum())
        raise BadPicture(path, f"{count} values are NaN or infinite, expected [0, 1]; replace them")
    low, high = float(pixels.min()), float(pixels.max())
    if low < 0 or high > 1:
        raise BadPicture(path, f"float values from {low:g} to {high:g}, expected [0, 1]; rescale or store as integers")
