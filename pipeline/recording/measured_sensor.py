"""The model of a sensor that was measured: a record of ``camera-monitor record sensor`` as a `Sensor`.

Photon transfer gives the electrons at full scale, the readout noise and the fixed pattern, dark frames the dark
current and the black level, each as the median over the colour planes. They hold at the gain and the temperature of the
recording: gain 1 of the model, and `RECORDED_K` stands for that temperature, whatever it was.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from pipeline.camera.constants import FULL_SCALE_DN
from pipeline.camera.sensor import Sensor, named
from pipeline.errors import InputError, printable
from pipeline.experiments.real_noise.records import DARK_FILE, TRANSFER_FILE, recorded_sensor

if TYPE_CHECKING:
    import pandas as pd

RECORDED_K = 300.0
"""Temperature that `pipeline.camera.exposure.Camera` takes for that of the recording."""


class MeasuredSensor(NamedTuple):
    """A sensor with its fixed pattern, as a fraction of the light, and the black level of its raw frames, 0..255 DN."""

    sensor: Sensor
    pattern_fraction: float = 0.0
    black_dn: float = 0.0


def is_record(name: str) -> bool:
    """Whether a sensor's name is the folder of a record rather than a preset."""
    return Path(name).is_dir()


def sensor_of(name: str) -> MeasuredSensor:
    """A sensor by the name of a preset, which has neither fixed pattern nor black level, or by the folder of a record.

    Args:
        name: a key of `pipeline.camera.sensor.SENSORS`, or a folder; see `measured_sensor`.

    Raises:
        InputError: neither, or a record that is broken.
    """
    if is_record(name):
        return measured_sensor(Path(name))
    try:
        return MeasuredSensor(named(name))
    except InputError as error:
        raise InputError(f"{error}; or give a folder that camera-monitor record sensor has written") from None


def measured_sensor(folder: Path) -> MeasuredSensor:
    """The sensor of a record: full scale, readout noise and dark current as measured, at gain 1 and `RECORDED_K`.

    Readout noise that quantisation hid counts as 0, and so does a dark current below 0.

    Args:
        folder: that ``camera-monitor record sensor`` has written.

    Raises:
        InputError: a table is absent or broken; names the file.
    """
    if not (folder / TRANSFER_FILE).is_file():
        raise InputError(
            f"{printable(folder / TRANSFER_FILE)}: no such file; give a folder that camera-monitor record sensor has "
            "written"
        )
    constants = recorded_sensor(folder)
    transfer, dark = (folder / TRANSFER_FILE, constants.transfer), (folder / DARK_FILE, constants.dark)
    full_well_e, pattern = _median(*transfer, "full_scale_e"), _median(*transfer, "pattern_fraction")
    readout_e = _median(*transfer, "dark_sigma_e", may_be_absent=True)
    current = max(_median(*dark, "dark_current_e_per_s"), 0.0)
    if not (full_well_e > 0.0 and readout_e >= 0.0 and 0.0 <= pattern < 1.0):
        raise InputError(
            f"{printable(transfer[0])}: full_scale_e={full_well_e:g}, dark_sigma_e={readout_e:g}, "
            f"pattern_fraction={pattern:g}; expected above 0, at least 0 and 0 to 1; record the sensor again"
        )
    # cut off where half of the dark pixels are 0
    offsets = dark[1].assign(offset_dn=dark[1]["offset_dn"].where(dark[1]["zero_fraction"] < 0.5, 0.0))
    offset_dn = max(_median(dark[0], offsets, "offset_dn"), 0.0)
    black_dn = FULL_SCALE_DN * offset_dn / (offset_dn + full_well_e * _median(*transfer, "gain_dn_per_e"))
    sensor = Sensor(full_well_e=full_well_e, read_noise_e=readout_e, dark_figure_na_per_cm2=1.0)
    figure = current / sensor.dark_electrons(RECORDED_K, 1.0)
    return MeasuredSensor(replace(sensor, dark_figure_na_per_cm2=figure), pattern, black_dn)


def with_lower_gain(sensor: Sensor, factor: float) -> Sensor:
    """A sensor whose gain 1 is a fraction of that at which its constants hold.

    As many times more electrons fill the scale, and what the converter adds behind the gain is as many more of them.

    Args:
        sensor: its constants.
        factor: gain at which they hold, by the gain that is to be 1: 8 for those of ISO 800 where gain 1 is ISO 100.
    """
    well_e, after_e = factor * sensor.full_well_e, factor * sensor.read_noise_after_gain_e
    return replace(sensor, full_well_e=well_e, read_noise_after_gain_e=after_e)


def _median(file: Path, table: pd.DataFrame, column: str, may_be_absent: bool = False) -> float:
    """Median of a column over the planes that have a number; 0 where none has and that may be."""
    numbers = table[column].dropna()
    if numbers.empty and may_be_absent:
        return 0.0
    value = float(numbers.median()) if len(numbers) else math.nan
    if not math.isfinite(value):
        raise InputError(f"{printable(file)}: no number in its column {column}; record the sensor again")
    return value
