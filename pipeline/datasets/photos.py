"""Photographs that every installation has: those inside the scikit-image wheel.

They need no download and are never used in training, so they are the real pictures of a default run. The list is
fixed, and each file is checked against its SHA-256, so that results do not change with the installed version.

Taken: real photographs that are sharp over most of the frame. Left out, and why: ``brick`` (warped and resampled, as
its notes say), ``moon`` (soft, and noisy), ``chelsea`` (a cat at shallow depth of field: half of it is out of
focus), ``clock_motion`` (motion blur), ``hubble_deep_field`` (point sources smeared by the telescope),
``page``, ``text``, ``horse``, ``logo``, ``color``, ``chessboard_*``, ``phantom``, ``multipage*`` (print, line art,
synthetic), ``cell``, ``ihc``, ``retina``, ``microaneurysms`` (microscopy, medical), ``lfw_subset`` (25 px faces).

They carry no boxes: patches are taken from the whole frame. Licences, as stated by scikit-image (van der Walt et al.,
PeerJ 2014), are named for each file in `PHOTOGRAPHS`: public domain or CC0, but for the stereo pair, for which the
package names the benchmark only. Nothing of these files is stored in this project.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from pipeline.datasets.dataset import DataAbsent, Dataset
from pipeline.datasets.frame import Frame
from pipeline.errors import InputError
from pipeline.store import file_sha256


@dataclass(frozen=True)
class Photograph:
    """One file of the list: its name, SHA-256 and licence."""

    file: str
    sha256: str
    licence: str


PHOTOGRAPHS: tuple[Photograph, ...] = (
    Photograph(
        "astronaut.png", "88431cd9653ccd539741b555fb0a46b61558b301d4110412b5bc28b5e3ea6cb5", "public domain (NASA)"
    ),
    Photograph("camera.png", "b0793d2adda0fa6ae899c03989482bff9a42d3d5690fc7e3648f2795d730c23a", "CC0 (Lav Varshney)"),
    Photograph(
        "coffee.png", "cc02f8ca188b167c775a7101b5d767d1e71792cf762c33d6fa15a4599b5a8de7", "CC0 (Rachel Michetti)"
    ),
    Photograph(
        "coins.png",
        "f8d773fc9cfa6f4d8e5942dc34d0a0788fcaed2a4fefbbed0aef5398d7ef4cba",
        "no known copyright restrictions (Brooklyn Museum)",
    ),
    Photograph("grass.png", "b6b6022426b38936c43a4ac09635cd78af074e90f42ffa8227ac8b7452d39f89", "CC0 (linolafett)"),
    Photograph("gravel.png", "c48615b451bf1e606fbd72c0aa9f8cc0f068ab7111ef7d93bb9b0f2586440c12", "CC0 (CC0Textures)"),
    Photograph(
        "motorcycle_left.png",
        "db18e9c4157617403c3537a6ba355dfeafe9a7eabb6b9b94cb33f6525dd49179",
        "not stated by the package (Middlebury 2014 stereo)",
    ),
    Photograph(
        "motorcycle_right.png",
        "5fc913ae870e42a4b662314bc904d1786bcad8e2f0b9b67dba5a229406357797",
        "not stated by the package (Middlebury 2014 stereo)",
    ),
    Photograph(
        "rocket.jpg", "c2dd0de7c538df8d111e479619b129464d0269d0ae5fd18ca91d33a7fdfea95c", "public domain (SpaceX)"
    ),
)


class Photos(Dataset):
    """Sharp photographs of scikit-image; see the module for the list and its reasons.

    Args:
        name: name of the dataset.
        root: folder with the files; None is the installed package's own.
        whitelist: see `Dataset`.
        limit: see `Dataset`.
    """

    kind: ClassVar[str] = "photos"
    source: ClassVar[str] = "The photographs come with the package scikit-image: pip install scikit-image."

    def __init__(
        self,
        name: str = "photos",
        root: str | Path | None = None,
        *,
        whitelist: str | Path | None = None,
        limit: int | None = None,
    ) -> None:
        super().__init__(name, _installed(name) if root is None else root, whitelist=whitelist, limit=limit)
        self.labelled = False

    def _read(self) -> Iterable[Frame]:
        for photograph in PHOTOGRAPHS:
            path = self.root / photograph.file
            if not path.is_file():
                raise DataAbsent(f"dataset '{self.name}': no file {path}. {self.source}")
            if file_sha256(path) != photograph.sha256:
                raise InputError(f"{path}: not the photograph expected (SHA-256 differs); reinstall scikit-image")
            yield self._frame(path)

    def scene_of(self, frame: str) -> str:
        """Its name without the side of a stereo pair."""
        return frame.removesuffix("_left").removesuffix("_right")


def _installed(name: str) -> Path:
    result = importlib.util.find_spec("skimage")
    if result is None or not result.submodule_search_locations:
        raise DataAbsent(f"dataset '{name}': scikit-image is not installed. {Photos.source}")
    return Path(result.submodule_search_locations[0]) / "data"
