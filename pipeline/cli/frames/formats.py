"""Formats of pictures and videos by the suffixes of files: those that are taken of a folder, and those not read."""

from __future__ import annotations

from pathlib import Path

from pipeline.datasets.decoding import video
from pipeline.datasets.decoding.heif import SUFFIXES as HEIF
from pipeline.datasets.decoding.pictures import SUFFIXES

PICTURES = SUFFIXES | HEIF | {".avif", ".gif", ".jp2", ".j2k", ".jpe", ".jfif", ".pbm", ".pnm", ".tga"}
"""Formats of datasets, and others that are read as well."""

VIDEOS = video.SUFFIXES
"""What is read frame by frame."""

UNREAD = frozenset({".jxl", ".dng", ".cr2", ".cr3", ".nef", ".arw", ".raf", ".orf", ".rw2", ".pef", ".srw"})
"""JPEG XL and raw files of cameras, which are not read: they are pointed out, not passed over."""

RENAMED = (b"\xff\xd8\xff", b"\x89PNG\r\n\x1a\n")
"""First bytes of JPEG and PNG files, which some programs give the suffix of the picture they were made of."""


def is_unread(path: Path) -> bool:
    """Whether a file's format is known and not read (`UNREAD`); a JPEG or PNG file of such a name is read.

    What cannot be opened is judged by its name; a folder or pipe is no file.
    """
    if path.suffix.lower() not in UNREAD or not path.is_file():
        return False
    try:
        with path.open("rb") as file:
            return not file.read(8).startswith(RENAMED)
    except OSError:
        return True
