"""Blur estimators, calibrated to the camera, on frames that are blurred and then under strong noise.

    python benchmarks/noisy_blur.py [--dataset NAME=KIND:ROOT ...] [--sigma DN] [--patches N] [--out FILE]

Frames of scikit-image's photographs, and of the datasets named (kinds of `pipeline.datasets`, e.g.
``kitti=kitti:data/raw/kitti``), are blurred whole by the discs and lines of Table I (``match="paper"``), with dark
current shot noise behind the blur. The AMAE is that of Table I: of the robust median over a dataset's patches,
percent, mean over sizes, with its 95 % interval over frames. Each half of the frames is estimated with the calibration
to the sharp frames of the other half. A call holds the patches of one frame.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks import common  # noqa: E402

common.one_thread()

from benchmarks import mean_amae  # noqa: E402
from benchmarks.unseen_kernels import configuration, indexed  # noqa: E402
from pipeline import blur  # noqa: E402
from pipeline.camera.psf.bank import bank  # noqa: E402
from pipeline.experiments import calibrate, table_one  # noqa: E402
from pipeline.experiments.condition import grid  # noqa: E402
from pipeline.experiments.run import Method, Registered, run  # noqa: E402

if TYPE_CHECKING:
    from pipeline.config.schema import Config

ESTIMATORS = ("spectral", "fused")
KINDS = ("defocus", "linear_motion")
SOURCE = "dcsn"


def measure(config: Config, name: str, estimator: str, sigma_dn: float, patches: int) -> dict[str, Any]:
    """One estimator on one dataset: AMAE by kind of blur and its mean over single patches, percent; coverage."""
    work, every = indexed(config, name, patches)
    folds = calibrate.folds(len(work))
    registered = Registered(blur.create, estimator)
    maps = calibrate.cross_fit(every, registered, samples=table_one_samples(config), seed=config.seed)
    method = Method(estimator, "mtf", registered, of_folds=tuple(calibrate.Calibrated(registered, one) for one in maps))
    folded = [replace(item, fold=fold) for item, fold in zip(work, folds, strict=True)]
    conditions = grid(bank(KINDS, seed=config.seed, match="paper"), [SOURCE], [sigma_dn])
    table = run(folded, conditions, [method], camera=config.camera, seed=config.seed)
    cells = table_one.summarise(table, config.seed, 0, calibrated=True)
    return {
        "frames": len(work),
        "patches": sum(len(item.patches["mtf"]) for item in work),
        "abstained": int(cells["abstained"].sum()),
        **{
            str(kind): mean_amae.mean_errors(
                cells[cells["blur_kind"] == kind], rows, config.seed, (name, estimator, str(kind))
            )
            for kind, rows in table.groupby("blur_kind")
        },
    }


def table_one_samples(config: Config) -> int:
    """Blurred patches that Table I calibrates on."""
    samples = config.blur.estimators["camera_calibrated"].calibration_samples
    assert samples is not None
    return samples


def main(arguments: Sequence[str] | None = None) -> None:
    """Blur, add noise, estimate, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dataset", action="append", default=[], metavar="NAME=KIND:ROOT", help="may be repeated")
    parser.add_argument("--sigma", type=float, default=25.0, metavar="DN", help="of the noise")
    parser.add_argument("--patches", type=int, default=4, help="at most this many of each frame")
    parser.add_argument("--out", type=Path, help="JSON file, by default benchmarks/results/noisy_blur.json")
    options = parser.parse_args(arguments)
    common.hold_loaded_libraries()
    config = configuration(options.dataset)
    common.check_datasets("noisy_blur", config.datasets, options.out)
    results: dict[str, Any] = {}
    for name in config.datasets:
        results[name] = {}
        for estimator in ESTIMATORS:
            results[name][estimator] = measure(config, name, estimator, options.sigma, options.patches)
            print(name, estimator, results[name][estimator], flush=True)
    record = {
        "datasets": list(results),
        "noise_source": SOURCE,
        "sigma_dn": options.sigma,
        "seed": config.seed,
        "patches_per_frame": options.patches,
        "results": results,
    }
    print(common.write("noisy_blur", record, options.out))


if __name__ == "__main__":
    common.run(main)
