"""Blur estimators on pictures of real cameras: measured camera shake, and photographs beside the mean of many shots.

    python benchmarks/real_blur.py [--shake FOLDER] [--pairs NAME=FOLDER ...] [--out FILE]

``--shake``: ``SCENE_KERNEL.mat`` of Levin et al. 2009, each with a photograph blurred by camera shake, the same scene
from a tripod and the measured kernel. An estimate is the median over the 192 px windows that cover a photograph, given
in one call; its error is the mean absolute difference from the kernel's MTF. `spectral` and `fused` are calibrated to
the windows of the sharp photograph of their own scene (``own``) or of the other scenes (``other``); PMP and GBB (fast)
estimate as they are. ``null`` is the mean MTF of the scene's other kernels, which looks at no picture.

``--pairs``: folders of ``NAME_real.*`` and ``NAME_mean.*`` (`pipeline.noise.real_noise.pairs`): a noisy photograph and
the mean of many of the same static scene have the same lens and motion, so that their MTFs should agree. Reported: the
mean absolute difference over the windows that both answer, with a 95 % interval from a bootstrap over pictures, and
how many values of the mean lie in the photograph's 95 % interval. Nothing is calibrated.

None of the pictures is kept; the record names them by one SHA-256.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks import camera_shake, common  # noqa: E402

common.one_thread()

import numpy as np  # noqa: E402

from pipeline import blur  # noqa: E402
from pipeline.camera import mtf  # noqa: E402
from pipeline.camera.quantise import to_8bit  # noqa: E402
from pipeline.cluster_intervals import cluster_mean  # noqa: E402
from pipeline.datasets.decoding.pictures import read_grey8  # noqa: E402
from pipeline.datasets.patches import BLUR_PX, cut, tiles  # noqa: E402
from pipeline.errors import InputError  # noqa: E402
from pipeline.noise.real_noise import pairs  # noqa: E402
from pipeline.recording.provenance import content_sha256  # noqa: E402
from pipeline.store import file_sha256  # noqa: E402
from pipeline.streams import stream  # noqa: E402

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pipeline.blur.base import BlurEstimator

DECONVOLUTION = {"mode": "fast", "kernel_size": 31}
CALIBRATED = ("spectral", "fused")
PEERS = ("pmp", "gbb")
OF_PAIRS: dict[str, dict[str, Any]] = {"spectral": {}, "gbb": DECONVOLUTION}


def windows(image: NDArray[np.floating]) -> NDArray[np.float32]:
    """(N, 1, 192, 192) windows that cover a picture, (H, W) in [0, 1], rounded to 8 bits."""
    rounded = to_8bit(image)
    return cut(rounded, tiles(rounded.shape, BLUR_PX, "cover"))


def error_percent(estimator: BlurEstimator, patches: NDArray[np.float32], truth: NDArray[np.floating]) -> float | None:
    """Mean absolute error of the median over patches, percent; None where all abstain."""
    answers = np.asarray(estimator.estimate(patches).mtf, float)
    known = answers[~np.isnan(answers).any(axis=(1, 2))]
    return round(100 * float(np.abs(np.median(known, axis=0) - truth).mean()), 3) if len(known) else None


def shake(folder: Path) -> dict[str, Any]:
    """Errors of every estimator on every photograph, and their mean and maximum.

    Raises:
        InputError: the folder holds photographs of fewer than two scenes.
    """
    scenes: dict[str, dict[str, Any]] = {}
    for photograph in camera_shake.photographs(folder):
        if photograph.scene not in scenes:
            scenes[photograph.scene] = {"sharp": windows(photograph.sharp), "blurred": {}}
        seen = windows(photograph.blurred), mtf.sample(photograph.psf)
        scenes[photograph.scene]["blurred"][photograph.kernel] = seen
    if len(scenes) < 2:
        raise InputError(f"{folder}: photographs SCENE_KERNEL.mat of {len(scenes)} scenes; expected two at least")
    peers = {name: blur.create(name, **DECONVOLUTION) for name in PEERS}
    rows = []
    for scene, about in scenes.items():
        sharp = {
            "own": about["sharp"],
            "other": np.concatenate([one["sharp"] for name, one in scenes.items() if name != scene]),
        }
        estimators: dict[str, BlurEstimator] = {
            f"{name}_{whose}": blur.create(name).calibrated(patches)
            for name in CALIBRATED
            for whose, patches in sharp.items()
        }
        for kernel, (patches, truth) in about["blurred"].items():
            others = [known for name, (_, known) in about["blurred"].items() if name != kernel]
            errors = {name: error_percent(one, patches, truth) for name, one in {**estimators, **peers}.items()}
            errors["null"] = round(100 * float(np.abs(np.mean(others, axis=0) - truth).mean()), 3)
            rows.append({"scene": scene, "kernel": kernel, "error_percent": errors})
            print(scene, kernel, errors, flush=True)
    return {"photographs": rows, "summary": summary(rows), "inputs_sha256": hashed(camera_shake.files(folder))}


def summary(rows: Sequence[Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Estimator -> its mean error with a 95 % interval, median and greatest error over the photographs it answered.

    Kernels are resampled, each with its photographs of all scenes: what a kernel is like decides most of the error.
    """
    import pandas as pd

    kernels = pd.Series([row["kernel"] for row in rows])
    errors = pd.DataFrame([row["error_percent"] for row in rows]).astype(float)
    result = {}
    for name, values in errors.items():
        if values.notna().any():
            generator = stream(0, "real blur", "shake", str(name))
            mean, low, high, count = cluster_mean(values, kernels, generator, bounds=(0.0, math.inf))
            numbers = {"mean": mean, "low": low, "high": high, "median": values.median(), "greatest": values.max()}
            result[str(name)] = {f"{key}_percent": round(float(number), 3) for key, number in numbers.items()}
            result[str(name)]["answered"] = count
    return result


def agreement(name: str, folder: Path) -> dict[str, Any]:
    """How photographs and the means of many shots of their scenes agree, by each estimator."""
    import pandas as pd

    estimators = {kind: blur.create(kind, **options) for kind, options in OF_PAIRS.items()}
    found, rows = pairs(folder), []
    for pair in found:
        real, mean = (windows(read_grey8(path) / np.float32(255)) for path in (pair.real, pair.mean))
        for kind, estimator in estimators.items():
            answers = [estimator.estimate(part) for part in (real, mean)]
            for index in range(len(real)):
                ours, theirs = (np.asarray(answer.mtf[index], float) for answer in answers)
                low, high = answers[0].low, answers[0].high
                held = np.nan
                if low is not None and high is not None:
                    held = float(((low[index] <= theirs) & (theirs <= high[index])).mean())
                known = not (np.isnan(ours).any() or np.isnan(theirs).any())
                difference = 100 * float(np.abs(ours - theirs).mean()) if known else np.nan
                rows.append((pair.name, kind, difference, held if known else np.nan))
        print(name, pair.name, flush=True)
    table = pd.DataFrame(rows, columns=["picture", "estimator", "difference_percent", "held_fraction"])
    result: dict[str, Any] = {"pictures": len(found)}
    for kind in estimators:
        part, generator = table[table["estimator"] == kind], stream(1, "real blur", name, kind)
        value, low_end, high_end, count = cluster_mean(
            part["difference_percent"], part["picture"], generator, 1000, (0, 100)
        )
        held = part["held_fraction"].mean()
        result[kind] = {
            "patches": len(part),
            "answered": count,
            "difference_percent": round(value, 3),
            "low_percent": round(low_end, 3),
            "high_percent": round(high_end, 3),
            "held_fraction": None if np.isnan(held) else round(float(held), 4),
        }
    return result | {"inputs_sha256": hashed([path for pair in found for path in (pair.real, pair.mean)])}


def hashed(paths: Sequence[Path]) -> str:
    """One SHA-256 of files, by name and content, as of a record's inputs."""
    return content_sha256({"files": {path.name: file_sha256(path) for path in paths}})


def main(arguments: Sequence[str] | None = None) -> None:
    """Estimate, compare, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--shake", type=Path, metavar="FOLDER", help="photographs with measured kernels")
    parser.add_argument("--pairs", action="append", default=[], metavar="NAME=FOLDER", help="may be repeated")
    parser.add_argument("--out", type=Path, help="JSON file, by default benchmarks/results/real_blur.json")
    options = parser.parse_args(arguments)
    if not options.shake and not options.pairs:
        parser.error("nothing to measure; give --shake or --pairs")
    common.hold_loaded_libraries()
    named = [text.partition("=") for text in options.pairs]
    datasets = [*(["shake"] if options.shake else []), *(name for name, _, _ in named)]
    common.check_datasets("real_blur", datasets, options.out)
    record: dict[str, Any] = {"datasets": datasets} | ({"shake": shake(options.shake)} if options.shake else {})
    record["pairs"] = {name: agreement(name, Path(folder)) for name, _, folder in named}
    print(common.write("real_blur", record, options.out))


if __name__ == "__main__":
    common.run(main)
