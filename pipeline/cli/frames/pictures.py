"""The pictures a command is given: files, folders of them, or videos, frame by frame."""

from __future__ import annotations

import os
import re
import stat
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.datasets.heif import SUFFIXES as HEIF
from pipeline.datasets.pictures import SMALLEST_PX, SUFFIXES
from pipeline.datasets.video import SUFFIXES as VIDEOS
from pipeline.errors import InputError, printable

if TYPE_CHECKING:
    import numpy as np

    from pipeline.cli.frames.picture_file import PictureFile
    from pipeline.datasets.video_coding import Coding


PICTURES = SUFFIXES | HEIF | {".avif", ".gif", ".jp2", ".j2k", ".jpe", ".jfif", ".pbm", ".pnm", ".tga"}
"""What is taken of a folder: formats of datasets, and others that are read as well."""

UNREAD = frozenset({".jxl", ".dng", ".cr2", ".cr3", ".nef", ".arw", ".raf", ".orf", ".rw2", ".pef", ".srw"})
"""JPEG XL and raw files of cameras, which are not read: they are pointed out, not passed over."""

RENAMED = (b"\xff\xd8\xff", b"\x89PNG\r\n\x1a\n")
"""First bytes of JPEG and PNG files, which some programs give the suffix of the picture they were made of."""

TURNED, TRANSPARENT, CURVED = 0, -1, -2
"""Keys of pictures and videos that their metadata turn, of pictures with transparent pixels and of those with another
transfer curve, among counts by a number of bits."""

_DIGITS = re.compile("([0-9]+)")


def natural_order(name: str) -> tuple[list[str | int], str]:
    """Sorting key of names: numbers in them by value, so that ``9.png`` comes before ``10.png``.

    Args:
        name: of a file; of those that differ in leading zeros only, the more zeros come first.
    """
    parts = _DIGITS.split(name)  # text and digits in turn
    return [int(part) if index % 2 else part for index, part in enumerate(parts)], name


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


def expand(paths: Sequence[Path]) -> list[Path]:
    """Files named, and the pictures and videos directly inside folders named, each folder's in `natural_order`.

    A line on standard error counts what a folder has of formats that are not read (`UNREAD`); others name what has the
    name of a picture or video and is a folder, pipe or device, of which a pipe would be waited for without end.

    Raises:
        InputError: a path does not exist, or nothing is left.
    """
    results: list[Path] = []
    for path in paths:
        if path.is_dir():
            formats = PICTURES | VIDEOS | UNREAD
            inside = [file for file in path.iterdir() if file.name[0] != "." and file.suffix.lower() in formats]
            irregular = {file for file in inside if _is_irregular(file)}
            inside = [file for file in inside if file not in irregular]
            unread = {file for file in inside if is_unread(file)}
            results += sorted(set(inside) - unread, key=lambda file: natural_order(file.name))
            _warn_of_unread(path, Counter(file.suffix.lower() for file in unread))
            _warn_of_irregular(sorted(file for file in irregular if file.suffix.lower() not in UNREAD))
        elif path.is_file():
            results.append(path)
        elif path.exists():
            raise InputError(f"{path}: a pipe or device; expected a file or folder, camera-monitor watch reads cameras")
        else:
            raise InputError(f"{path}: no such file or folder")
    if not results:
        where = f"{', '.join(map(str, paths))}{_not_searched(paths)}"
        raise InputError(f"no pictures in {where}; expected {' '.join(sorted(PICTURES | VIDEOS))}")
    return results


def _not_searched(folders: Sequence[Path]) -> str:
    """That folders inside of folders are not searched, with the first of them; empty where there is none."""
    inside = sorted(str(folder / name) for folder in folders for name in shown_folders(folder.iterdir()))
    return f", whose sub-folders are not searched: name them, as {inside[0]}" if inside else ""


def shown_folders(entries: Iterable[Path | os.DirEntry[str]]) -> list[str]:
    """Names of the folders among the entries of a folder, sorted, without hidden ones."""
    return sorted(entry.name for entry in entries if entry.name[0] != "." and entry.is_dir())


def _warn_of_unread(folder: Path, unread: Counter[str]) -> None:
    import click

    if unread:
        counts = ", ".join(f"{count} {suffix}" for suffix, count in sorted(unread.items()))
        click.echo(
            f"warning: {printable(folder)}: left out {counts}; these formats are not read, convert them, for example "
            "to PNG",
            err=True,
        )


def _is_irregular(file: Path) -> bool:
    """Whether a path leads to a folder, pipe or device; not where it leads nowhere, whose reason its reader states."""
    try:
        return not stat.S_ISREG(file.stat().st_mode)
    except OSError:
        return False


def _warn_of_irregular(files: Sequence[Path]) -> None:
    import click

    for file in files:
        click.echo(f"warning: {printable(file)}: left out, it is a folder, pipe or device and no file", err=True)


def read(
    path: Path, every: int = 1, hinted: Counter[int] | None = None, least_px: int = SMALLEST_PX
) -> Iterator[tuple[str, np.ndarray, Coding]]:
    """Name, grey picture (H, W) float32 in [0, 1] and coding of each frame of a file.

    Args:
        path: a picture, or a video.
        every: of a video take each n-th frame.
        hinted: counts pictures that seem to hold values of fewer bits in 16, by that number of bits; for the first
            of each there is a line on standard error. None for such a line for every one. Likewise, under `TURNED`,
            pictures and videos whose metadata turn or mirror them, under `TRANSPARENT`, pictures with transparent
            pixels, and under `CURVED`, those whose transfer curve is far from that of sRGB.
        least_px: both sides must be at least this long (`least_side_px`).

    Raises:
        InputError: the file cannot be read, its pictures are smaller, or its name is not valid UTF-8; for a video,
            after its last good frame, frames are missing or damaged.
    """
    from pipeline.cli.frames.picture_file import coding_of_picture, read_file
    from pipeline.datasets.video import read_video

    refuse(path)
    hinted = Counter() if hinted is None else hinted
    if path.suffix.lower() not in VIDEOS:
        file = read_file(path, least_px)
        point_out(path, file, hinted)
        yield str(path), file.picture.grey(), coding_of_picture(path)
        return
    for number, image, coding in read_video(path, every, remark=video_remarks(str(path), hinted)):
        if small := too_small(image.shape, least_px):
            raise InputError(f"{path}: {small}")
        yield f"{path}#{number}", image, coding


def least_side_px(estimator: object) -> int:
    """Side, pixels, that pictures have at least for a noise estimator; a plug-in may not state one."""
    from pipeline.noise.base import smallest_patch_px

    return max(SMALLEST_PX, smallest_patch_px(estimator))


def too_small(shape: Sequence[int], least_px: int) -> str:
    """That a picture (H, W) has a side of fewer pixels, in words; empty where it has not."""
    height, width = shape
    small = min(height, width) < least_px
    return f"too small: {width}x{height} px, expected at least {least_px} px on either side" if small else ""


def refuse(path: Path) -> None:
    """Refuse a file whose name no table, page or JSON file can hold, or whose format is not read.

    Raises:
        InputError: its path is not valid UTF-8, or this locale cannot tell, or see `is_unread`.
    """
    try:
        str(path).encode("utf-8")
    except UnicodeEncodeError:
        raise InputError(f"{printable(path)}: {_why_unnamed(path)}") from None
    if is_unread(path):
        raise InputError(f"{path}: {path.suffix} files are not read; convert it, for example to PNG")


def _why_unnamed(path: Path) -> str:
    """Why a path has bytes that are no text here."""
    try:
        os.fsencode(path).decode("utf-8")
    except UnicodeDecodeError:
        return "its name is not valid UTF-8; rename it"
    return "its name is UTF-8, which this locale does not read; set PYTHONUTF8=1"


def point_out(path: Path, file: PictureFile, hinted: Counter[int]) -> None:
    """Warn on standard error of what is unusual about a picture that can be read.

    Args:
        path: of the picture.
        file: it, decoded.
        hinted: see `read`.
    """
    if bits := file.picture.fewer_bits():
        _hint(path, bits, hinted)
    if file.turn:
        _hint_turned(str(path), file.turn, hinted)
    if file.transparent:
        _hint_transparent(path, hinted)
    if file.curve:
        _hint_curve(path, file.curve, hinted)


def _echo_once(line: str, key: int, hinted: Counter[int]) -> None:
    """Count under a key; a line on standard error for the first."""
    import click

    hinted[key] += 1
    if hinted[key] == 1:
        click.echo(line, err=True)


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


def video_remarks(name: str, hinted: Counter[int]) -> Callable[[str, str], None]:
    """A function that warns on standard error of what is unusual about a video that can be read.

    Args:
        name: of the video.
        hinted: see `read`.

    Returns:
        takes a kind and words (`pipeline.datasets.video_decoder.remarks`).
    """
    from pipeline.datasets.video_decoder import CURVE, TURNED

    def remark(kind: str, words: str) -> None:
        if kind == TURNED:
            _hint_turned(name, words, hinted)
        if kind == CURVE:
            _warn_of_curve(name, words)

    return remark


def _warn_of_curve(name: str, curve: str) -> None:
    import click

    click.echo(_curve_warning(name, curve), err=True)


def _hint_curve(path: Path, curve: str, hinted: Counter[int]) -> None:
    _echo_once(f"{_curve_warning(str(path), curve)}, as every such picture", CURVED, hinted)


def _curve_warning(name: str, curve: str) -> str:
    return (
        f"warning: {printable(name)}: its transfer curve is {curve}, not that of sRGB or BT.709; brightness and noise "
        "are in its code values and not comparable with those of other files: convert it to BT.709 first"
    )


def _hint(path: Path, bits: int, hinted: Counter[int]) -> None:
    line = (
        f"hint: {printable(path)}: all values are below {1 << bits}, it looks like {bits}-bit values in a 16-bit file; "
        "read as 16 bit. This is a guess: unless the picture is that dark, multiply its values by "
        f"{1 << 16 - bits} and store it again"
    )
    _echo_once(line, bits, hinted)


def readable(
    paths: Sequence[Path], every: int = 1, hinted: Counter[int] | None = None, least_px: int = SMALLEST_PX
) -> Iterator[tuple[str, np.ndarray | None, str, Coding]]:
    """Every frame of every file: its name with its picture and coding, or with what is wrong with the file.

    Args:
        paths: pictures and videos.
        every: of a video take each n-th frame.
        hinted: see `read`; None for a count of its own.
        least_px: see `read`.

    Returns:
        name, (H, W) float32 in [0, 1] or None, the reason where it is None, and how the frame was stored.
    """
    from pipeline.datasets.video_coding import UNKNOWN

    hinted = Counter() if hinted is None else hinted
    for path in paths:
        try:
            for name, image, coding in read(path, every, hinted, least_px):
                yield name, image, "", coding
        except InputError as error:
            yield str(path), None, str(error), UNKNOWN


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
