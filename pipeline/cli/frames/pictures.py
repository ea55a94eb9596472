"""Reading the files that a command is given, pictures and videos, frame by frame."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.cli.frames.formats import VIDEOS, is_unread
from pipeline.cli.frames.remarks import point_out, video_remarks
from pipeline.datasets.decoding.pictures import SMALLEST_PX
from pipeline.errors import InputError, printable

if TYPE_CHECKING:
    import numpy as np

    from pipeline.datasets.decoding.video_coding import Coding


def readable(
    paths: Sequence[Path], every: int = 1, hinted: Counter[int] | None = None, least_px: int = SMALLEST_PX
) -> Iterator[tuple[str, np.ndarray | None, str, Coding]]:
    """Every frame of every file: its name with its picture and coding, or with what is wrong with the file.

    Args:
        paths: pictures and videos.
        every: of a video take each n-th frame.
        hinted: see `read`; None for a count of its own.
        least_px: see `read`.

    Returns:
        name, (H, W) float32 in [0, 1] or None, the reason where it is None, and how the frame was stored.
    """
    from pipeline.datasets.decoding.video_coding import UNKNOWN

    hinted = Counter() if hinted is None else hinted
    for path in paths:
        try:
            for name, image, coding in read(path, every, hinted, least_px):
                yield name, image, "", coding
        except InputError as error:
            yield str(path), None, str(error), UNKNOWN


def read(
    path: Path, every: int = 1, hinted: Counter[int] | None = None, least_px: int = SMALLEST_PX
) -> Iterator[tuple[str, np.ndarray, Coding]]:
    """Name, grey picture (H, W) float32 in [0, 1] and coding of each frame of a file.

    Args:
        path: a picture, or a video.
        every: of a video take each n-th frame.
        hinted: counts pictures that seem to hold values of fewer bits in 16, by that number of bits; for the first
            of each there is a line on standard error. None for such a line for every one. Likewise, under
            `pipeline.cli.frames.remarks.TURNED`, pictures and videos whose metadata turn or mirror them, under
            ``TRANSPARENT``, pictures with transparent pixels, and under ``CURVED``, those whose transfer curve is far
            from that of sRGB.
        least_px: both sides must be at least this long (`least_side_px`).

    Raises:
        InputError: the file cannot be read, its pictures are smaller, or its name is not valid UTF-8; for a video,
            after its last good frame, frames are missing or damaged.
    """
    from pipeline.cli.frames.picture_file import coding_of_picture, read_file
    from pipeline.datasets.decoding.video import read_video

    refuse(path)
    hinted = Counter() if hinted is None else hinted
    if path.suffix.lower() not in VIDEOS:
        file = read_file(path, least_px)
        point_out(path, file, hinted)
        yield str(path), file.picture.grey(), coding_of_picture(path)
        return
    for number, image, coding in read_video(path, every, remark=video_remarks(str(path), hinted)):
        if small := too_small(image.shape, least_px):
            raise InputError(f"{path}: {small}")
        yield f"{path}#{number}", image, coding


def refuse(path: Path) -> None:
    """Refuse a file whose name no table, page or JSON file can hold, or whose format is not read.

    Raises:
        InputError: its path is not valid UTF-8, or this locale cannot tell, or see `is_unread`.
    """
    try:
        str(path).encode("utf-8")
    except UnicodeEncodeError:
        raise InputError(f"{printable(path)}: {_why_unnamed(path)}") from None
    if is_unread(path):
        raise InputError(f"{path}: {path.suffix} files are not read; convert it, for example to PNG")


def _why_unnamed(path: Path) -> str:
    """Why a path has bytes that are no text here."""
    try:
        os.fsencode(path).decode("utf-8")
    except UnicodeDecodeError:
        return "its name is not valid UTF-8; rename it"
    return "its name is UTF-8, which this locale does not read; set PYTHONUTF8=1"


def least_side_px(estimator: object) -> int:
    """Side, pixels, that pictures have at least for a noise estimator; a plug-in may not state one."""
    from pipeline.noise.base import smallest_patch_px

    return max(SMALLEST_PX, smallest_patch_px(estimator))


def too_small(shape: Sequence[int], least_px: int) -> str:
    """That a picture (H, W) has a side of fewer pixels, in words; empty where it has not."""
    height, width = shape
    small = min(height, width) < least_px
    return f"too small: {width}x{height} px, expected at least {least_px} px on either side" if small else ""
