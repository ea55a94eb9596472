"""What is unusual about pictures and videos that can be read, each kind pointed out once on standard error."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from pipeline.errors import printable

if TYPE_CHECKING:
    from pipeline.cli.frames.picture_file import PictureFile

TURNED, TRANSPARENT, CURVED = 0, -1, -2
"""Keys of pictures and videos that their metadata turn, of pictures with transparent pixels and of those with another
transfer curve, among counts by a number of bits."""


def point_out(path: Path, file: PictureFile, hinted: Counter[int]) -> None:
    """Warn on standard error of what is unusual about a picture that can be read.

    Args:
        path: of the picture.
        file: it, decoded.
        hinted: see `pipeline.cli.frames.pictures.read`.
    """
    if bits := file.picture.fewer_bits():
        _hint_fewer_bits(path, bits, hinted)
    if file.turn:
        _hint_turned(str(path), file.turn, hinted)
    if file.transparent:
        _hint_transparent(path, hinted)
    if file.curve:
        _hint_curve(path, file.curve, hinted)


def video_remarks(name: str, hinted: Counter[int]) -> Callable[[str, str], None]:
    """A function that warns on standard error of what is unusual about a video that can be read.

    Args:
        name: of the video.
        hinted: see `pipeline.cli.frames.pictures.read`.

    Returns:
        takes a kind and words (`pipeline.datasets.decoding.video_decoder.remarks`).
    """
    from pipeline.datasets.decoding.video_decoder import CURVE, TURNED

    def remark(kind: str, words: str) -> None:
        if kind == TURNED:
            _hint_turned(name, words, hinted)
        if kind == CURVE:
            _warn_of_curve(name, words)

    return remark


def _hint_fewer_bits(path: Path, bits: int, hinted: Counter[int]) -> None:
    line = (
        f"hint: {printable(path)}: all values are below {1 << bits}, it looks like {bits}-bit values in a 16-bit file; "
        "read as 16 bit. This is a guess: unless the picture is that dark, multiply its values by "
        f"{1 << 16 - bits} and store it again"
    )
    _echo_once(line, bits, hinted)


def _hint_turned(name: str, turn: str, hinted: Counter[int]) -> None:
    line = (
        f"warning: {printable(name)}: stored turned or mirrored ({turn}); horizontal, vertical and positions are "
        "those of the stored pixels, in every such picture or video"
    )
    _echo_once(line, TURNED, hinted)


def _hint_transparent(path: Path, hinted: Counter[int]) -> None:
    line = (
        f"warning: {printable(path)}: has transparent pixels; the colours stored beneath them are measured, in "
        "every such picture"
    )
    _echo_once(line, TRANSPARENT, hinted)


def _warn_of_curve(name: str, curve: str) -> None:
    click.echo(_curve_warning(name, curve), err=True)


def _hint_curve(path: Path, curve: str, hinted: Counter[int]) -> None:
    _echo_once(f"{_curve_warning(str(path), curve)}, as every such picture", CURVED, hinted)


def _curve_warning(name: str, curve: str) -> str:
    return (
        f"warning: {printable(name)}: its transfer curve is {curve}, not that of sRGB or BT.709; brightness and noise "
        "are in its code values and not comparable with those of other files: convert it to BT.709 first"
    )


def _echo_once(line: str, key: int, hinted: Counter[int]) -> None:
    """Count under a key; a line on standard error for the first."""
    hinted[key] += 1
    if hinted[key] == 1:
        click.echo(line, err=True)
