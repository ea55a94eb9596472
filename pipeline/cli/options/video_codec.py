"""The codec of pictures: of AVIF and HEIF files by their headers, of those taken out of a video by ``--codec``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from pipeline.datasets.video_coding import Coding

NAMED = ("av1", "hevc", "vp8", "vp9")
"""Those of `pipeline.condition.video_codecs.HIDDEN` that do not show; it is not imported: every command reads this."""

codec_option = click.option(
    "--codec", type=click.Choice(NAMED), default=None,
    help="of the video that pictures were taken out of: these codecs hide weak noise; known of videos and streams",
)  # fmt: skip


def coding_of_picture(path: Path) -> Coding:
    """How a picture was stored: an AVIF file by AV1, a HEIF file mostly by HEVC, others as their pixels show."""
    from pipeline.datasets.heif import container
    from pipeline.datasets.video_coding import UNKNOWN, coding_of_items

    codec = {"heif": "hevc", "avif": "av1"}.get(container(path))
    return coding_of_items(path).or_by(codec) if codec else UNKNOWN
