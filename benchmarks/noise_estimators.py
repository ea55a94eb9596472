"""Time per 128 x 128 px patch of the noise estimators, beside peers that are installed.

Usage::

    python benchmarks/noise_estimators.py [--out FILE] [--repeats N]

One thread. Outputs are compared before anything is timed: PCA with deepinv's, the wavelet estimate with scikit-image's.
Times are the least and the median of the repeats, for one patch at a time and for a batch of 64. ``ratio`` is the
peer's least time over ours for the same method; below 1 we lose. ``recorded`` holds times of the paper's own program,
measured elsewhere on another machine: orders of magnitude, not a race.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks import common  # noqa: E402

common.one_thread()

import numpy as np  # noqa: E402

from pipeline import noise  # noqa: E402
from pipeline.streams import stream  # noqa: E402

BATCH = 64
SIGMA_DN = 10.0
RECORDED_MS = {
    "paper's PCA program, KITTI / Sim / Udacity, with decoding": [1.80, 1.60, 2.69],
    "paper's B+F program, KITTI / Sim / Udacity, with decoding": [2.69, 2.31, 2.60],
    "paper's PCA program, one patch": 0.68,
    "paper's B+F program, one patch": 1.18,
}


def patches() -> np.ndarray:
    """Waves and edges with white noise of 10 DN, rounded to 8 bit: (64, 1, 128, 128) float32 in [0, 1]."""
    rows, columns = np.mgrid[:128, :128]
    draw = stream(0, "noise benchmark")
    clean = 128 + 30 * np.sin(columns / 3.0) * np.cos(rows / 5.0) + 25 * (columns > 60) * (rows > 40)
    noisy = clean + draw.normal(0.0, SIGMA_DN, (BATCH, 1, 128, 128))
    return (np.rint(np.clip(noisy, 0, 255)) / 255).astype(np.float32)


Estimate = Callable[[np.ndarray], np.ndarray]


def timed(implementations: dict[str, Estimate], batch: np.ndarray, repeats: int) -> dict[str, dict[str, float]]:
    """Least and median time per patch of each, ms; they take turns, so that a busy moment hits all alike."""
    calls = {name: partial(estimate, batch) for name, estimate in implementations.items()}
    return {
        name: {measure: round(times[measure] / len(batch), 5) for measure in ("least_ms", "median_ms")}
        for name, times in common.take_turns(calls, repeats).items()
    }


def peers() -> dict[str, tuple[str, Estimate]]:
    """Installed peers: name -> (our estimator of the same method, function of a batch giving sigma in DN)."""
    from skimage.restoration import estimate_sigma

    results: dict[str, tuple[str, Estimate]] = {
        "scikit-image estimate_sigma": (
            "wavelet",
            lambda batch: np.array([255 * estimate_sigma(patch[0]) for patch in batch]),
        )
    }
    try:
        import torch
        from deepinv.models import PatchCovarianceNoiseEstimator
    except ImportError as error:
        print(f"deepinv: not run ({error})")
        return results
    network = PatchCovarianceNoiseEstimator()
    results["deepinv PatchCovarianceNoiseEstimator"] = (
        "pca",
        lambda batch: 255 * network(torch.from_numpy(batch)).numpy(),
    )
    return results


def main() -> None:
    """Compare, time, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, help="JSON file, by default benchmarks/results/noise_estimators.json")
    parser.add_argument("--repeats", type=common.positive, default=100)
    arguments = parser.parse_args()
    common.hold_loaded_libraries()
    batch = patches()
    estimators = {name: noise.create(name) for name in ("pca", "bf", "wavelet", "immerkaer")}
    implementations: dict[str, Estimate] = {
        name: (lambda part, e=estimator: e.estimate(part).sigma_dn)  # type: ignore[misc]
        for name, estimator in estimators.items()
    }
    same_method: dict[str, str] = {}
    for peer, (name, estimate) in peers().items():
        difference = float(np.abs(estimate(batch) - implementations[name](batch)).max())
        if difference > 1e-3:
            raise SystemExit(f"{peer} and {name} differ by {difference:.4g} DN: nothing to compare")
        implementations[peer], same_method[peer] = estimate, name
    one = timed(implementations, batch[:1], arguments.repeats)
    many = timed(implementations, batch, max(3, arguments.repeats // 10))
    results: dict[str, dict[str, Any]] = {}
    for name, estimate in implementations.items():
        sigma_dn = round(float(np.median(estimate(batch))), 4)
        results[name] = {"sigma_dn": sigma_dn, "one_patch": one[name], "batch_of_64": many[name]}
        if name in same_method:
            results[name]["ratio"] = {
                "to": same_method[name],
                "one_patch": round(one[name]["least_ms"] / one[same_method[name]]["least_ms"], 2),
                "batch_of_64": round(many[name]["least_ms"] / many[same_method[name]]["least_ms"], 2),
            }
        print(
            f"{name:40s} {sigma_dn:7.3f} DN   one {one[name]['least_ms']:.4f} ms"
            f"   in 64 {many[name]['least_ms']:.4f} ms   {results[name].get('ratio', '')}"
        )
    record = {"patch": "128 x 128 px", "true_sigma_dn": SIGMA_DN, "results": results, "recorded_ms": RECORDED_MS}
    about = common.machine("opencv-python-headless", "scikit-image")
    print(f"written to {common.write('noise_estimators', {'machine': about, **record}, arguments.out)}")


if __name__ == "__main__":
    common.run(main)
