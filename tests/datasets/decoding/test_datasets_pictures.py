"""Pictures: every format the same grey levels, every broken file a reason."""

from __future__ import annotations

import io
import pickle
import re
import struct
import zlib

import cv2
import numpy as np
import pytest
from data_makers import picture
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from PIL.PngImagePlugin import PngImageFile

from pipeline.camera.quantise import to_8bit
from pipeline.datasets.decoding.pictures import (
    BadPicture,
    Picture,
    _scaled,
    picture_size,
    read_grey,
    read_grey8,
    read_picture,
)

GREY = picture("pictures", 61, 45)
COLOUR = np.stack([GREY, GREY[::-1], np.roll(GREY, 7, axis=1)], axis=2)
LUMA = np.tensordot(COLOUR.astype(float), [0.299, 0.587, 0.114], axes=1) / 255


def encoded(image: np.ndarray, file_format: str, **options) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(image).save(buffer, file_format, **options)
    return buffer.getvalue()


@pytest.mark.parametrize("suffix", ["png", "tiff", "bmp", "pgm"])
def test_eight_bit_grey_is_read_exactly(tmp_path, suffix):
    path = tmp_path / f"a.{suffix}"
    cv2.imwrite(str(path), GREY)
    grey = read_grey(path)
    assert grey.dtype == np.float32
    assert np.array_equal(grey, GREY.astype(np.float32) / np.float32(255))
    assert np.array_equal(read_grey8(path), GREY)
    assert picture_size(path) == (61, 45)


@pytest.mark.parametrize("file_format", ["PNG", "TIFF", "BMP"])
def test_colour_becomes_luma(tmp_path, file_format):
    path = tmp_path / f"a.{file_format.lower()}"
    path.write_bytes(encoded(COLOUR, file_format))
    assert np.allclose(read_grey(path), LUMA, atol=1e-6)
    assert read_picture(path).colour


def test_jpeg_decodes_as_opencv_does(tmp_path):
    path = tmp_path / "a.jpg"
    path.write_bytes(encoded(COLOUR, "JPEG", quality=95))
    theirs = cv2.cvtColor(cv2.imread(str(path)).astype(np.float32), cv2.COLOR_BGR2GRAY)
    assert np.abs(read_grey(path) * 255 - theirs).max() < 1.01  # decoders may differ by a rounding


def netpbm(values: np.ndarray, maxval: int, *, plain: bool = False) -> bytes:
    """A PGM or PPM file with two bytes a value, or with decimal numbers."""
    kind = (3 if plain else 6) if values.ndim == 3 else (2 if plain else 5)
    header = f"P{kind}\n# of a test\n{values.shape[1]} {values.shape[0]}\n{maxval}\n".encode()
    return header + (" ".join(map(str, values.ravel())).encode() if plain else values.astype(">u2").tobytes())


@pytest.mark.parametrize("maxval", [65535, 4095, 1000])
@pytest.mark.parametrize("plain", [False, True])
@pytest.mark.parametrize("colour", [False, True])
def test_deep_netpbm_files_are_scaled_by_the_greatest_value_they_state(tmp_path, maxval, plain, colour):
    values = np.rint((COLOUR if colour else GREY) / 255.0 * maxval).astype(np.uint16)
    path = tmp_path / "a.pgm"
    path.write_bytes(netpbm(values, maxval, plain=plain))
    read = read_picture(path)
    assert read.pixels.dtype == np.uint16 and read.pixels.shape == values.shape
    assert np.array_equal(np.rint(read.pixels / (65535 / maxval)), values)
    assert np.allclose(read_grey(path), LUMA if colour else GREY / 255, atol=0.6 / maxval)


def test_comments_among_the_decimal_numbers_of_a_netpbm_file_are_no_values(tmp_path):
    path, values = tmp_path / "a.pgm", np.arange(600, dtype=np.uint16).reshape(20, 30)
    lines = ["0 # 7 8", *map(str, values.ravel()[1:])]
    path.write_bytes(b"P2\n30 20\n1000\n" + "\n".join(lines).encode())
    assert np.array_equal(read_picture(path).file_values(), values)


def test_deep_netpbm_files_are_refused_where_their_values_do_not_fit_the_header(tmp_path):
    path, values = tmp_path / "a.pgm", np.full((20, 30), 5000, np.uint16)
    for content, reason in (
        (netpbm(values, 65535)[:-3], "truncated: 598 values, its header states 600"),
        (netpbm(values, 65535, plain=True)[:-5], "truncated: 599 values, its header states 600"),
        (netpbm(values, 4095), "values from 0 to 5000, its header states 0 to 4095"),
        (netpbm(values, 65535, plain=True)[:-4] + b"none", "cannot be decoded"),
    ):
        path.write_bytes(content)
        with pytest.raises(BadPicture, match=reason):
            read_picture(path)


@pytest.mark.parametrize("suffix", ["png", "tiff"])
@pytest.mark.parametrize("colour", [False, True])
def test_sixteen_bits_are_scaled_by_their_range(tmp_path, suffix, colour):
    deep = (COLOUR if colour else GREY).astype(np.uint16) * 257 - (np.arange(61) % 3).astype(np.uint16)[
        None, :, *([None] if colour else [])
    ] * (np.asarray(COLOUR if colour else GREY) > 0)
    path = tmp_path / f"a.{suffix}"
    cv2.imwrite(str(path), deep[..., ::-1] if colour else deep)
    expected = deep.astype(float) / 65535
    if colour:
        expected = np.tensordot(expected, [0.299, 0.587, 0.114], axes=1)
    assert np.allclose(read_grey(path), expected, atol=1e-6)  # finer than 8 bits: 1/65535 = 1.5e-5
    assert read_picture(path).pixels.dtype == np.uint16


@pytest.mark.parametrize(
    ("greatest", "bits"),
    [(0, None), (1, 8), (255, 8), (256, 10), (1023, 10), (4095, 12), (4096, 14), (16383, 14), (16384, None)],
)
def test_sixteen_bits_with_small_values_may_have_fewer(greatest, bits):
    grey, colour = np.zeros((20, 20), np.uint16), np.zeros((20, 20, 3), np.uint16)
    grey[3, 4] = colour[3, 4, 1] = greatest
    assert Picture(grey).fewer_bits() == Picture(colour).fewer_bits() == bits


def test_only_sixteen_bits_may():
    assert Picture(np.full((20, 20), 9, np.uint8)).fewer_bits() is None
    assert Picture(np.full((20, 20), 0.01, np.float32)).fewer_bits() is None


@pytest.mark.parametrize("mode", ["RGBA", "LA"])
def test_alpha_is_dropped_and_said(tmp_path, mode):
    opaque = Image.fromarray(COLOUR if mode == "RGBA" else GREY)
    opaque.putalpha(Image.fromarray(GREY))
    assert opaque.mode == mode
    path = tmp_path / "a.png"
    opaque.save(path)
    assert read_picture(path).alpha
    assert np.allclose(read_grey(path), LUMA if mode == "RGBA" else GREY / 255, atol=1e-6)


def test_sixteen_bit_alpha_png(tmp_path):
    path = tmp_path / "a.png"
    deep = np.dstack([COLOUR[..., ::-1].astype(np.uint16) * 257, np.full(GREY.shape, 65535, np.uint16)])
    cv2.imwrite(str(path), deep)
    assert np.allclose(read_grey(path), LUMA, atol=1e-6)


@pytest.mark.parametrize("mode", ["1", "P", "CMYK"])
def test_other_pixel_formats(tmp_path, mode):
    path = tmp_path / ("a.tiff" if mode == "CMYK" else "a.png")
    converted = Image.fromarray(COLOUR).convert(mode)
    converted.save(path)
    luma = np.asarray(converted.convert("RGB")).astype(float) @ [0.299, 0.587, 0.114] / 255
    assert np.allclose(read_grey(path), luma, atol=1e-6)


def test_float_tiff(tmp_path):
    path = tmp_path / "a.tiff"
    values = (GREY / 255).astype(np.float32)
    Image.fromarray(values).save(path)
    assert np.array_equal(read_grey(path), values)
    values[3, 4] = np.nan
    Image.fromarray(values).save(path)
    with pytest.raises(BadPicture, match="1 values are NaN"):
        read_grey(path)
    Image.fromarray((GREY * 2.0).astype(np.float32)).save(path)
    with pytest.raises(BadPicture, match=r"expected \[0, 1\]"):
        read_grey(path)


ENCODINGS = [
    ("PNG", {}),
    ("JPEG", {}),
    ("JPEG", {"progressive": True}),
    ("TIFF", {}),
    ("TIFF", {"compression": "tiff_lzw"}),
    ("BMP", {}),
    ("WEBP", {}),
]


@pytest.mark.parametrize(("file_format", "options"), ENCODINGS)
@given(data=st.data())
def test_any_truncation_is_noticed(tmp_path_factory, file_format, options, data):
    whole = encoded(COLOUR, file_format, **options)
    # JPEG ends with its end marker, whose own loss is noticed too; a TIFF may carry unused bytes at its very end
    spare = 8 if file_format == "TIFF" else 1
    kept = data.draw(st.integers(1, len(whole) - spare))
    path = tmp_path_factory.mktemp("cut") / "a.bin"
    path.write_bytes(whole[:kept])
    with pytest.raises(BadPicture) as caught:
        read_grey(path)
    assert str(path) in str(caught.value)
    assert caught.value.reason


@pytest.mark.parametrize("file_format", ["PNG", "JPEG", "BMP", "WEBP"])
@pytest.mark.parametrize("image", [GREY, COLOUR], ids=["grey", "colour"])
@pytest.mark.parametrize("lost", range(1, 9))
def test_loss_of_the_last_bytes_is_noticed(tmp_path, file_format, image, lost):
    path = tmp_path / "a.bin"
    path.write_bytes(encoded(image, file_format)[:-lost])
    with pytest.raises(BadPicture):
        read_grey(path)


def test_broken_files_say_why_and_how_to_mend_it(tmp_path):
    second = {"save_all": True, "append_images": [Image.fromarray(COLOUR)]}
    cases = {
        "empty.png": (b"", "empty file (0 bytes); copy or download the file again"),
        "cut.bmp": (
            encoded(GREY, "BMP")[:-99],
            "truncated (image file is truncated (29 bytes not processed)); copy or download the file again",
        ),
        "text.png": (
            b"this is no picture at all",
            "not a picture, or its header is broken; expected PNG, JPEG or TIFF",
        ),
        "pages.tif": (
            encoded(GREY, "TIFF", **second),
            "expected one; store each in a file of its own, for example by t",
        ),
        "frames.gif": (
            encoded(GREY, "GIF", **second),
            "2 pages or frames, expected one; store each in a file of its own",
        ),
        "vast.png": (
            png(GREY, 3_000_000),
            "too large: image size (183000000 pixels) exceeds limit of 178956970 pixels; cut it into parts",
        ),
        "small.png": (encoded(GREY[:9, :], "PNG"), "too small: 61x9 px"),
    }
    for name, (content, reason) in cases.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(BadPicture, match=re.escape(reason)):
            read_grey(tmp_path / name)
    with pytest.raises(BadPicture, match="no such file"):
        read_grey(tmp_path / "absent.png")
    with pytest.raises(BadPicture, match="cannot be read"):
        read_grey(tmp_path)


def png(rows: np.ndarray, height_px: int) -> bytes:
    """A file of 8-bit grey whose header states this height, complete but for its rows."""
    header = struct.pack(">IIBBBBB", rows.shape[1], height_px, 8, 0, 0, 0, 0)
    pixels = b"".join(b"\0" + row.tobytes() for row in rows)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(pixels)), (b"IEND", b""))
    parts = (struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
             for name, data in chunks)  # fmt: skip
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


def test_a_png_that_ends_well_with_fewer_rows_than_its_header_states_is_truncated(tmp_path):
    """A decoder fills the others with black."""
    path = tmp_path / "a.png"
    path.write_bytes(png(GREY, 45))
    assert np.array_equal(read_grey8(path), GREY)
    path.write_bytes(png(GREY[:40], 45))
    with pytest.raises(BadPicture, match="truncated: 2480 bytes of pixels, its header states 2790"):
        read_grey(path)


@pytest.mark.parametrize("colour", [0, 6])
def test_a_small_png_with_a_huge_header_is_not_decoded(tmp_path, monkeypatch, colour):
    """A file of 8 by 8 pixels whose header states 13000 by 13000 of 16 bits, which would take gigabytes."""
    header = struct.pack(">IIBBBBB", 13_000, 13_000, 16, colour, 0, 0, 0)
    chunk = b"IHDR" + header
    whole = encoded(GREY, "PNG")
    path = tmp_path / "huge.png"
    path.write_bytes(whole[:12] + chunk + struct.pack(">I", zlib.crc32(chunk)) + whole[33:])
    monkeypatch.setattr(PngImageFile, "load", lambda _: pytest.fail("pixels were decoded"))
    with pytest.raises(BadPicture, match="cannot hold"):
        read_grey(path)


def test_the_small_second_picture_of_a_telephones_jpeg_is_no_page(tmp_path):
    """It is a Multi-Picture file (MPO), which is read as the JPEG that it begins with."""
    path, first = tmp_path / "a.jpg", Image.fromarray(COLOUR)
    path.write_bytes(encoded(COLOUR, "JPEG"))
    alone = read_grey(path)
    first.save(path, "MPO", save_all=True, append_images=[first.resize((20, 15))])
    with Image.open(path) as opened:
        assert (opened.format, opened.n_frames) == ("MPO", 2)
    assert np.array_equal(read_grey(path), alone)


def test_pages_are_refused(tmp_path):
    path = tmp_path / "a.tiff"
    first = Image.fromarray(GREY)
    first.save(path, save_all=True, append_images=[first, first])
    with pytest.raises(BadPicture, match="3 pages"):
        read_grey(path)


def test_bad_picture_crosses_processes():
    error = pickle.loads(pickle.dumps(BadPicture("a/b.png", "truncated")))
    assert (str(error), error.reason) == ("a/b.png: truncated", "truncated")


def test_size_of_what_is_no_picture(tmp_path):
    (tmp_path / "a.png").write_bytes(b"no")
    assert picture_size(tmp_path / "a.png") is None
    assert picture_size(tmp_path / "absent.png") is None


@given(st.floats(-1, 2, width=32))
def test_eight_bit_rounds_to_nearest(value):
    level = int(to_8bit(np.array([value], np.float32))[0])
    assert abs(level - min(max(value, 0), 1) * 255) <= 0.5 + 1e-4


@pytest.mark.shared
def test_odd_tiff_directory_without_a_word(shared, capfd):
    path = sorted((shared / "realdata" / "sim_authors" / "images").glob("*.tiff"))[0]
    grey = read_grey(path)
    assert grey.shape == (768, 896)
    assert np.array_equal(read_grey8(path), cv2.imdecode(np.frombuffer(path.read_bytes(), np.uint8), 0))
    capfd.readouterr()  # OpenCV's remarks
    read_grey(path)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("bits", [10, 12, 14, 16])
def test_the_values_of_a_file_come_back_from_the_16_bits_they_are_kept_in(bits):
    white = (1 << bits) - 1
    values = np.arange(white + 1)
    assert np.array_equal(Picture(_scaled(values, white), white=white).file_values(), values)
