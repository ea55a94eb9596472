"""Constants of a real sensor, measured from raw frames that the project may not keep.

Measured by hand, with ``camera-monitor record sensor``. Frames are named by their SHA-256; none is kept.

    sensor_transfer.csv     photon transfer of each colour plane (`pipeline.experiments.sensor_constants`)
    sensor_points.csv       the points that its lines are fitted to
    sensor_dark.csv         dark current of each colour plane
    sensor_dark_means.csv   mean of each dark frame
    sensor_patches.csv      noise estimated on patches of the frames (`pipeline.experiments.real_noise`)
    sensor_summary.csv      its errors (`pipeline.noise.real_noise.summarise`)
    sensor_provenance.json  source, frames, white, weights
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline import store
from pipeline.datasets.raw_frames import raw_frames
from pipeline.experiments.real_noise import Kinds, measure_raw
from pipeline.experiments.real_noise_records import (
    DARK_FILE,
    DARK_MEANS_FILE,
    POINTS_FILE,
    RAW_PATCHES_FILE,
    RAW_PROVENANCE_FILE,
    RAW_SUMMARY_FILE,
    TRANSFER_FILE,
)
from pipeline.experiments.sensor_constants import sensor_constants
from pipeline.noise.real_noise import summarise
from pipeline.recording.provenance import content_sha256, noise_weights, write_csv
from pipeline.store import file_sha256

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
        light: folder of frames of lit scenes, each scene at two exposures or more, or twice at one.
        dark: folder of dark frames of three exposures or more.
        white_dn: grey value of saturation, DN.
        kinds: name in the tables -> registered noise estimator and its options.
        out: folder; replaced.
        source: where the frames come from, their revision and licence, in words.
        run_map: see `pipeline.executor.run_map`; changes no result.
        seed: root of the bootstrap's streams.
        draws: its resamples.

    Returns:
        `pipeline.experiments.sensor_constants.SensorConstants.transfer`.

    Raises:
        InputError: frames are absent, broken or too few, or there is no such estimator.
    """
    weights = {name: noise_weights(kind, options) for name, (kind, options) in kinds.items()}
    lit, unlit = raw_frames(light), raw_frames(dark)
    sensor = sensor_constants(lit, unlit, white_dn)
    patches = measure_raw(lit, sensor.fits, white_dn, kinds, run_map, "noise of raw frames")
    hashes: Mapping[str, Mapping[str, str]] = {
        name: {frame.path.name: file_sha256(frame.path) for frame in frames}
        for name, frames in (("light", lit), ("dark", unlit))
    }
    with store.replacing_folder(out) as folder:
        write_csv(folder / TRANSFER_FILE, sensor.transfer)
        write_csv(folder / POINTS_FILE, sensor.points)
        write_csv(folder / DARK_FILE, sensor.dark)
        write_csv(folder / DARK_MEANS_FILE, sensor.dark_means)
        write_csv(folder / RAW_PATCHES_FILE, patches)
        write_csv(folder / RAW_SUMMARY_FILE, summarise(patches, seed, draws))
        provenance = {
            "source": source,
            "frames": hashes,
            "inputs_sha256": content_sha256({"frames": hashes}),
            "weights": {name: files for name, files in weights.items() if files},
            "white_dn": white_dn,
            "seed": seed,
            "bootstrap_draws": draws,
        }
        store.write_json(folder / RAW_PROVENANCE_FILE, provenance)
    return sensor.transfer
