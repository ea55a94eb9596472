"""``--codec``: of the video that pictures were taken out of."""

from __future__ import annotations

import click

NAMED = ("av1", "hevc", "vp8", "vp9")
"""Those of `pipeline.condition.video_codecs.HIDDEN` that do not show; it is not imported: every command reads this."""

codec_option = click.option(
    "--codec", type=click.Choice(NAMED), default=None,
    help="of the video that pictures were taken out of: these codecs hide weak noise; known of videos and streams",
)  # fmt: skip
