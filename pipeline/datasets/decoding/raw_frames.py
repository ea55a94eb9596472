"""Raw sensor frames whose file names hold their exposure time, as in ``SCENE_250ms_*.tif``.

Frames of equal SCENE show the same. A frame is a mosaic with one grey value per pixel.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from pipeline.datasets.decoding.pictures import SUFFIXES, read_picture
from pipeline.errors import InputError

_NAME = re.compile(r"(?P<scene>.+)_(?P<ms>\d+(?:\.\d+)?)ms(?![a-z])")


@dataclass(frozen=True)
class RawFrame:
    """A raw frame file.

    Attributes:
        path: the file.
        scene: start of its name.
        exposure_s: exposure time in its name, seconds.
    """

    path: Path
    scene: str
    exposure_s: float

    def pixels(self) -> NDArray[Any]:
        """(H, W) grey values, DN, in the depth that the file's header states.

        Raises:
            InputError: not a picture, or one with colours.
        """
        picture = read_picture(self.path)
        if picture.colour:
            raise InputError(f"{self.path}: has colours, expected a raw mosaic with one value per pixel")
        return picture.file_values()


def raw_frames(folder: Path) -> list[RawFrame]:
    """Raw frames of a folder, by scene and exposure.

    Raises:
        InputError: no such folder, no frame in it, or a name without an exposure.
    """
    if not folder.is_dir():
        raise InputError(f"raw frames: no folder {folder}")
    frames = []
    for path in sorted(folder.iterdir()):
        if path.suffix.lower() not in SUFFIXES:
            continue
        match = _NAME.match(path.name)
        if match is None:
            raise InputError(f"{path}: no exposure in its name, expected SCENE_250ms_*.tif")
        frames.append(RawFrame(path, match["scene"], float(match["ms"]) / 1000))
    if not frames:
        raise InputError(f"raw frames: no pictures in {folder}")
    return sorted(frames, key=lambda frame: (frame.scene, frame.exposure_s))
