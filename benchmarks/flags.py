"""How well blur and noise of frames are ranked, beside usual measures, and how often flags of noise are raised.

Usage::

    python benchmarks/flags.py [--sim data/sim] [--realdata FOLDER] [--frames N] [--out FILE]

Frames of *Sim* and photographs are cropped, blurred by a disc of defocus or a line of motion and made noisy, every
blur with every noise. Each measure is compared with the true blur (1 minus the mean MTF of the kernel) and with the
true noise by Spearman's rank correlation, over all frames and conditions together, so that a measure that follows the
scene or the other corruption loses. Where our noise has no estimate but a bound, the bound counts. ``--realdata`` adds
pictures that may not be kept here: blur by real camera shake with measured kernels (Levin et al. 2009,
``levin2009/*.mat``) and noise of real cameras (CC, ``cc_noise``). Intervals are 95 %, from a bootstrap over scenes.

Under ``flags`` are the rates of the flags ``banded`` and ``impulses`` (`benchmarks.flag_rates`), on whole frames, and
with ``--realdata`` on those of its folders ``kitti``, ``kitti_more``, ``udacity``, ``sim_authors``, ``pennfudan`` and
``polyu`` too, as far as they are there.

BRISQUE (Mittal et al. 2012) is that of the package ``brisque``, whose dependencies are installed already:
``pip install --no-deps brisque libsvm-official``. Without it its rows are left out.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks import camera_shake, common, flag_rates  # noqa: E402

common.one_thread()

import cv2  # noqa: E402
import numpy as np  # noqa: E402
from scipy.stats import spearmanr  # noqa: E402

from pipeline.camera import mtf, psf  # noqa: E402
from pipeline.camera.blur import blur  # noqa: E402
from pipeline.camera.quantise import to_8bit  # noqa: E402
from pipeline.cluster_intervals import bias_corrected, resamples  # noqa: E402
from pipeline.condition import ConditionMonitor  # noqa: E402
from pipeline.datasets.decoding.pictures import read_grey, read_grey8  # noqa: E402
from pipeline.noise.real_noise import cleaned, pairs  # noqa: E402
from pipeline.streams import stream  # noqa: E402

CROP_PX = 384
BLURS = (("defocus", 0.0), ("defocus", 5.0), ("linear_motion", 9.0), ("defocus", 11.0), ("linear_motion", 21.0))
NOISE_DN = (0.0, 5.0, 10.0, 20.0)
DRAWS = 1000
OURS = {"blur": "mtf", "noise": "sigma_dn"}
FLAG_FOLDERS = {
    "kitti": "kitti", "kitti_more": "kitti_more", "udacity": "udacity", "sim_authors": "sim_authors",
    "pennfudan": "pennfudan/PNGImages", "polyu": "polyu",
}  # fmt: skip
"""Datasets that only flags are counted on -> their folder."""
STAND_INS = ("laplacian_variance", "brisque")


@dataclass(frozen=True)
class Sample:
    """A picture with its truth.

    Attributes:
        scene: what its bootstrap is over.
        image: (H, W) float32 in [0, 1].
        blur: 1 - mean MTF of the kernel; None where it is unknown.
        sigma_dn: true noise, DN; None where it is unknown.
    """

    scene: str
    image: np.ndarray
    blur: float | None
    sigma_dn: float | None


def centre(image: np.ndarray, side_px: int = CROP_PX) -> np.ndarray:
    """The middle of a picture, (H, W), at most a square of this side."""
    height, width = (min(side, side_px) for side in image.shape)
    top, left = (image.shape[0] - height) // 2, (image.shape[1] - width) // 2
    return np.ascontiguousarray(image[top : top + height, left : left + width])


def corrupted(frames: dict[str, np.ndarray]) -> Iterator[Sample]:
    """Every frame under every blur and noise."""
    for scene, frame in frames.items():
        for kind, size_px in BLURS:
            kernel = psf.create(kind, size_px, 30.0, stream(1, "flags", kind, size_px)) if size_px else None
            sharp = frame if kernel is None else np.asarray(blur(frame[None, None], kernel))[0, 0]
            loss = 0.0 if kernel is None else 1.0 - float(mtf.sample(kernel).mean())
            for sigma_dn in NOISE_DN:
                noise = stream(1, "flags", scene, kind, size_px, sigma_dn).normal(0, sigma_dn, frame.shape)
                image = to_8bit((sharp + noise / 255).astype(np.float32)).astype(np.float32) / np.float32(255)
                yield Sample(scene, image, loss, sigma_dn)


def levin(folder: Path) -> Iterator[Sample]:
    """Real camera shake: the blurred photographs and, once for each scene, the sharp one."""
    sharp: set[str] = set()
    for shake in camera_shake.photographs(folder):
        if shake.scene not in sharp:
            sharp.add(shake.scene)
            yield Sample(shake.scene, shake.sharp.astype(np.float32), 0.0, None)
        loss = 1.0 - float(mtf.sample(shake.psf).mean())
        yield Sample(shake.scene, shake.blurred.astype(np.float32), loss, None)


def cc(folder: Path) -> Iterator[Sample]:
    """Photographs of real cameras; their noise is what remains beside the mean of many of the same scene."""
    for pair in pairs(folder):
        real, mean = (centre(read_grey(path)) for path in (pair.real, pair.mean))
        yield Sample(pair.name, real, None, float(cleaned((real - mean) * 255.0, mean * 255.0).std()))


def measures() -> dict[str, Callable[[np.ndarray], dict[str, float]]]:
    """Name of a method -> its values for a picture."""
    monitor = ConditionMonitor()

    def ours(image: np.ndarray) -> dict[str, float]:
        condition = monitor.frame(image)
        sigma_dn, at_most_dn = float(condition.sigma_dn.value), float(condition.noise.at_most_dn)
        return {
            "mtf": 1.0 - float(np.nanmean(condition.mtf.value)),
            "sigma_dn": sigma_dn if np.isfinite(sigma_dn) else at_most_dn,  # without an estimate, what there is at most
        }

    def laplacian(image: np.ndarray) -> dict[str, float]:
        return {"laplacian_variance": float(cv2.Laplacian(image.astype(np.float64) * 255, cv2.CV_64F).var())}

    methods: dict[str, Callable[[np.ndarray], dict[str, float]]] = {"ours": ours, "laplacian": laplacian}
    try:
        from brisque import BRISQUE
    except ImportError:
        return methods

    class FlatBrisque(BRISQUE):
        """BRISQUE whose features, arrays of one number, are made numbers, as NumPy 2 wants them."""

        def scale_features(self, features: Any) -> Any:
            return super().scale_features([float(np.ravel(feature)[0]) for feature in features])

    index = FlatBrisque(url=False)
    methods["brisque"] = lambda image: {"brisque": float(index.score(np.repeat(image[..., None], 3, axis=2)))}
    return methods


def correlation(scenes: list[str], values: np.ndarray, truth: np.ndarray, key: str) -> dict[str, float]:
    """Spearman's rank correlation with its 95 % interval over scenes; pictures without a value count last."""
    values = np.where(np.isfinite(values), values, np.nanmax(values) + 1)
    names = sorted(set(scenes))
    rows = {name: [index for index, scene in enumerate(scenes) if scene == name] for name in names}
    draws = []
    for picks in resamples(len(names), DRAWS, stream(1, "flags bootstrap", key)):
        chosen = np.concatenate([rows[names[index]] for index in picks])
        if len(set(truth[chosen])) > 1 and len(set(values[chosen])) > 1:
            draws.append(spearmanr(values[chosen], truth[chosen]).statistic)
    rank = float(spearmanr(values, truth).statistic)
    low, high = bias_corrected(np.array(draws), rank, len(names), bounds=(-1.0, 1.0))
    return {
        "spearman": round(rank, 3),
        "low": round(float(low), 3),
        "high": round(float(high), 3),
        "pictures": len(values),
        "scenes": len(names),
    }


def measured(samples: list[Sample], methods: dict[str, Callable[[np.ndarray], dict[str, float]]]) -> dict[str, Any]:
    """Quantity -> measure -> correlation, and the time of each method per picture, ms of the processor."""
    values: dict[str, list[float]] = {}
    spent = dict.fromkeys(methods, 0.0)
    for sample in samples:
        for name, method in methods.items():
            start = time.thread_time()
            for key, value in method(sample.image).items():
                values.setdefault(key, []).append(value)
            spent[name] += time.thread_time() - start
    scenes = [sample.scene for sample in samples]
    content: dict[str, Any] = {}
    for quantity, truths in (
        ("blur", [sample.blur for sample in samples]),
        ("noise", [sample.sigma_dn for sample in samples]),
    ):
        if any(truth is None for truth in truths):
            continue
        # less variance of the Laplacian means more blur, more of it more noise
        sign = {"laplacian_variance": -1.0 if quantity == "blur" else 1.0}
        content[quantity] = {
            key: correlation(scenes, sign.get(key, 1.0) * np.array(values[key]), np.array(truths, float), quantity)
            for key in (OURS[quantity], *STAND_INS)
            if key in values
        }
    content["processor_ms_per_picture"] = {name: round(1e3 * time / len(samples), 1) for name, time in spent.items()}
    return content


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sim", type=Path, default=ROOT / "data/sim")
    parser.add_argument("--realdata", type=Path, help="folder with levin2009 and cc_noise")
    parser.add_argument("--frames", type=int, default=5, help="frames of Sim, and photographs")
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    common.hold_loaded_libraries()
    folders = {} if arguments.realdata is None else {
        name: arguments.realdata / folder
        for name, folder in FLAG_FOLDERS.items()
        if (arguments.realdata / folder).is_dir()
    }  # fmt: skip
    datasets = ["sim", "photos", *(["levin2009", "cc"] if arguments.realdata is not None else []), *folders]
    common.check_datasets("flags", datasets, arguments.out)
    from pipeline.datasets import open_dataset

    sources: dict[str, list[Sample]] = {}
    whole: dict[str, Iterable[tuple[str, np.ndarray]]] = {}
    for name, root in (("sim", arguments.sim), ("photos", None)):
        dataset = open_dataset(name, name, root)
        frames = {frame.name: centre(read_grey(frame.path)) for frame in dataset.frames()[: arguments.frames]}
        sources[name] = list(corrupted(frames))
        whole[name] = [(frame.name, read_grey8(frame.path)) for frame in dataset.frames()]
    if arguments.realdata is not None:
        sources["levin2009"] = list(levin(arguments.realdata / "levin2009"))
        sources["cc"] = list(cc(arguments.realdata / "cc_noise"))
        shaken = enumerate(sample.image for sample in sources["levin2009"])
        whole["levin2009"] = [(str(number), to_8bit(image)) for number, image in shaken]
        whole["cc"] = flag_rates.frames_below(arguments.realdata / "cc_noise")
        whole |= {name: flag_rates.frames_below(folder) for name, folder in folders.items()}
    methods = measures()
    results = {name: measured(samples, methods) for name, samples in sources.items()}
    for name, frames_of in whole.items():
        results.setdefault(name, {})["flags"] = flag_rates.rates(name, frames_of)
    print(f"{'pictures':10} {'truth':6} {'measure':20} {'Spearman':>8}  95 % interval")
    for name, content in results.items():
        for quantity in ("blur", "noise"):
            for key, row in content.get(quantity, {}).items():
                print(f"{name:10} {quantity:6} {key:20} {row['spearman']:8.2f}  {row['low']:.2f} to {row['high']:.2f}")
    for name, content in results.items():
        for condition, row in (content["flags"]["false"] | content["flags"]["true"]).items():
            print(f"{name:11} {condition:24} banded {row['banded']:6.1%}  impulses {row['impulses']:6.1%}")
    about = {
        "datasets": list(results), "blurs": [list(kind) for kind in BLURS], "noise_dn": NOISE_DN, "crop_px": CROP_PX,
        "machine": common.machine("opencv-python-headless", "brisque", "torch"),
    }  # fmt: skip
    print(f"written to {common.write('flags', {**about, 'results': results}, arguments.out)}")


if __name__ == "__main__":
    common.run(main)
