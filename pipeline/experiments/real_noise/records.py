"""Noise of real cameras: from the stage `real_noise` where it has run, else as it was recorded earlier."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.datasets.decoding.pictures import read_grey8
from pipeline.experiments.real_noise.tables import (
    DARK,
    DARK_MEANS,
    REAL_NOISE_PATCHES,
    REAL_NOISE_SUMMARY,
    TRANSFER,
    TRANSFER_POINTS,
)
from pipeline.stage_files import existing, optional
from pipeline.store import Schema, read_csv

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd
    from numpy.typing import NDArray

PATCHES_FILE, SUMMARY_FILE, PROVENANCE_FILE = "noise_patches.csv", "noise_summary.csv", "noise_provenance.json"
TRANSFER_FILE, POINTS_FILE = "sensor_transfer.csv", "sensor_points.csv"
DARK_FILE, DARK_MEANS_FILE = "sensor_dark.csv", "sensor_dark_means.csv"
RAW_PATCHES_FILE, RAW_SUMMARY_FILE = "sensor_patches.csv", "sensor_summary.csv"
RAW_PROVENANCE_FILE = "sensor_provenance.json"
EXAMPLES_FILE, EXAMPLES_PROVENANCE_FILE = "examples.csv", "examples_provenance.json"

NOISE_FOLDER, SENSOR_FOLDER, EXAMPLES_FOLDER = "real-noise", "real-sensor", "real-noise-examples"
SENSOR = "flea3"
"""Name of the recording that the second folder holds."""


Stages = Mapping[str, Path]
"""Recording of a real camera -> folder of its stage `real_noise`."""


@dataclass(frozen=True)
class Recording:
    """Noise estimators on one recording of real cameras.

    Attributes:
        name: of the recording.
        source: of its pictures.
        stage: that measured it; "" where it was recorded earlier.
        patches, summary: `pipeline.experiments.real_noise.tables`.
    """

    name: str
    source: str
    stage: str
    patches: pd.DataFrame
    summary: pd.DataFrame


@dataclass(frozen=True)
class Sensor:
    """Constants of a sensor from its raw frames: `pipeline.experiments.real_noise.tables`; ``stage`` as above."""

    stage: str
    transfer: pd.DataFrame
    points: pd.DataFrame
    dark: pd.DataFrame
    dark_means: pd.DataFrame


@dataclass(frozen=True)
class Examples:
    """Estimates on single pictures.

    Attributes:
        source: of the pictures.
        table: `pipeline.experiments.pictures.noise_examples.COLUMNS`.
        crops: (128, 128) grey levels of each, in the table's order.
    """

    source: str
    table: pd.DataFrame
    crops: tuple[NDArray[np.uint8], ...]


def example_crop(number: int) -> str:
    """File name of the crop of an example."""
    return f"examples_{number}.png"


def examples(recorded: Path | None) -> Examples | None:
    """The recorded examples; None where there are none."""
    folder = _folder(recorded, EXAMPLES_FOLDER)
    if folder is None:
        return None
    table = _table(folder / EXAMPLES_FILE)
    table = table.assign(reasons=table["reasons"].fillna(""))
    crops = tuple(read_grey8(folder / example_crop(number)) for number in range(table["example"].nunique()))
    return Examples(str(optional(folder, EXAMPLES_PROVENANCE_FILE)["source"]), table, crops)


def stage_has_run(stages: Stages, name: str) -> bool:
    """Whether the stage measured a recording, and not only wrote that its data are absent."""
    about = optional(stages.get(name), "recording.json")
    return bool(about and about.get("ran"))


def recordings(stages: Stages, recorded: Path | None) -> list[Recording]:
    """Recordings with patches, measured by a stage or recorded earlier, in the order of the configuration."""
    earlier = _earlier(recorded)
    names = [*stages, *(name for name in earlier if name not in stages)]
    made = (_made(stages, name) if stage_has_run(stages, name) else earlier.get(name) for name in names)
    return [recording for recording in made if recording is not None and len(recording.patches)]


def sensor(stages: Stages, recorded: Path | None) -> Sensor | None:
    """The sensor's constants, from the stage or recorded earlier; None where there are none."""
    if stage_has_run(stages, SENSOR):
        folder = stages[SENSOR]
        tables = {"transfer": TRANSFER, "points": TRANSFER_POINTS, "dark": DARK, "dark_means": DARK_MEANS}
        return Sensor(f"real_noise@{SENSOR}", **{n: optional(folder, f"{n}.parquet", s) for n, s in tables.items()})
    folder_of_record = _folder(recorded, SENSOR_FOLDER)
    return None if folder_of_record is None else recorded_sensor(folder_of_record)


def recorded_sensor(folder: Path) -> Sensor:
    """The constants in a folder that ``camera-monitor record sensor`` has written.

    Raises:
        InputError: a table is absent or broken; names its file.
    """
    files = {
        "transfer": (TRANSFER_FILE, TRANSFER),
        "points": (POINTS_FILE, TRANSFER_POINTS),
        "dark": (DARK_FILE, DARK),
        "dark_means": (DARK_MEANS_FILE, DARK_MEANS),
    }
    return Sensor("", **{name: _csv(folder / file, schema) for name, (file, schema) in files.items()})


def _made(stages: Stages, name: str) -> Recording:
    folder = stages[name]
    about = optional(folder, "recording.json")
    patches = optional(folder, "patches.parquet", REAL_NOISE_PATCHES)
    summary = optional(folder, "summary.parquet", REAL_NOISE_SUMMARY)
    return Recording(name, str(about["source"]), f"real_noise@{name}", patches, summary)


def _earlier(recorded: Path | None) -> dict[str, Recording]:
    """Name -> what was recorded earlier."""
    result = {}
    folder = _folder(recorded, NOISE_FOLDER)
    if folder is not None:
        source = str(optional(folder, PROVENANCE_FILE)["source"])
        patches, summary = (_table(folder / file) for file in (PATCHES_FILE, SUMMARY_FILE))
        for name in summary["dataset"].unique():
            selected = [part[part["dataset"] == name].drop(columns="dataset") for part in (patches, summary)]
            conformed = (REAL_NOISE_PATCHES.conform(selected[0], NOISE_FOLDER), REAL_NOISE_SUMMARY.conform(selected[1]))
            result[str(name)] = Recording(str(name), source, "", *conformed)
    folder = _folder(recorded, SENSOR_FOLDER)
    if folder is not None and (folder / RAW_SUMMARY_FILE).exists():
        source = str(optional(folder, RAW_PROVENANCE_FILE)["source"])
        patches = _csv(folder / RAW_PATCHES_FILE, REAL_NOISE_PATCHES)
        result[SENSOR] = Recording(SENSOR, source, "", patches, _csv(folder / RAW_SUMMARY_FILE, REAL_NOISE_SUMMARY))
    return result


def _folder(recorded: Path | None, name: str) -> Path | None:
    return existing(recorded / name if recorded is not None else None)


def _csv(path: Path, schema: Schema) -> pd.DataFrame:
    return schema.conform(_table(path), str(path))


def _table(path: Path) -> Any:
    """A table as `pipeline.recording.provenance` writes it: empty cells of text are "", those of numbers are NaN."""
    text = {"plane": "string", "picture": "string", "reason": "string", "mean_picture_reason": "string"}
    text["dark_sigma_reason"] = "string"
    table = read_csv(path, "restore it from git, or measure it again (camera-monitor record)", text)
    return table.assign(**{name: table[name].fillna("") for name in text if name in table})
