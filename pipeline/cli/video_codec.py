"""The codec that frames were stored with: that of their file, or, of pictures taken out of a video, by ``--codec``."""

from __future__ import annotations

import contextlib
from functools import lru_cache
from pathlib import Path

import click

NAMED = ("av1", "hevc", "vp8", "vp9")
"""Those of `pipeline.condition.video_codecs.HIDDEN_DN`, which is not imported: every command reads this module."""

AVIF = (b"ftypavif", b"ftypavis")
"""What files of pictures by AV1 have from their fifth byte on."""

codec_option = click.option(
    "--codec", type=click.Choice(NAMED), default=None,
    help="of the video that pictures were taken out of: these codecs hide weak noise; known of videos and streams",
)  # fmt: skip


def codec_of(name: str, given: str | None = None) -> str:
    """The codec of a frame, by FFmpeg's name.

    Args:
        name: of the frame.
        given: by the user, for pictures.

    Returns:
        that of the video that it is a frame of (`pipeline.cli.pictures.stream_of`); of an AVIF file AV1; of other
        pictures what was given, or empty.
    """
    from pipeline.cli.pictures import stream_of

    file = stream_of(name)
    if file:
        return _codec_of_video(Path(file))
    return "av1" if _is_avif(Path(name)) else given or ""


def _is_avif(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            return file.read(12)[4:] in AVIF
    except OSError:
        return False


@lru_cache(maxsize=16)
def _codec_of_video(path: Path) -> str:
    from pipeline.datasets.video_decoder import Decoder

    with contextlib.closing(Decoder(path)) as decoder:
        return decoder.codec
