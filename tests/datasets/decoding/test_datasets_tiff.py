"""TIFF and JPEG 2000 files of other depths than 8 bits: their headers count, and pixels are those stored."""

from __future__ import annotations

import io
import struct
from pathlib import Path

import cv2
import numpy as np
import pytest
from data_makers import picture
from PIL import Image

from pipeline.datasets.decoding.pictures import BadPicture, picture_size, read_grey, read_picture
from pipeline.datasets.decoding.raw_frames import raw_frames

GREY = picture("tiff", 62, 45)
COLOUR = np.stack([GREY, GREY[::-1], np.roll(GREY, 7, axis=1)], axis=2)
DEEP, DEEP_COLOUR = GREY.astype(np.uint16) * 257 ^ 3, COLOUR.astype(np.uint16) * 257 ^ 3
FLOAT = (GREY / 255).astype(np.float32)


def packed(values: np.ndarray, bits: int) -> bytes:
    """Rows of values without a gap between them, the greatest bit first."""
    digits = (values.reshape(len(values), -1)[..., None] >> np.arange(bits - 1, -1, -1)) & 1
    return b"".join(np.packbits(row.ravel()).tobytes() for row in digits.astype(np.uint8))


def tiff(
    values: np.ndarray,
    *,
    bits: int = 0,
    photometric: int = 1,
    orientation: int = 1,
    order: str = "<",
    content: bytes = b"",
    planar: bool = False,
) -> bytes:
    """A TIFF file of one uncompressed strip, by the values' type; `content` instead of them, of so many bits.

    A planar one has a strip of each channel.
    """
    channels = values.shape[2] if values.ndim == 3 else 1
    stored = np.moveaxis(values, 2, 0) if planar and channels > 1 else values
    content = content or stored.astype(values.dtype.newbyteorder(order)).tobytes()
    bits = bits or 8 * values.dtype.itemsize
    sample_format = {"u": 1, "i": 2, "f": 3}[values.dtype.kind]
    strips = channels if planar else 1
    size = len(content) // strips
    tags = [
        (256, values.shape[1]), (257, values.shape[0]), (258, bits), (259, 1), (262, photometric),
        (273, *range(8, 8 + len(content), size)), (274, orientation), (277, channels), (278, values.shape[0]),
        (279, *[size] * strips), (284, 2 if planar else 1), (339, sample_format),
    ]  # fmt: skip
    directory, lists = struct.pack(f"{order}H", len(tags)), b""
    for tag, *numbers in tags:
        value = numbers[0] if len(numbers) == 1 else 8 + len(content) + len(lists)
        lists += struct.pack(f"{order}{len(numbers)}I", *numbers) if len(numbers) > 1 else b""
        directory += struct.pack(f"{order}HHII", tag, 4, len(numbers), value)
    magic = b"II*\0" if order == "<" else b"MM\0*"
    return magic + struct.pack(f"{order}I", 8 + len(content) + len(lists)) + content + lists + directory + bytes(4)


def save(path: Path, content: bytes) -> Path:
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("bits", [10, 12, 14])
@pytest.mark.parametrize("colour", [False, True])
def test_values_of_fewer_bits_than_sixteen_are_scaled_by_the_depth_of_the_header(tmp_path, order, bits, colour):
    values = (DEEP_COLOUR if colour else DEEP) >> (16 - bits)
    file = tiff(values, bits=bits, photometric=2 if colour else 1, order=order, content=packed(values, bits))
    read = read_picture(save(tmp_path / "a.tif", file))
    assert read.pixels.dtype == np.uint16 and read.fewer_bits() is None  # no guess: the header states it
    white = (1 << bits) - 1
    assert np.array_equal(read.pixels, np.rint(values * (65535 / white)).astype(np.uint16))
    assert read.white == white and np.array_equal(read.file_values(), values)


@pytest.mark.parametrize("order", ["<", ">"])
def test_white_is_zero_is_turned_over(tmp_path, order):
    for values, white in ((GREY, 255), (DEEP, 65535)):
        read = read_picture(save(tmp_path / "a.tif", tiff(white - values, photometric=0, order=order)))
        assert np.array_equal(read.pixels, values)
    values = DEEP >> 4
    file = tiff(values, bits=12, photometric=0, order=order, content=packed(4095 - values, 12))
    assert np.array_equal(read_picture(save(tmp_path / "a.tif", file)).file_values(), values)
    read = read_picture(save(tmp_path / "a.tif", tiff(1 - FLOAT, photometric=0, order=order)))
    assert np.allclose(read.pixels, FLOAT, atol=1e-7)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_floats_in_zero_to_one_are_read_in_grey_and_colour(tmp_path, order, kind):
    read = read_picture(save(tmp_path / "a.tif", tiff((GREY / 255).astype(kind), order=order)))
    assert read.pixels.dtype == np.float32 and np.allclose(read.pixels, FLOAT, atol=1e-7)
    path = save(tmp_path / "b.tif", tiff((COLOUR / 255).astype(kind), photometric=2, order=order))
    assert np.allclose(read_grey(path), COLOUR @ [0.299, 0.587, 0.114] / 255, atol=1e-6)
    for values, reason in ((COLOUR * 2.0, r"float values from .* expected \[0, 1\]"), (COLOUR * np.nan, "are NaN")):
        with pytest.raises(BadPicture, match=reason):
            read_picture(save(tmp_path / "c.tif", tiff(values.astype(kind), photometric=2, order=order)))


@pytest.mark.parametrize(
    ("file", "reason"),
    [
        (tiff(FLOAT.astype(np.float16)), "floating-point values of 16 bits that is not read"),
        (tiff((GREY // 2).astype(np.int8)), "holds signed integers"),
        (tiff((DEEP // 2).astype(np.int16)), "holds signed integers"),
        (tiff(DEEP, bits=11, content=packed(DEEP >> 5, 11)), "integer values of 11 bits that is not read"),
        (tiff(GREY.astype(np.uint32)), "not supported"),
    ],
)
def test_other_values_are_named(tmp_path, file, reason):
    with pytest.raises(BadPicture, match=reason):
        read_picture(save(tmp_path / "a.tif", file))


@pytest.mark.parametrize("order", ["<", ">"])
def test_deep_colours_stored_plane_by_plane_are_refused(tmp_path, order):
    """Pillow reads those of 8 bits right; of others it and OpenCV return pixels that are not the file's."""
    path = save(tmp_path / "a.tif", tiff(COLOUR, photometric=2, order=order, planar=True))
    assert np.array_equal(read_picture(path).pixels, COLOUR)
    ink = np.dstack([255 - DEEP_COLOUR, np.zeros_like(DEEP)])
    for values, photometric in ((DEEP_COLOUR, 2), (FLOAT[..., None].repeat(3, axis=2), 2), (ink, 5)):
        save(path, tiff(values, photometric=photometric, order=order, planar=True))
        with pytest.raises(BadPicture, match=r"colours of \d+ bits stored plane by plane; store them interleaved"):
            read_picture(path)
    grey = FLOAT.astype(np.float64)  # one plane
    assert np.array_equal(read_picture(save(path, tiff(grey, order=order, planar=True))).pixels, FLOAT)


def test_a_file_that_only_opencv_reads_is_refused_where_it_is_cut_or_has_pages(tmp_path):
    file = tiff((COLOUR / 255).astype(np.float32), photometric=2)
    directory = 8 + COLOUR.size * 4
    cut = struct.pack("<4sI", file[:4], 8) + file[directory:] + file[8 : directory - 100]  # directory first
    cut = cut.replace(struct.pack("<HHII", 273, 4, 1, 8), struct.pack("<HHII", 273, 4, 1, 8 + len(file) - directory))
    with pytest.raises(BadPicture, match="truncated: .* its header states"):
        read_picture(save(tmp_path / "a.tif", cut))
    with pytest.raises(BadPicture, match="several pages"):
        read_picture(save(tmp_path / "a.tif", file[:-4] + struct.pack("<I", directory)))


@pytest.mark.parametrize("orientation", range(1, 9))
def test_turned_files_are_read_as_stored(tmp_path, orientation):
    """Pillow and OpenCV turn them for display; rows of the sensor stay rows."""
    for values in (GREY, DEEP, COLOUR, DEEP_COLOUR, FLOAT, (COLOUR / 255).astype(np.float32)):
        file = tiff(values, photometric=2 if values.ndim == 3 else 1, orientation=orientation)
        path = save(tmp_path / "a.tif", file)
        assert np.array_equal(read_picture(path).pixels, values), values.dtype
        assert picture_size(path) == (62, 45)


def test_sixteen_bit_cmyk_is_converted_not_taken_for_colours(tmp_path):
    ink = np.dstack([255 - COLOUR, np.zeros_like(GREY)])
    read = read_picture(save(tmp_path / "a.tif", tiff(ink.astype(np.uint16) * 257, photometric=5)))
    assert np.abs(read.pixels.astype(int) - COLOUR).max() <= 1


@pytest.mark.parametrize("values", [DEEP, DEEP_COLOUR], ids=["grey", "colour"])
def test_deep_jpeg_2000_keeps_its_highlights(tmp_path, values):
    """Pillow wraps the brightest sixteen-bit colours round to 0."""
    deep = np.clip(values.astype(int) + 30000, 0, 65535).astype(np.uint16)
    coded = cv2.imencode(
        ".jp2", deep[..., ::-1] if deep.ndim == 3 else deep, [cv2.IMWRITE_JPEG2000_COMPRESSION_X1000, 1000]
    )
    assert np.array_equal(read_picture(save(tmp_path / "a.jp2", coded[1].tobytes())).pixels, deep)


def test_twelve_bit_jpeg_2000_is_scaled_by_its_depth(tmp_path):
    from fractions import Fraction

    import av

    for pixels, depth in (("gray12le", 4095), ("gray16le", 65535)):
        codec = av.CodecContext.create("jpeg2000", "w")
        codec.width, codec.height, codec.pix_fmt, codec.time_base = 62, 44, pixels, Fraction(1, 25)
        frame = av.VideoFrame.from_ndarray(DEEP[:44], format="gray16le").reformat(format=pixels)
        content = b"".join(bytes(packet) for packet in [*codec.encode(frame), *codec.encode(None)])
        read = read_picture(save(tmp_path / "a.jp2", content))
        assert read.white == depth and np.abs(read_grey(tmp_path / "a.jp2") - DEEP[:44] / 65535).mean() < 0.02


def test_raw_frames_are_in_the_values_of_the_file(tmp_path):
    values = DEEP >> 4
    save(tmp_path / "a_5ms.tif", tiff(values, bits=12, content=packed(values, 12)))
    header = f"P5\n{DEEP.shape[1]} {DEEP.shape[0]}\n4095\n".encode()
    save(tmp_path / "b_5ms.pgm", header + values.astype(">u2").tobytes())
    for frame in raw_frames(tmp_path):
        assert np.array_equal(frame.pixels(), values)


def test_a_whole_file_of_pillow_is_not_called_cut(tmp_path):
    for options in ({}, {"compression": "tiff_lzw"}, {"compression": "tiff_deflate"}):
        buffer = io.BytesIO()
        Image.fromarray(GREY).save(buffer, "TIFF", **options)
        assert np.array_equal(read_picture(save(tmp_path / "a.tif", buffer.getvalue())).pixels, GREY)
