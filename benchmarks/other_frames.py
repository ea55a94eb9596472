"""Blur estimators calibrated to a camera once and evaluated on other frames of it, as a user's camera would be.

    python benchmarks/other_frames.py --calibrate NAME=KIND:ROOT --evaluate NAME=KIND:ROOT [--kernels FOLDER]
        [--frames N] [--fused-frames N] [--patches N] [--out FILE]

Both datasets (kinds of `pipeline.datasets`, e.g. ``kitti=kitti:data/raw/kitti``) are of one camera and share no frame.
Table I cross-fits: each half of a few frames is evaluated with the calibration to the other half. Here the calibration
has all sharp frames of one dataset, and the frames of the other are blurred

    table_one   by the kernels of Table I: the paper's own, in FOLDER (`pipeline.camera.paper_kernels`), or generated
                ones like them (``match="paper"``)
    noisy       by discs and lines like the paper's, then with dark-current shot noise of 25 DN
    optics      by rendered optics (benchmarks/rendered_psf.py), which no network was trained on; spectral only

Errors are AMAE of the robust median over the patches, percent, mean over kernels; ``patch_error_percent`` is of single
patches, ``coverage`` that of their 95 % intervals.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks import common  # noqa: E402

common.one_thread()

from benchmarks import rendered_psf  # noqa: E402
from benchmarks.noisy_blur import KINDS as NOISY_KINDS  # noqa: E402
from benchmarks.noisy_blur import SOURCE as NOISE_SOURCE  # noqa: E402
from benchmarks.noisy_blur import table_one_samples  # noqa: E402
from benchmarks.unseen_kernels import configuration, indexed  # noqa: E402
from pipeline import blur  # noqa: E402
from pipeline.camera import paper_kernels  # noqa: E402
from pipeline.camera.psf.bank import bank  # noqa: E402
from pipeline.datasets.selection import evenly_spread  # noqa: E402
from pipeline.errors import InputError  # noqa: E402
from pipeline.experiments import calibrate, table_one  # noqa: E402
from pipeline.experiments.condition import SHARP, grid, sharp_kernel  # noqa: E402
from pipeline.experiments.run import Method, Registered, run  # noqa: E402

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.camera.psf.kernel import Kernel
    from pipeline.config.schema import Config
    from pipeline.experiments.condition import Condition

SIGMA_DN = 25.0
MEASURES = ["amae_percent", "patch_error_percent", "coverage"]


def conditions(config: Config, kernels: Path | None) -> dict[str, tuple[Sequence[Condition], tuple[str, ...]]]:
    """Name -> conditions, and the estimators that are evaluated under them."""
    psf = config.psf
    paper: Sequence[Kernel]
    if kernels is None:
        paper = bank(psf.kinds, psf.sizes_px, psf.angles_deg, config.seed, match="paper")
    else:
        paper = paper_kernels.load(kernels, kinds=psf.kinds, sizes_px=psf.sizes_px, angles_deg=psf.angles_deg)
    noisy = bank(NOISY_KINDS, seed=config.seed, match="paper")
    both = ("spectral", "fused")
    return {
        "table_one": (grid([sharp_kernel(), *paper]), both),
        "noisy": (grid(noisy, [NOISE_SOURCE], [SIGMA_DN]), both),
        "optics": (grid(rendered_psf.bank(config.seed)), ("spectral",)),
    }


def errors(name: str, table: pd.DataFrame, seed: int) -> dict[str, Any]:
    """Mean errors over the cells of blurred frames: of Table I by kind and size, else by kind or by kernel."""
    blurred = table[table["kernel"] != SHARP]
    if name == "optics":  # each kernel is a cell of its own
        blurred = blurred.assign(blur_kind=blurred["kernel"])
    cells = table_one.summarise(blurred, seed, 0, calibrated=True)
    groups = {str(kind): part for kind, part in cells.groupby("blur_kind")} if name == "noisy" else {}
    means = {kind: part[MEASURES].mean().round(4).to_dict() for kind, part in {"mean": cells, **groups}.items()}
    return {"cells": len(cells), **means}


def main(arguments: Sequence[str] | None = None) -> None:
    """Calibrate, blur, estimate, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--calibrate", required=True, metavar="NAME=KIND:ROOT")
    parser.add_argument("--evaluate", required=True, metavar="NAME=KIND:ROOT")
    parser.add_argument("--kernels", type=Path, help="folder of the paper's own kernels")
    parser.add_argument("--frames", type=int, default=49, help="at most this many to evaluate on, evenly spread")
    parser.add_argument("--fused-frames", type=int, default=16, help="the same for fused, which takes a minute a frame")
    parser.add_argument("--patches", type=int, default=4, help="at most this many of each frame")
    parser.add_argument("--out", type=Path, help="JSON file, by default benchmarks/results/other_frames.json")
    options = parser.parse_args(arguments)
    common.hold_loaded_libraries()
    config = configuration([options.calibrate, options.evaluate])
    first, second = (common.dataset(text)[0] for text in (options.calibrate, options.evaluate))
    (_, sharp), (work, every) = (indexed(config, name, options.patches) for name in (first, second))
    shared = {item.frame.name for item in sharp} & {item.frame.name for item in every}
    if shared:
        raise InputError(f"--evaluate {second}: shares the frame {min(shared)} with {first}; give other frames")
    tried, estimators = conditions(config, options.kernels), dict[str, Any]()
    for estimator, count in (("spectral", options.frames), ("fused", options.fused_frames)):
        evaluated_on = evenly_spread(work, count)
        registered = Registered(blur.create, estimator)
        fitted = calibrate.fit_frames(sharp, estimator=registered, samples=table_one_samples(config), seed=config.seed)
        method = Method(estimator, "mtf", calibrate.Calibrated(registered, fitted))
        results = estimators[estimator] = {"frames": len(evaluated_on), "patches": _patches(evaluated_on)}
        for name, (under, evaluated) in tried.items():
            if estimator in evaluated:
                table = run(evaluated_on, under, [method], camera=config.camera, seed=config.seed)
                results[name] = errors(name, table, config.seed)
                print(estimator, name, results[name], flush=True)
    record = {
        "calibrated_on": {"dataset": first, "frames": len(sharp), "patches": _patches(sharp)},
        "evaluated_on": {"dataset": second},
        "kernels": "generated" if options.kernels is None else "paper",
        "noise_source": NOISE_SOURCE,
        "sigma_dn": SIGMA_DN,
        "seed": config.seed,
        "estimators": estimators,
    }
    print(common.write("other_frames", record, options.out))


def _patches(frames: Sequence[Any]) -> int:
    return sum(len(item.patches["mtf"]) for item in frames)


if __name__ == "__main__":
    common.run(main)
