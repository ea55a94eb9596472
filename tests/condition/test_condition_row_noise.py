"""Row and column noise: measured where whole rows or columns differ, 0 on scenes, pixel noise, codecs and patterns."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from data_makers import picture

from pipeline.camera.processing.codec import Codec, store
from pipeline.condition.row_noise import _median_of_nine, column_noise_dn, row_noise_dn
from pipeline.streams import stream

HEIGHT, WIDTH = 480, 720
SCENE = picture("row noise", WIDTH, HEIGHT)
Y, X = np.mgrid[:HEIGHT, :WIDTH].astype(np.float32)


def levels(values: np.ndarray) -> np.ndarray:
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)


def normal(sigma_dn: float, shape: tuple[int, int], *key: str | float) -> np.ndarray:
    return stream(0, "row noise", *key).normal(0, sigma_dn, shape)


def offsets(sigma_dn: float, rows: int = HEIGHT) -> np.ndarray:
    """Offsets of rows (rows, 1), DN."""
    return normal(sigma_dn, (rows, 1), "offsets", sigma_dn)


def measured(frame: np.ndarray) -> tuple[float, float]:
    return row_noise_dn(frame), column_noise_dn(frame)


def test_the_network_finds_medians():
    values = stream(0, "medians").integers(-300, 300, (9, 50, 7)).astype(np.int16)
    assert np.array_equal(_median_of_nine(values), np.median(values, axis=0))


@pytest.mark.parametrize("sigma_dn", [2.0, 5.0, 10.0, 20.0])
@pytest.mark.parametrize("white_dn", [0.0, 5.0])
def test_offsets_of_rows_and_of_columns_are_measured(sigma_dn, white_dn):
    white = normal(white_dn, SCENE.shape, "white", white_dn)
    banded = levels(SCENE + offsets(sigma_dn) + white)
    rows_dn, columns_dn = measured(banded)
    assert rows_dn == pytest.approx(sigma_dn, rel=0.15)
    assert columns_dn == 0
    assert measured(np.ascontiguousarray(banded.T)) == (columns_dn, rows_dn)


def test_offsets_are_measured_behind_a_jpeg_and_beside_black_bars():
    banded = levels(SCENE + offsets(5.0))
    coded = store(np.repeat(banded[..., None], 3, axis=2), Codec("jpeg", 90))[..., 0]
    assert row_noise_dn(coded) == pytest.approx(5.0, rel=0.2)
    boxed = np.zeros_like(banded)
    boxed[130:-130] = banded[130:-130]  # most rows are black
    assert row_noise_dn(boxed) == pytest.approx(5.0, rel=0.3)


@pytest.mark.parametrize("white_dn", [0.0, 2.0, 10.0, 25.0, 60.0])
def test_neither_a_scene_nor_white_noise_is_row_noise(white_dn):
    for scene in (SCENE, np.full(SCENE.shape, 128)):
        frame = levels(scene + normal(white_dn, SCENE.shape, "no rows", white_dn))
        assert max(measured(frame)) < 0.5
        sharpened = frame + 2 * (frame - cv2.GaussianBlur(frame.astype(np.float32), (0, 0), 1.2))
        assert np.nan_to_num(measured(levels(sharpened))).max() < 0.5  # NaN: clipped


@pytest.mark.parametrize("codec", [Codec("jpeg", 60), Codec("jpeg", 90), Codec("h264", 23), Codec("mjpeg", 8)])
@pytest.mark.parametrize("white_dn", [0.0, 5.0])
def test_the_blocks_of_codecs_are_not_row_noise(codec, white_dn):
    shading = 60 + 0.2 * Y + 0.1 * X  # whose steps between blocks are common to all strips
    for scene in (SCENE, shading):
        frame = np.repeat(levels(scene + normal(white_dn, SCENE.shape, "coded", white_dn))[..., None], 3, axis=2)
        coded = store(frame, codec, [frame, frame] if codec.name == "h264" else [])
        assert max(measured(coded[..., 0])) < 0.5


PATTERNS = {
    "blinds": np.where(Y % 9 < 4, 60, 170),
    "fence": 60 + 110 * ((X / 7.3) % 1 > 0.4),
    "leaning fence": 60 + 110 * (((X + 0.02 * Y) / 7.3) % 1 > 0.4),
    "bricks": np.where((Y % 12 < 2) | ((X + 12 * (Y // 12 % 2)) % 24 < 2), 200, 120),
    "corrugated": 120 + 60 * np.sin(2 * np.pi * X / 9),
    "flicker": 110 + 15 * np.sin(2 * np.pi * Y / 60),
    "fast flicker": 110 + 15 * np.sin(2 * np.pi * Y / 16),
    "interlaced": 100 + 6 * (Y % 2),
    "raw mosaic": 80 + 40 * ((Y % 2 == 0) & (X % 2 == 0)) - 20 * ((Y % 2 == 1) & (X % 2 == 1)),
    "mosaic of discs": np.where(np.hypot(Y % 64 - 32, X % 70 - 35) < 14, 12, 40 + 100 * (Y % 2) * (X % 2)),
    "clipped mosaic of discs": np.where(np.hypot(Y % 64 - 32, X % 70 - 35) < 14, 12, 60 + 400 * (Y % 2) * (X % 2)),
    "every fourth row dark": SCENE * np.where(Y % 4 == 0, 0.85, 1),
    "shading": 20 + 0.4 * Y,
    "horizon": np.where(Y > 240, 60, 190),
}  # fmt: skip


@pytest.mark.parametrize("name", PATTERNS)
@pytest.mark.parametrize("white_dn", [0.0, 2.0])
def test_regular_patterns_are_not_row_noise(name, white_dn):
    frame = levels(PATTERNS[name] + normal(white_dn, SCENE.shape, name, white_dn))
    assert np.nan_to_num(measured(frame)).max() < 0.5  # NaN: clipped


def test_lines_of_text_are_not_row_noise():
    page = np.full(SCENE.shape, 245, np.uint8)
    draws = stream(0, "row noise", "text")
    for line in range(20, HEIGHT, 13):
        words = "".join(chr(97 + int(letter)) for letter in draws.integers(0, 26, 110))
        cv2.putText(page, words, (3, line), cv2.FONT_HERSHEY_SIMPLEX, 0.35, 30, 1, cv2.LINE_AA)
    assert max(measured(page)) < 0.6
    assert max(measured(255 - page)) < 0.6


def test_offsets_of_half_the_frame_only_are_not_row_noise():
    half = SCENE.astype(float)
    half[:, : WIDTH // 2] += offsets(10.0)
    assert row_noise_dn(levels(half)) < 1


@pytest.mark.parametrize("shape", [(1, 1), (63, 400), (400, 53), (30, 30)])
def test_frames_too_small_or_clipped_cannot_be_measured(shape):
    assert np.isnan(row_noise_dn(np.full(shape, 90, np.uint8)))
    assert np.isnan(measured(np.zeros((200, 300), np.uint8))).all()
    assert np.isnan(measured(np.full((200, 300), 255, np.uint8))).all()
    assert measured(np.full((200, 300), 90, np.uint8)) == (0, 0)


def test_narrow_frames_are_measured():
    narrow = levels(120 + offsets(5.0) + normal(2.0, (HEIGHT, 60), "narrow"))
    assert row_noise_dn(narrow) == pytest.approx(5.0, rel=0.2)
