"""The codec of pictures: of an AVIF file AV1, of those that were taken out of a video what ``--codec`` states."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from pipeline.datasets.video_coding import Coding

NAMED = ("av1", "hevc", "vp8", "vp9")
"""Those of `pipeline.condition.video_codecs.HIDDEN` that do not show; it is not imported: every command reads this."""

AVIF = (b"ftypavif", b"ftypavis")
"""What files of pictures by AV1 have from their fifth byte on."""

codec_option = click.option(
    "--codec", type=click.Choice(NAMED), default=None,
    help="of the video that pictures were taken out of: these codecs hide weak noise; known of videos and streams",
)  # fmt: skip


def coding_of_picture(path: Path) -> Coding:
    """How a picture was stored, by its first bytes: an AVIF file by AV1, others as their pixels show."""
    from pipeline.datasets.video_coding import UNKNOWN, Coding

    try:
        with path.open("rb") as file:
            return Coding("av1") if file.read(12)[4:] in AVIF else UNKNOWN
    except OSError:
        return UNKNOWN
