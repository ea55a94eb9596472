"""Whitelists: text files that name the frames of an experiment, one file stem a line.

The paper's blur experiments use such lists (150 frames of KITTI and of Udacity). Empty lines and lines that
begin with ``#`` are skipped.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from pipeline.datasets.frame import Frame
from pipeline.errors import InputError, did_you_mean


def read_whitelist(path: str | Path) -> list[str]:
    """The stems a whitelist names, in its order.

    Raises:
        InputError: the file is missing, not text, empty, or names a stem twice.
    """
    try:
        lines = Path(path).read_text(encoding="utf-8-sig").splitlines()
    except FileNotFoundError:
        raise InputError(f"{path}: no such whitelist; expected a text file with one frame name a line") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: not a text file; expected one frame name a line") from None
    stems = [line.strip() for line in lines if line.strip() and not line.lstrip().startswith("#")]
    twice = sorted({stem for stem in stems if stems.count(stem) > 1}) if len(set(stems)) < len(stems) else []
    if twice:
        raise InputError(f"{path}: named more than once: {_some(twice)}; remove the repetitions")
    if not stems:
        raise InputError(f"{path}: the whitelist names no frame")
    return stems


def select(frames: Sequence[Frame], stems: Sequence[str], where: str = "whitelist") -> list[Frame]:
    """The frames a whitelist names, in the frames' own order.

    Args:
        frames: of one dataset.
        stems: names, without folder and suffix.
        where: the whitelist, for the message.

    Raises:
        InputError: a stem that is no frame of the dataset.
    """
    wanted = set(stems)
    known = {frame.name for frame in frames}
    unknown = sorted(wanted - known)
    if unknown:
        hint = f"; {did_you_mean(unknown[0], known)}" if 0 < len(known) <= 50 else ""
        raise InputError(f"{where}: {len(unknown)} of {len(wanted)} names are no frames here: {_some(unknown)}{hint}")
    return [frame for frame in frames if frame.name in wanted]


def _some(words: Sequence[str], most: int = 5) -> str:
    rest = len(words) - most
    return ", ".join(words[:most]) + (f" and {rest} more" if rest > 0 else "")
