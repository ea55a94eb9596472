"""The codec that frames were stored with: that of their video, or, of pictures taken out of one, by ``--codec``."""

from __future__ import annotations

import contextlib
from functools import lru_cache
from pathlib import Path

import click

NAMED = ("av1", "hevc", "vp9")  # those of `pipeline.condition.video_codecs.HIDING`; every command reads this module

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
        that of the video that it is a frame of (`pipeline.cli.pictures.stream_of`); for a picture what was given, or
        empty.
    """
    from pipeline.cli.pictures import stream_of

    file = stream_of(name)
    return _codec_of_video(Path(file)) if file else given or ""


@lru_cache(maxsize=16)
def _codec_of_video(path: Path) -> str:
    from pipeline.datasets.video_decoder import Decoder

    with contextlib.closing(Decoder(path)) as decoder:
        return decoder.codec
