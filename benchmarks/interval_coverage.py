"""Share of true MTF values that 95 % intervals of the blur estimators hold, on procedural pictures.

    python benchmarks/interval_coverage.py [--samples N] [--fused N] [--out FILE]

Pictures, kernels (with irises, halos and rendered lenses), lens and noise are drawn as for the networks' training,
from other random streams; every second picture has noise of 0 to 25 DN. ``raw`` is the total MTF of N pictures.
``calibrated`` is the MTF relative to the sharp frames of procedural cameras, each with one lens, whose estimator is
calibrated on other pictures than it is measured on. ``fused`` is the total MTF of the fused estimator on the first of
the pictures.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks import common  # noqa: E402

common.one_thread()

import numpy as np  # noqa: E402

from pipeline import blur  # noqa: E402
from pipeline.blur.base import PATCH_PX, BlurEstimate  # noqa: E402
from pipeline.blur.fusion import samples as fusion_samples  # noqa: E402
from pipeline.blur.settings import FusionRecipe  # noqa: E402
from pipeline.camera import mtf  # noqa: E402
from pipeline.camera.blur import blur as convolve  # noqa: E402
from pipeline.camera.psf.gaussian import gaussian  # noqa: E402
from pipeline.learning import images, kernels  # noqa: E402
from pipeline.streams import stream  # noqa: E402

SEED = 11
LENSES_PX = (0.0, 0.35, 0.7)
SHARP_PATCHES, TEST_PATCHES = 24, 40
RECIPE = replace(FusionRecipe(), largest_mean_mtf=1.0, seed=SEED)


def coverage(estimate: BlurEstimate, truth: np.ndarray) -> float:
    """Percent of the values of patches that were measured."""
    assert estimate.low is not None and estimate.high is not None
    inside = (estimate.low <= truth) & (truth <= estimate.high)
    return 100 * float(inside[~estimate.abstained].mean())


def measured(estimator: Any, count: int) -> dict[str, float]:
    """Coverage of total MTFs on procedural samples, all and by noise."""
    samples = [fusion_samples.blurred(RECIPE, index) for index in range(count)]
    estimates = [estimator.estimate(one.patch[None, None].astype(np.float32) / np.float32(255)) for one in samples]
    values = np.array([coverage(each, one.mtf) for each, one in zip(estimates, samples, strict=True)])
    clean = np.array([one.sigma_dn == 0 for one in samples])
    parts = {"": np.ones(count, bool), "_clean": clean, "_noisy": ~clean}
    return {f"coverage{name}_percent": round(float(np.nanmean(values[kept])), 2) for name, kept in parts.items()}


def calibrated() -> dict[str, float]:
    """Coverage of relative MTFs, for procedural cameras of three lenses."""
    results = {}
    for number, lens_px in enumerate(LENSES_PX):
        count = SHARP_PATCHES + TEST_PATCHES
        pictures = [images.picture(number * count + index, SEED, "coverage image") for index in range(count)]
        generators = [stream(SEED, "coverage", number, index) for index in range(count)]
        views = [images.view(each, g, PATCH_PX, 0.7) for each, g in zip(pictures, generators, strict=True)]
        sharp = np.stack(views)[:, None].clip(0, 1)
        sharp = convolve(sharp, gaussian(lens_px)) if lens_px else sharp
        estimator = blur.create("spectral").calibrated(np.rint(sharp[:SHARP_PATCHES] * 255) / 255)
        bank = kernels.block(number, SEED, "coverage kernels", TEST_PATCHES, "with_optics")
        bank = bank / bank.sum((1, 2), keepdims=True)
        seen = np.rint(convolve(sharp[SHARP_PATCHES:], bank).clip(0, 1) * 255) / 255
        estimate = estimator.estimate(seen.astype(np.float32))
        results[f"lens_{lens_px:g}_px_percent"] = round(coverage(estimate, np.asarray(mtf.sample(bank))), 2)
    return {"coverage_percent": round(float(np.mean(list(results.values()))), 2), **results}


def main() -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=int, default=600)
    parser.add_argument("--fused", type=int, default=150, help="samples for the fused estimator")
    parser.add_argument("--out", type=Path, help="JSON file, by default benchmarks/results/interval_coverage.json")
    arguments = parser.parse_args()
    common.hold_loaded_libraries()
    results = {
        "raw": measured(blur.create("spectral"), arguments.samples),
        "calibrated": calibrated(),
        "fused": measured(blur.create("fused"), arguments.fused),
    }
    for name, values in results.items():
        print(name, values, flush=True)
    record = {"nominal_percent": 95, "samples": arguments.samples, "fused_samples": arguments.fused, "results": results}
    print(common.write("interval_coverage", record, arguments.out))


if __name__ == "__main__":
    common.run(main)
