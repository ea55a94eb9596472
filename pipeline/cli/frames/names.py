"""Names of frames, ``dir/drive.mp4#12`` of a video and the file's of a picture, and what is made of them."""

from __future__ import annotations

from pathlib import Path

from pipeline.cli.frames.formats import VIDEOS
from pipeline.errors import printable


def result_stem(name: str) -> str:
    """Start of a result's file name: ``drive.mp4-000012`` for the frame ``dir/drive.mp4#12``, else the file's name."""
    file, _, number = Path(name).name.rpartition("#")
    of_video = Path(file).suffix.lower() in VIDEOS and number.isdigit()
    return f"{file}-{int(number):06d}" if of_video else Path(name).name


def stream_of(name: str) -> str:
    """The video that a frame is of: ``dir/drive.mp4`` for ``dir/drive.mp4#12``; empty for a picture."""
    return "" if result_stem(name) == Path(name).name else name.rpartition("#")[0]


def named(name: str, error: Exception) -> str:
    """An error's message, with the name of the picture before it unless it names it itself."""
    return str(error) if printable(name) in printable(error) else f"{printable(name)}: {error}"
