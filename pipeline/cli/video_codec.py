"""The codec of pictures: of AVIF and HEIF files by their headers, of those taken out of a video by ``--codec``."""

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
    """How a picture was stored: an AVIF file by AV1, a HEIF file mostly by HEVC, others as their pixels show."""
    from pipeline.datasets.heif import is_heif
    from pipeline.datasets.video_coding import UNKNOWN, coding_of_items

    if is_heif(path):
        return coding_of_items(path).or_by("hevc")
    try:
        with path.open("rb") as file:
            avif = file.read(12)[4:] in AVIF
    except OSError:
        return UNKNOWN
    return coding_of_items(path).or_by("av1") if avif else UNKNOWN
