"""The pictures a command is given: files, folders of them, or videos, frame by frame."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.errors import InputError

if TYPE_CHECKING:
    import numpy as np

VIDEOS = frozenset({".mp4", ".avi", ".mov", ".mkv", ".webm", ".m4v", ".mjpg"})


def expand(paths: Sequence[Path]) -> list[Path]:
    """Files named, and the pictures and videos directly inside folders named, sorted within each folder.

    Raises:
        InputError: a path does not exist, or nothing is left.
    """
    from pipeline.datasets.pictures import SUFFIXES

    found: list[Path] = []
    for path in paths:
        if path.is_dir():
            known = SUFFIXES | VIDEOS
            found += sorted(file for file in path.iterdir() if file.suffix.lower() in known and file.name[0] != ".")
        elif path.is_file():
            found.append(path)
        else:
            raise InputError(f"{path}: no such file or folder")
    if not found:
        raise InputError(f"no pictures in {', '.join(map(str, paths))}; expected {' '.join(sorted(SUFFIXES | VIDEOS))}")
    return found


def read(path: Path, every: int = 1) -> Iterator[tuple[str, np.ndarray]]:
    """Name and grey picture (H, W) float32 in [0, 1] of each frame of a file.

    Args:
        path: a picture, or a video.
        every: of a video take each n-th frame.

    Raises:
        InputError: the file cannot be read; for a video, not one frame of it.
    """
    from pipeline.datasets.pictures import read_grey

    if path.suffix.lower() not in VIDEOS:
        yield str(path), read_grey(path)
        return
    import cv2
    import numpy as np

    video = cv2.VideoCapture(str(path))
    number = 0
    try:
        while video.grab():
            if number % every == 0:
                good, frame = video.retrieve()
                if good:
                    grey = cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY) if frame.ndim == 3 else frame
                    yield f"{path}#{number}", grey.astype(np.float32) / np.float32(255)
            number += 1
    finally:
        video.release()
    if number == 0:
        raise InputError(f"{path}: not a video that OpenCV can read, or it holds no frame")
