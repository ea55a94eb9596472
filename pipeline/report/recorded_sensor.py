"""Constants of a real sensor, measured from raw frames that the project may not keep.

Measured by hand, with ``camera-monitor record sensor``. Frames are named by their SHA-256; none is kept.

    sensor_transfer.csv     photon transfer of each colour plane (`pipeline.camera.emva1288.PhotonTransfer`)
    sensor_dark.csv         dark current of each colour plane (`pipeline.camera.emva1288.DarkCurrent`)
    sensor_provenance.json  source, frames, white

File names hold the exposure, as in ``SCENE_250ms_*.tif``; frames of equal SCENE show the same.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import groupby, pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from pipeline import store
from pipeline.camera import emva1288
from pipeline.datasets.pictures import SUFFIXES, read_picture
from pipeline.detection.weights import file_sha256
from pipeline.errors import InputError
from pipeline.report.record_files import write_csv

if TYPE_CHECKING:
    import pandas as pd

TRANSFER_FILE, DARK_FILE, PROVENANCE_FILE = "sensor_transfer.csv", "sensor_dark.csv", "sensor_provenance.json"
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
        """(H, W) grey values, DN.

        Raises:
            InputError: not a picture, or one with colours.
        """
        picture = read_picture(self.path)
        if picture.colour:
            raise InputError(f"{self.path}: has colours, expected a raw mosaic with one value per pixel")
        return picture.pixels


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


def record(light: Path, dark: Path, white_dn: float, out: Path, source: str) -> pd.DataFrame:
    """Measure a sensor and write everything into a folder.

    Args:
        light: folder of frames of lit scenes, each scene at two exposures or more, or twice at one.
        dark: folder of dark frames of three exposures or more.
        white_dn: grey value of saturation, DN.
        out: folder; replaced.
        source: where the frames come from, their revision and licence, in words.

    Returns:
        a row per colour plane: ``plane``, ``gain_dn_per_e``, ``gain_error``, ``dark_variance_dn2``, ``dark_sigma_e``,
        ``saturation_e``, ``snr_at_saturation``, ``blocks``.

    Raises:
        InputError: frames are absent, broken or too few.
    """
    import pandas as pd

    lit, unlit = raw_frames(light), raw_frames(dark)
    points: dict[str, list[emva1288.TransferPoints]] = {name: [] for name in emva1288.PLANES}
    for _, group in groupby(lit, key=lambda frame: frame.scene):
        pictures = [frame.pixels() for frame in group]
        for first, second in pairwise(pictures):
            for name, curve in points.items():
                a, b = emva1288.plane(first, name), emva1288.plane(second, name)
                curve.append(emva1288.points_of_pair(a, b, white_dn))
    transfers = {name: emva1288.photon_transfer(curve) for name, curve in points.items()}
    transfer = pd.DataFrame([_transfer_row(name, fitted, white_dn) for name, fitted in transfers.items()])
    dark_pictures = [frame.pixels() for frame in unlit]
    rows = []
    for name, fitted in transfers.items():
        planes = [emva1288.plane(picture, name) for picture in dark_pictures]
        current = emva1288.dark_current([frame.exposure_s for frame in unlit], planes)
        rows.append(
            {
                "plane": name,
                "slope_dn_per_s": current.slope_dn_per_s,
                "slope_error": current.slope_error,
                "dark_current_e_per_s": current.slope_dn_per_s / fitted.gain_dn_per_e,
                "offset_dn": current.offset_dn,
                "zero_fraction": current.zero_fraction,
            }
        )
    hashes: Mapping[str, Mapping[str, str]] = {
        name: {frame.path.name: file_sha256(frame.path) for frame in frames}
        for name, frames in (("light", lit), ("dark", unlit))
    }
    with store.replacing_folder(out) as folder:
        write_csv(folder / TRANSFER_FILE, transfer)
        write_csv(folder / DARK_FILE, pd.DataFrame(rows))
        store.write_json(folder / PROVENANCE_FILE, {"source": source, "frames": hashes, "white_dn": white_dn})
    return transfer


def _transfer_row(name: str, fitted: emva1288.PhotonTransfer, white_dn: float) -> dict[str, Any]:
    return {
        "plane": name,
        "gain_dn_per_e": fitted.gain_dn_per_e,
        "gain_error": fitted.gain_error,
        "dark_variance_dn2": fitted.dark_variance_dn2,
        "dark_sigma_e": fitted.dark_sigma_e,
        "saturation_e": fitted.electrons(white_dn),
        "snr_at_saturation": fitted.snr(white_dn),
        "blocks": fitted.points,
    }
