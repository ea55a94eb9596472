"""Seconds and accuracy per 192 x 192 px patch of the blind deconvolution estimators, exact and fast.

    python benchmarks/blind_deconvolution.py [--out FILE] [--photographs N] [--kernels all|few] [--kernel-size 31]
                                             [--repeats N]

Every patch of a photograph (scikit-image's, which no estimator was made with) is blurred by known kernels, rounded to
8 bits, and deconvolved in both modes, which take turns. Times are processor times of one thread: ``least_s`` over
all patches, ``median_s`` over patches of the least of the repeats. ``published_s`` is what the paper reports for the
original programs, on its authors' machine; ``times_published`` is that over our median, ``times_exact`` compares our
two modes in the same run. No other implementation installs from a package registry, so there is no peer to race.
Accuracy is the AMAE in percent: per kernel, of the median over photographs, then averaged over kernels.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks import common  # noqa: E402

common.one_thread()

import numpy as np  # noqa: E402
import pandas as pd  # noqa: E402

from pipeline import blur  # noqa: E402
from pipeline.camera import mtf, psf  # noqa: E402
from pipeline.camera.blur import blur as blurred  # noqa: E402
from pipeline.statistics import inliers  # noqa: E402

ESTIMATORS = ("pmp", "gbb")
MODES = ("exact", "fast")
PATCH_PX, MARGIN_PX = 192, 24
# name of scikit-image's photograph, top left corner of the patch: textured and structured parts
PHOTOGRAPHS = (
    ("camera", 100, 150),
    ("coins", 30, 100),
    ("astronaut", 60, 150),
    ("coffee", 100, 200),
    ("rocket", 150, 250),
    ("camera", 250, 60),
    ("astronaut", 280, 200),
    ("stereo_motorcycle", 200, 300),
    ("coffee", 30, 60),
    ("stereo_motorcycle", 150, 60),
)
FEW = (("defocus", 7), ("defocus", 15), ("linear_motion", 11), ("nonlinear_motion", 15))


def photograph(name: str, top: int, left: int) -> np.ndarray:
    """A grey patch with margins, float32 in [0, 1]."""
    from skimage import color, data

    image = getattr(data, name)()
    image = image[0] if isinstance(image, tuple) else image
    grey = color.rgb2gray(image) if image.ndim == 3 else image / 255
    rows = slice(top - MARGIN_PX, top + PATCH_PX + MARGIN_PX)
    return grey[rows, left - MARGIN_PX : left + PATCH_PX + MARGIN_PX].astype(np.float32)


def robust_amae(estimates: np.ndarray, truth: np.ndarray) -> float:
    """AMAE in percent of the outlier-free median of (N, 2, 8) estimates."""
    median = np.empty_like(truth)
    for index in np.ndindex(truth.shape):
        values = estimates[(slice(None), *index)]
        median[index] = np.median(values[inliers(values)])
    return float(mtf.amae(median, truth))


def measure(kernels: list[psf.Kernel], scenes: list[np.ndarray], size: int, repeats: int) -> dict[str, Any]:
    """Both estimators in both modes on every scene and kernel: name -> mode -> times and accuracy."""
    makers = {(name, mode): blur.create(name, mode=mode, kernel_size=size) for name in ESTIMATORS for mode in MODES}
    taken: dict[tuple[str, str], list[float]] = {key: [] for key in makers}
    amae: dict[tuple[str, str], list[float]] = {key: [] for key in makers}
    inside = slice(MARGIN_PX, -MARGIN_PX)
    for kernel in kernels:
        answers: dict[tuple[str, str], list[np.ndarray]] = {key: [] for key in makers}
        for scene in scenes:
            patch = np.rint(blurred(scene, kernel.psf)[inside, inside] * 255) / np.float32(255)
            for key, estimator in makers.items():
                seconds = []
                for _ in range(1 if key[1] == "exact" else repeats):
                    start = time.thread_time()
                    estimate = estimator.estimate(patch[None, None])
                    seconds.append(time.thread_time() - start)
                taken[key].append(min(seconds))
                answers[key].append(estimate.mtf[0])
        for key, found_mtf in answers.items():
            amae[key].append(robust_amae(np.stack(found_mtf), mtf.sample(kernel.psf)))
        print(kernel.name, {"/".join(key): round(values[-1], 2) for key, values in amae.items()}, flush=True)
    published = pd.read_csv(ROOT / "data/paper/runtime.csv").set_index("estimator")["seconds"]
    results: dict[str, Any] = {}
    for name in ESTIMATORS:
        exact_s = float(np.median(taken[name, "exact"]))
        results[name] = {"published_s": float(published[name])}
        for mode in MODES:
            median_s = float(np.median(taken[name, mode]))
            results[name][mode] = {
                "least_s": round(min(taken[name, mode]), 4),
                "median_s": round(median_s, 4),
                "times_published": round(float(published[name]) / median_s, 1),
                "times_exact": round(exact_s / median_s, 1),
                "amae_percent": round(float(np.mean(amae[name, mode])), 2),
                "amae_percent_per_kernel": {
                    kernel.name: round(value, 2) for kernel, value in zip(kernels, amae[name, mode], strict=True)
                },
            }
    return results


def main() -> None:
    """Blur, deconvolve, time, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--photographs", type=int, default=3)
    parser.add_argument("--kernels", choices=("few", "all"), default="few")
    parser.add_argument("--kernel-size", type=int, default=31)
    parser.add_argument("--repeats", type=int, default=3)
    arguments = parser.parse_args()
    common.hold_loaded_libraries()
    bank = psf.bank(angles_deg=(0.0, 45.0)) if arguments.kernels == "all" else psf.bank(angles_deg=(45.0,))
    if arguments.kernels == "few":
        bank = [kernel for kernel in bank if (kernel.kind, kernel.size_px) in FEW]
    scenes = [photograph(*where) for where in PHOTOGRAPHS[: arguments.photographs]]
    results = measure(bank, scenes, arguments.kernel_size, arguments.repeats)
    for name, record in results.items():
        for mode in MODES:
            row = record[mode]
            print(
                f"{name} {mode:5s} {row['median_s']:.3f} s (published {record['published_s']} s: "
                f"{row['times_published']}x)   AMAE {row['amae_percent']:.2f} %"
            )
    record = {
        "machine": common.machine("scikit-image"),
        "patch": f"{PATCH_PX} x {PATCH_PX} px",
        "kernel_size": arguments.kernel_size,
        "photographs": len(scenes),
        "kernels": [kernel.name for kernel in bank],
        "results": results,
    }
    print(common.write("blind_deconvolution", record, arguments.out))


if __name__ == "__main__":
    common.run(main)
