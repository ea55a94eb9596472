"""Pictures and videos that no command can use, each as a function that writes one."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from data_makers import picture
from PIL import Image

WIDTH_PX, HEIGHT_PX = 224, 208


def encoded(suffix: str, image: np.ndarray | None = None) -> bytes:
    """A sharp picture in the format of a suffix."""
    image = picture("bad", WIDTH_PX, HEIGHT_PX) if image is None else image
    good, content = cv2.imencode(suffix, image)
    assert good
    return content.tobytes()


def png_chunk(name: bytes, content: bytes, checksum: int | None = None) -> bytes:
    """A PNG chunk, with its right checksum unless another is given."""
    check = zlib.crc32(name + content) if checksum is None else checksum
    return struct.pack(">I", len(content)) + name + content + struct.pack(">I", check)


def png(width_px: int, height_px: int, depth: int, colour: int, rows: bytes, *further: bytes) -> bytes:
    """A PNG file of the header fields given, whatever they are."""
    header = struct.pack(">IIBBBBB", width_px, height_px, depth, colour, 0, 0, 0)
    start = b"\x89PNG\r\n\x1a\n" + png_chunk(b"IHDR", header)
    return start + b"".join(further) + png_chunk(b"IDAT", zlib.compress(rows)) + png_chunk(b"IEND", b"")


def _cut(suffix: str, share: float) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        content = encoded(suffix)
        path.write_bytes(content[: int(len(content) * share)])

    return write


def _bytes(content: bytes) -> Callable[[Path], None]:
    return lambda path: path.write_bytes(content) and None


def _overwritten(suffix: str, start: int, count: int) -> Callable[[Path], None]:
    """A picture some of whose bytes are replaced, ``start`` bytes from its begin."""

    def write(path: Path) -> None:
        content = bytearray(encoded(suffix))
        content[start : start + count] = bytes(count)
        path.write_bytes(bytes(content))

    return write


def _float_tiff(values: Callable[[np.ndarray], np.ndarray]) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        image = values(picture("bad", WIDTH_PX, HEIGHT_PX).astype(np.float32) / 255)
        Image.fromarray(image.astype(np.float32)).save(path)

    return write


def _with(image: np.ndarray, value: float) -> np.ndarray:
    image[3, 4] = value
    return image


def _pages(path: Path) -> None:
    first = Image.fromarray(picture("bad", WIDTH_PX, HEIGHT_PX))
    first.save(path, save_all=True, append_images=[first, first])


def _integers(path: Path) -> None:
    Image.fromarray(picture("bad", WIDTH_PX, HEIGHT_PX).astype(np.int32) * 1000, mode="I").save(path)


def _sized(width_px: int, height_px: int) -> Callable[[Path], None]:
    return lambda path: path.write_bytes(encoded(path.suffix, picture("bad", width_px, height_px))) and None


def _dangling(path: Path) -> None:
    path.symlink_to(path.with_name("gone.png"))


def _loop(path: Path) -> None:
    path.symlink_to(path)


PICTURES: dict[str, Callable[[Path], object]] = {
    "empty.png": _bytes(b""),
    "empty.jpg": _bytes(b""),
    "one_byte.png": _bytes(b"\x89"),
    "text.png": _bytes(b"this is no picture\n" * 20),
    "text.jpg": _bytes(b"this is no picture\n" * 20),
    "zeros.tif": _bytes(bytes(5000)),
    "html.jpg": _bytes(b"<!DOCTYPE html><html><body>404 Not Found</body></html>"),
    "svg.png": _bytes(b'<svg xmlns="http://www.w3.org/2000/svg" width="300" height="300"/>'),
    "pdf.tif": _bytes(b"%PDF-1.7\n1 0 obj\n<<>>\nendobj\n"),
    "heif.jpg": _bytes(b"\x00\x00\x00\x18ftypheic\x00\x00\x00\x00mif1heic" + bytes(200)),
    "zip.bmp": _bytes(b"PK\x03\x04" + bytes(300)),
    "header_only.jpg": _bytes(b"\xff\xd8\xff\xe0\x00\x10JFIF\x00"),
    "header_only.png": _bytes(b"\x89PNG\r\n\x1a\n"),
    "cut.png": _cut(".png", 0.6),
    "cut_at_end.png": lambda path: path.write_bytes(encoded(".png")[:-12]),
    "cut.jpg": _cut(".jpg", 0.5),
    "cut.tif": _cut(".tif", 0.5),
    "cut.bmp": _cut(".bmp", 0.5),
    "cut.webp": _cut(".webp", 0.5),
    "cut.pgm": _cut(".pgm", 0.5),
    "damaged_data.png": _overwritten(".png", 3000, 400),
    "damaged_header.bmp": _overwritten(".bmp", 10, 30),
    "damaged_tags.tif": lambda path: path.write_bytes(encoded(".tif")[:4] + b"\xff\xff\xff\x7f" + encoded(".tif")[8:]),
    "no_width.png": _bytes(png(0, 64, 8, 0, b"")),
    "negative_size.pgm": _bytes(b"P5\n-200 200\n255\n" + bytes(40_000)),
    "wrong_depth.png": _bytes(png(64, 64, 7, 0, bytes(65 * 64))),
    "wrong_colour.png": _bytes(png(64, 64, 8, 5, bytes(65 * 64))),
    "no_palette.png": _bytes(png(64, 64, 8, 3, bytes(65 * 64))),
    "few_rows.png": _bytes(png(300, 300, 8, 0, bytes(301 * 20))),
    "bomb.png": _bytes(png(60_000, 60_000, 8, 0, bytes(1000))),
    "text_bomb.png": _bytes(
        png(64, 64, 8, 0, bytes(65 * 64), png_chunk(b"zTXt", b"a\0\0" + zlib.compress(bytes(3_000_000))))
    ),
    "nan.tif": _float_tiff(lambda image: _with(image, np.nan)),
    "infinite.tif": _float_tiff(lambda image: _with(image, np.inf)),
    "negative.tif": _float_tiff(lambda image: image - 0.5),
    "above_one.tif": _float_tiff(lambda image: image * 255),
    "pages.tif": _pages,
    "integers.tif": _integers,
    "tiny.png": _sized(1, 1),
    "narrow.png": _sized(400, 8),
    "low.jpg": _sized(8, 400),
    "dangling.png": _dangling,
    "loop.png": _loop,
}
"""File name -> function that writes it. None can be used by any command."""


def film_bytes(folder: Path, suffix: str, code: str, frames: int = 6, width_px: int = 224) -> bytes:
    """A short video in a container."""
    path = folder / f"whole{suffix}"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*code), 10, (width_px, HEIGHT_PX))
    for number in range(frames):
        image = np.roll(picture("bad", width_px, HEIGHT_PX), 3 * number, axis=1)
        writer.write(cv2.cvtColor(image, cv2.COLOR_GRAY2BGR))
    writer.release()
    content = path.read_bytes()
    path.unlink()
    return content


def _film_cut(suffix: str, code: str, share: float) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        content = film_bytes(path.parent, suffix, code)
        path.write_bytes(content[: int(len(content) * share)])

    return write


def _film_damaged(path: Path) -> None:
    content = bytearray(film_bytes(path.parent, ".mp4", "mp4v", 20))
    start = content.find(b"mdat") + 3000
    content[start : start + 3000] = bytes(range(250)) * 12
    path.write_bytes(bytes(content))


VIDEOS: dict[str, Callable[[Path], object]] = {
    "empty.mp4": _bytes(b""),
    "empty.avi": _bytes(b""),
    "text.mp4": _bytes(b"this is no video\n" * 50),
    "text.avi": _bytes(b"this is no video\n" * 50),
    "zeros.mkv": _bytes(bytes(20_000)),
    "sound.mp4": _bytes(b"RIFF\x24\x00\x00\x00WAVEfmt \x10\x00\x00\x00\x01\x00\x01\x00" + bytes(64)),
    "cut.avi": _film_cut(".avi", "MJPG", 0.5),
    "cut_early.avi": _film_cut(".avi", "MJPG", 0.02),
    "cut.mp4": _film_cut(".mp4", "mp4v", 0.5),
    "cut_index.mp4": _film_cut(".mp4", "mp4v", 0.97),
    "damaged.mp4": _film_damaged,
    "header_only.mkv": _bytes(b"\x1a\x45\xdf\xa3" + bytes(60)),
    "no_frames.avi": lambda path: path.write_bytes(film_bytes(path.parent, ".avi", "MJPG", 0)),
}
"""File name -> function that writes it: none, or not all, of the frames can be read."""
