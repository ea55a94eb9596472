"""Noise budgets of frames: how often noise departs from its sensor, rightly and wrongly, and which cause is stated.

    python benchmarks/noise_budget.py [--dataset NAME=KIND:ROOT ...] [--raw FOLDER] [--frames N] [--out FILE]

Frames of *Sim* and of the datasets, smoothed slightly to be rid of their own noise, are taken in linear light by the
cameras of `SENSORS` at `SETTINGS`, equally bright in all, as by the camera that a budget assumes and as by one that
differs (`CASES`): another gain, twice the readout noise, a hotter sensor, 4 % of fixed pattern, noise of 3 DN behind
the tone curve. Of each case: the mean ratio of estimated by expected noise, where the budget is known; counts of the
verdicts ``agrees``, ``more``, ``less``, ``undecided`` and ``unknown``; and of ``more`` and ``less``, how many state the
true cause among what explains them, and how many as the best.

``raw``: planes of raw frames of a folder SCENE_250ms_*.tif, with the constants of their own sensor
(``reports/recorded/real-sensor``), whose true gain is 1: assumed right, without the fixed pattern, and with twice the
gain.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks import coded_noise, common  # noqa: E402

common.one_thread()

import cv2  # noqa: E402
import numpy as np  # noqa: E402

from pipeline import noise  # noqa: E402
from pipeline.camera.characterisation import emva1288  # noqa: E402
from pipeline.camera.exposure import Camera  # noqa: E402
from pipeline.camera.sensor import named  # noqa: E402
from pipeline.camera.tone_curve import decode  # noqa: E402
from pipeline.condition.estimate import noise_of_frame  # noqa: E402
from pipeline.condition.noise_budget import DEPARTURES, noise_budget  # noqa: E402
from pipeline.datasets.decoding.pictures import read_grey8  # noqa: E402
from pipeline.datasets.decoding.raw_frames import raw_frames  # noqa: E402
from pipeline.datasets.selection import evenly_spread  # noqa: E402
from pipeline.recording.measured_sensor import measured_sensor  # noqa: E402
from pipeline.streams import stream  # noqa: E402

if TYPE_CHECKING:
    from pipeline.condition.noise_budget import FrameBudget
    from pipeline.datasets.dataset import Dataset

SENSORS = ("automotive_3um", "prosilica_gc1380h")
SETTINGS = ((0.008, 4.0), (0.008, 16.0), (0.03, 8.0))
RECORD = ROOT / "reports/recorded/real-sensor"
SMOOTHING_PX, SEED = 0.7, 1
PATTERN, ADDED_DN = 0.04, 3.0

CASES = {
    "as assumed": "", "gain x 2": "gain", "gain x 1.4": "gain", "gain x 0.5": "gain",
    "readout x 2": "dark or readout", "345 K": "dark or readout", "pattern 4 %": "pattern", "3 DN added": "added",
}  # fmt: skip
"""What differs from the camera that is assumed -> the kind of explanation that is true of it."""


def louder(camera: Camera) -> Camera:
    """A camera with twice the readout noise."""
    sensor = camera.sensor
    before = sensor.readout_sigma_e(camera.temperature_k) if sensor.read_noise_e is None else sensor.read_noise_e
    return replace(
        camera,
        sensor=replace(sensor, read_noise_e=2 * before, read_noise_after_gain_e=2 * sensor.read_noise_after_gain_e),
    )


def taken(grey: np.ndarray, camera: Camera, exposure_s: float, gain: float, case: str, *key: str) -> np.ndarray:
    """A frame (H, W) in [0, 1] of a case of `CASES`.

    Args:
        grey: (H, W) grey levels without noise, [0, 1].
        camera: that is assumed.
        exposure_s: exposure time.
        gain: that is assumed.
        case: see above.
        key: of the random streams.
    """
    light = decode(grey.astype(np.float64), camera.gamma)
    used = gain * float(case.split()[-1]) if case.startswith("gain") else gain
    if case == "readout x 2":
        camera = louder(camera)
    if case == "345 K":
        camera = replace(camera, temperature_k=345.0)
    if case.startswith("pattern"):
        light *= 1.0 + PATTERN * stream(SEED, "noise budget", "pattern", *key).standard_normal(light.shape)
    drawn = stream(SEED, "noise budget", *key)
    image = camera.expose(np.maximum(light, 0.0) / used, exposure_s, used, drawn).image
    if case.endswith("added"):
        added = stream(SEED, "noise budget", "added", *key).normal(0.0, ADDED_DN, image.shape)
        image = (np.clip(np.rint(255.0 * image + added), 0, 255) / 255.0).astype(np.float32)
    return image


def measure(dataset: Dataset, frames: int) -> Iterator[tuple[str, str, FrameBudget]]:
    """Sensor, case and budget of every frame of a dataset at every setting."""
    estimator, chosen = noise.create(noise.DEFAULT), evenly_spread(dataset.frames(), frames)
    for number, frame in enumerate(chosen):
        grey = cv2.GaussianBlur(read_grey8(frame.path).astype(np.float32) / np.float32(255), (0, 0), SMOOTHING_PX)
        for sensor, (exposure_s, gain), case in product(SENSORS, SETTINGS, CASES):
            camera = Camera(named(sensor), radiance_at_full_scale=1.0, reference_exposure_s=exposure_s)
            image = taken(grey, camera, exposure_s, gain, case, dataset.name, frame.name, sensor, f"{gain:g}")
            state = noise_of_frame(estimator, image)
            yield sensor, case, noise_budget(image, state, camera, exposure_s, gain)
        print(dataset.name, f"{number + 1} of {len(chosen)} frames", flush=True)


def of_raw(folder: Path) -> dict[str, list[FrameBudget]]:
    """Budgets of the planes of raw frames, by what is assumed of their sensor."""
    sensor, pattern, black_dn = measured_sensor(RECORD)
    camera, estimator = Camera(sensor, gamma=1.0, adc_bits=8), noise.create(noise.DEFAULT)
    assumed: dict[str, tuple[float, float]] = {
        "as recorded": (1.0, pattern), "without pattern": (1.0, 0.0), "gain x 2": (2.0, 0.0),
    }  # fmt: skip
    results: dict[str, list[FrameBudget]] = {name: [] for name in assumed}
    for frame in raw_frames(folder):
        pixels = frame.pixels().astype(np.float32) / np.float32(255)
        for plane in emva1288.PLANES:
            image = emva1288.plane(pixels, plane)
            state = noise_of_frame(estimator, image)
            for name, (gain, fraction) in assumed.items():
                results[name].append(noise_budget(image, state, camera, frame.exposure_s, gain, fraction, black_dn))
    return results


def summarised(budgets: Sequence[FrameBudget], cause: str = "") -> dict[str, Any]:
    """Counts of departures, the ratio, and how often a cause is stated.

    Args:
        budgets: of frames.
        cause: the kind of explanation that is true; empty where nothing differs.
    """
    counts = Counter(budget.verdict for budget in budgets)
    ratios = [budget.ratio for budget in budgets if np.isfinite(budget.ratio)]
    departed = [budget for budget in budgets if budget.verdict in DEPARTURES]
    row: dict[str, Any] = {
        "frames": len(budgets),
        **{name: counts[name] for name in ("agrees", "more", "less", "undecided", "unknown")},
        "mean_ratio": round(float(np.mean(ratios)), 3) if ratios else None,
        "ratio_std": round(float(np.std(ratios)), 3) if ratios else None,
    }
    if cause and departed:
        kinds = [[item.kind for item in budget.explanations] for budget in departed]
        row |= {
            "cause_stated": round(float(np.mean([cause in listed for listed in kinds])), 3),
            "cause_first": round(float(np.mean([listed[:1] == [cause] for listed in kinds])), 3),
        }
    return row


def main(arguments: Sequence[str] | None = None) -> None:
    """Take, estimate, compare, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dataset", action="append", default=[], metavar="NAME=KIND:ROOT", help="may be repeated")
    parser.add_argument("--raw", type=Path, help="folder of raw frames of the recorded sensor")
    parser.add_argument("--frames", type=common.positive, default=4, help="at most this many of each dataset")
    parser.add_argument("--out", type=Path, help="JSON file, by default benchmarks/results/noise_budget.json")
    options = parser.parse_args(arguments)
    common.hold_loaded_libraries()
    datasets = [coded_noise.parse(text) for text in (f"sim=sim:{ROOT / 'data/sim'}", *options.dataset)]
    names = [dataset.name for dataset in datasets] + ["raw"] * (options.raw is not None)
    common.check_datasets("noise_budget", names, options.out)
    raw = {} if options.raw is None else of_raw(options.raw)
    measured = [row for dataset in datasets for row in measure(dataset, options.frames)]
    results = {
        sensor: {
            case: summarised([budget for name, kind, budget in measured if (name, kind) == (sensor, case)], cause)
            for case, cause in CASES.items()
        }
        for sensor in SENSORS
    }
    record = {
        "datasets": names, "frames_per_dataset": options.frames, "seed": SEED, "results": results,
        "raw": {name: summarised(budgets) for name, budgets in raw.items()},
    }  # fmt: skip
    print(common.write("noise_budget", record, options.out))


if __name__ == "__main__":
    common.run(main)
