"""Constants of a real sensor, measured from raw frames that the project may not keep.

Measured by hand, with ``camera-monitor record sensor``. Frames are named by their SHA-256; none is kept.

    sensor_transfer.csv     photon transfer of each colour plane (`pipeline.experiments.real_noise.sensor_constants`)
    sensor_points.csv       the points that its lines are fitted to
    sensor_dark.csv         dark current of each colour plane
    sensor_dark_means.csv   mean of each dark frame
    sensor_patches.csv      noise estimated on patches of the frames (`pipeline.experiments.real_noise.experiment`)
    sensor_summary.csv      its errors (`pipeline.noise.real_noise.summarise`)
    sensor_provenance.json  source, frames, white, weights
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.datasets.decoding.raw_frames import raw_frames
from pipeline.experiments.real_noise.experiment import Kinds, measure_raw
from pipeline.experiments.real_noise.records import (
    DARK_FILE,
    DARK_MEANS_FILE,
    POINTS_FILE,
    RAW_PATCHES_FILE,
    RAW_PROVENANCE_FILE,
    RAW_SUMMARY_FILE,
    TRANSFER_FILE,
)
from pipeline.experiments.real_noise.sensor_constants import sensor_constants
from pipeline.noise.real_noise import summarise
from pipeline.recording.provenance import sha256_of, weights_of_kinds, write_record

if TYPE_CHECKING:
    import pandas as pd

RESULTS = (
    RAW_PROVENANCE_FILE, TRANSFER_FILE, POINTS_FILE, DARK_FILE, DARK_MEANS_FILE, RAW_PATCHES_FILE, RAW_SUMMARY_FILE,
)  # fmt: skip
"""Files of a record, its provenance first."""


def record(
    light: Path,
    dark: Path,
    white_dn: float,
    kinds: Kinds,
    out: Path,
    source: str,
    run_map: Callable[..., list[Any]],
    *,
    seed: int = 1,
    draws: int = 500,
) -> pd.DataFrame:
    """Measure a sensor and write everything into a folder.

    Args:
        light: folder of frames of lit scenes, each scene at two exposures or more, or twice at each.
        dark: folder of dark frames of three exposures or more.
        white_dn: grey value of saturation, DN.
        kinds: name in the tables -> registered noise estimator and its options.
        out: folder; replaced.
        source: where the frames come from, their revision and licence, in words.
        run_map: see `pipeline.executor.run_map`; changes no result.
        seed: root of the bootstrap's streams.
        draws: its resamples.

    Returns:
        `pipeline.experiments.real_noise.sensor_constants.SensorConstants.transfer`.

    Raises:
        InputError: frames are absent, broken or too few, or there is no such estimator.
    """
    weights = weights_of_kinds(kinds)
    lit, unlit = raw_frames(light), raw_frames(dark)
    sensor = sensor_constants(lit, unlit, white_dn)
    patches = measure_raw(lit, sensor.fits, white_dn, kinds, run_map, "noise of raw frames")
    tables = {
        TRANSFER_FILE: sensor.transfer,
        POINTS_FILE: sensor.points,
        DARK_FILE: sensor.dark,
        DARK_MEANS_FILE: sensor.dark_means,
        RAW_PATCHES_FILE: patches,
        RAW_SUMMARY_FILE: summarise(patches, seed, draws),
    }
    about = {
        "source": source,
        "frames": {
            name: sha256_of(frame.path for frame in frames) for name, frames in (("light", lit), ("dark", unlit))
        },
        "weights": weights,
        "white_dn": white_dn,
        "seed": seed,
        "bootstrap_draws": draws,
    }
    write_record(out, tables, about, RAW_PROVENANCE_FILE)
    return sensor.transfer
