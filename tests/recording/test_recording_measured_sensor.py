"""A recorded sensor as a model: the constants of its tables, and what is wrong with a record is named."""

from __future__ import annotations

import shutil
from pathlib import Path

import pandas as pd
import pytest

from pipeline.camera.sensor import named
from pipeline.errors import InputError
from pipeline.experiments.real_noise.records import DARK_FILE, TRANSFER_FILE
from pipeline.recording.measured_sensor import RECORDED_K, measured_sensor, sensor_of

RECORD = Path(__file__).resolve().parents[2] / "reports/recorded/real-sensor"


def test_constants_are_the_medians_of_the_planes():
    sensor, pattern, black_dn = measured_sensor(RECORD)
    transfer, dark = pd.read_csv(RECORD / TRANSFER_FILE), pd.read_csv(RECORD / DARK_FILE)
    assert sensor.full_well_e == pytest.approx(transfer["full_scale_e"].median())
    assert sensor.readout_sigma_e(RECORDED_K) == pytest.approx(transfer["dark_sigma_e"].median())
    assert sensor.dark_electrons(RECORDED_K, 2.0) == pytest.approx(2.0 * dark["dark_current_e_per_s"].median())
    assert sensor.dn_per_electron == pytest.approx(transfer["gain_dn_per_e"].median(), rel=0.01)
    assert pattern == pytest.approx(transfer["pattern_fraction"].median())
    assert black_dn == 0.0  # nearly all pixels of its dark frames are 0


def test_a_name_is_a_preset_or_a_folder():
    assert sensor_of("imx255") == (named("imx255"), 0.0, 0.0)
    assert sensor_of(str(RECORD)) == measured_sensor(RECORD)
    with pytest.raises(InputError, match=r"imx25.*imx255.*record sensor"):
        sensor_of("imx25")


def test_readout_noise_that_quantisation_hid_counts_as_none(tmp_path: Path):
    folder = copied(tmp_path, TRANSFER_FILE, dark_sigma_e=float("nan"))
    assert measured_sensor(folder)[0].readout_sigma_e(RECORDED_K) == 0.0


def test_the_black_level_is_that_of_the_dark_frames_on_the_8_bit_scale(tmp_path: Path):
    """White, 16 bits, is the black level and what the full well adds to it."""
    folder = copied(tmp_path, DARK_FILE, offset_dn=4096.0, zero_fraction=0.0)
    transfer = pd.read_csv(folder / TRANSFER_FILE)
    transfer.assign(gain_dn_per_e=(65520.0 - 4096.0) / transfer["full_scale_e"]).to_csv(
        folder / TRANSFER_FILE, index=False
    )
    assert measured_sensor(folder).black_dn == pytest.approx(255.0 * 4096.0 / 65520.0, rel=1e-3)


def copied(folder: Path, file: str, **changes: object) -> Path:
    record = folder / "record"
    shutil.copytree(RECORD, record)
    pd.read_csv(record / file).assign(**changes).to_csv(record / file, index=False)
    return record


@pytest.mark.parametrize(
    ("file", "changes", "word"),
    [
        (TRANSFER_FILE, {"full_scale_e": 0.0}, "full_scale_e=0"),
        (TRANSFER_FILE, {"full_scale_e": float("nan")}, "full_scale_e"),
        (TRANSFER_FILE, {"pattern_fraction": 1.5}, "pattern_fraction=1.5"),
        (TRANSFER_FILE, {"dark_sigma_e": "x"}, "dark_sigma_e"),
        (DARK_FILE, {"dark_current_e_per_s": float("inf")}, "dark_current_e_per_s"),
    ],
)
def test_a_broken_table_is_named(tmp_path: Path, file: str, changes: dict[str, object], word: str):
    with pytest.raises(InputError) as caught:
        measured_sensor(copied(tmp_path, file, **changes))
    assert file in str(caught.value) and word in str(caught.value)


def test_a_folder_that_is_no_record_is_refused(tmp_path: Path):
    with pytest.raises(InputError, match=rf"{TRANSFER_FILE}: no such file; give a folder"):
        measured_sensor(tmp_path)
    (tmp_path / TRANSFER_FILE).write_bytes(b"\xff\xfe\x00 nothing")
    with pytest.raises(InputError, match=TRANSFER_FILE):
        measured_sensor(tmp_path)
