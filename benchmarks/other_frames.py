"""Blur estimators calibrated to a camera once and evaluated on other frames of it, as a user's camera would be.

    python benchmarks/other_frames.py [--calibrate NAME=KIND:ROOT --evaluate NAME=KIND:ROOT]
        [--leave-one-out NAME=KIND:ROOT ...] [--whole-frames] [--kernels FOLDER] [--frames N] [--fused-frames N]
        [--patches N] [--out FILE]

Datasets are of kinds of `pipeline.datasets`, e.g. ``kitti=kitti:data/raw/kitti``. Those of --calibrate and --evaluate
are of one camera and share no frame: the calibration has all sharp frames of the first, and the frames of the second
are evaluated. Of a camera with few frames, --leave-one-out evaluates each frame with the calibration to all others.
Frames that follow each other show much the same scene, which flatters; Table I therefore cross-fits, each half of the
frames with the calibration to the other half. Patches are those over labelled objects; with --whole-frames a camera is
calibrated to tiles all over its sharp frames, which shows how much it matters what they show. The frames evaluated are
blurred

    table_one   by the kernels of Table I: those of the paper, in FOLDER (`pipeline.camera.psf.paper_kernels`), or
                generated ones like them (``match="paper"``)
    noisy       by discs and lines like the paper's, then with dark-current shot noise of 25 DN
    optics      by rendered optics (benchmarks/rendered_psf.py), none of which a network was trained on; spectral only

Errors are AMAE of the robust median over the patches, percent, mean over kernels; ``patch_error_percent`` is of single
patches, ``coverage`` that of their 95 % intervals.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks import common  # noqa: E402

common.one_thread()

import numpy as np  # noqa: E402

from benchmarks import mean_amae, rendered_psf  # noqa: E402
from benchmarks.noisy_blur import KINDS as NOISY_KINDS  # noqa: E402
from benchmarks.noisy_blur import SOURCE as NOISE_SOURCE  # noqa: E402
from benchmarks.noisy_blur import table_one_samples  # noqa: E402
from benchmarks.unseen_kernels import configuration, indexed  # noqa: E402
from pipeline import blur  # noqa: E402
from pipeline.camera.psf import paper_kernels  # noqa: E402
from pipeline.camera.psf.bank import bank  # noqa: E402
from pipeline.condition.structure import structureless  # noqa: E402
from pipeline.datasets.patches import BLUR_PX, cut, tiles  # noqa: E402
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
    from pipeline.experiments.frames import TestFrame

SIGMA_DN = 25.0


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
    """Mean errors over the cells of blurred frames: of Table I by kind and size, else by kind or by kernel.

    Those of the AMAE have their 95 % interval over frames.
    """
    blurred = table[table["kernel"] != SHARP]
    if name == "optics":  # each kernel is a cell of its own
        blurred = blurred.assign(blur_kind=blurred["kernel"])
    cells = table_one.summarise(blurred, seed, 0, calibrated=True)
    kinds = cells["blur_kind"].unique() if name == "noisy" else ()
    parts = {"mean": (cells, blurred)}
    parts |= {str(kind): tuple(rows[rows["blur_kind"] == kind] for rows in (cells, blurred)) for kind in kinds}
    result: dict[str, Any] = {"cells": len(cells)}
    for part, (means, rows) in parts.items():
        purpose = (str(rows["dataset"].iloc[0]), str(rows["estimator"].iloc[0]), name, part)
        result[part] = mean_amae.mean_errors(means, rows, seed, purpose)
    return result


@dataclass(frozen=True)
class Camera:
    """A camera to calibrate to.

    Attributes:
        calibrated_on, evaluated_on: names of the datasets; the same one where every frame is left out once.
        calibrations: sharp frames of each calibration, with all their patches.
        frames: to be evaluated, each with the number of its calibration as its fold.
    """

    calibrated_on: str
    evaluated_on: str
    calibrations: Sequence[Sequence[TestFrame]]
    frames: Sequence[TestFrame]


def other_dataset(config: Config, first: str, second: str, patches: int) -> Camera:
    """Calibrated to the frames of one dataset, evaluated on those of another.

    Raises:
        InputError: they share a frame.
    """
    (_, sharp), (work, every) = (indexed(config, name, patches) for name in (first, second))
    shared = {item.frame.name for item in sharp} & {item.frame.name for item in every}
    if shared:
        raise InputError(f"--evaluate {second}: shares the frame {min(shared)} with {first}; give other frames")
    return Camera(first, second, [sharp], work)


def leave_one_out(config: Config, name: str, patches: int) -> Camera:
    """Each frame of a dataset evaluated with the calibration to all its other frames.

    Raises:
        InputError: fewer than two frames.
    """
    work, every = indexed(config, name, patches)
    if len(every) < 2:
        raise InputError(f"--leave-one-out {name}: {len(every)} usable frame; expected at least two")
    others = [[item for item in every if item.frame.name != left.frame.name] for left in work]
    return Camera(name, name, others, [replace(item, fold=number) for number, item in enumerate(work)])


def over_the_frame(sharp: TestFrame) -> TestFrame:
    """A sharp frame with tiles all over it, but those without structure, in place of its patches.

    Raises:
        InputError: none has structure.
    """
    image = np.asarray(sharp.frame.image())
    squares = tiles(image.shape, BLUR_PX, "cover")
    left_out = structureless(cut(image, squares))
    kept = [square for square, without in zip(squares, left_out, strict=True) if not without]
    if not kept:
        raise InputError(f"{sharp.frame.path}: no tile with structure to calibrate to; leave the frame out")
    return replace(sharp, patches={**sharp.patches, "mtf": kept})


def measure(camera: Camera, config: Config, kernels: Path | None, frames: Mapping[str, int]) -> dict[str, Any]:
    """Both estimators on a camera, for the record.

    Args:
        camera: to calibrate to.
        config: of the study.
        kernels: folder of the paper's own, or None for generated ones.
        frames: estimator -> at most this many to evaluate on.
    """
    tried, estimators = conditions(config, kernels), dict[str, Any]()
    for estimator, count in frames.items():
        evaluated_on = evenly_spread(camera.frames, count)
        registered, folds = Registered(blur.create, estimator), dict[int, calibrate.Calibrated]()
        for fold in sorted({item.fold for item in evaluated_on}):
            sharp, samples = camera.calibrations[fold], table_one_samples(config)
            fitted = calibrate.fit_frames(sharp, estimator=registered, samples=samples, seed=config.seed)
            folds[fold] = calibrate.Calibrated(registered, fitted)
        numbers = list(folds)
        chosen = [replace(item, fold=numbers.index(item.fold)) for item in evaluated_on]
        method = Method(estimator, "mtf", registered, of_folds=tuple(folds.values()))
        results = estimators[estimator] = {"frames": len(chosen), "patches": _patches(chosen)}
        for name, (under, evaluated) in tried.items():
            if estimator in evaluated:
                table = run(chosen, under, [method], camera=config.camera, seed=config.seed)
                results[name] = errors(name, table, config.seed)
                print(camera.evaluated_on, estimator, name, results[name], flush=True)
    least = min(camera.calibrations, key=_patches)
    return {
        "calibrated_on": {"dataset": camera.calibrated_on, "frames": len(least), "patches": _patches(least)},
        "evaluated_on": {"dataset": camera.evaluated_on},
        "estimators": estimators,
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Calibrate, blur, estimate, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--calibrate", metavar="NAME=KIND:ROOT", help="sharp frames of a camera")
    parser.add_argument("--evaluate", metavar="NAME=KIND:ROOT", help="other frames of it")
    parser.add_argument(
        "--leave-one-out", action="append", default=[], metavar="NAME=KIND:ROOT", help="may be repeated"
    )
    parser.add_argument("--whole-frames", action="store_true", help="calibrate to tiles all over the sharp frames")
    parser.add_argument("--kernels", type=Path, help="folder of the paper's own kernels")
    parser.add_argument("--frames", type=int, default=49, help="at most this many to evaluate on, evenly spread")
    parser.add_argument("--fused-frames", type=int, default=16, help="the same for fused, which takes a minute a frame")
    parser.add_argument("--patches", type=int, default=4, help="at most this many of each frame")
    parser.add_argument("--out", type=Path, help="JSON file, by default benchmarks/results/other_frames.json")
    options = parser.parse_args(arguments)
    pair = [text for text in (options.calibrate, options.evaluate) if text]
    if len(pair) == 1 or not (pair or options.leave_one_out):
        raise InputError("no camera; give --calibrate together with --evaluate, or --leave-one-out, or all three")
    if options.whole_frames and options.out is None:
        raise InputError("--whole-frames: the record is of labelled objects; give --out FILE as well")
    common.hold_loaded_libraries()
    given = [*pair, *options.leave_one_out]
    datasets = [common.dataset(text)[0] for text in given]
    common.check_datasets("other_frames", datasets, options.out)
    config = configuration(given)
    cameras = [leave_one_out(config, common.dataset(text)[0], options.patches) for text in options.leave_one_out]
    if pair:
        first, second = (common.dataset(text)[0] for text in pair)
        cameras.insert(0, other_dataset(config, first, second, options.patches))
    if options.whole_frames:
        cameras = [
            replace(one, calibrations=[[over_the_frame(item) for item in sharp] for sharp in one.calibrations])
            for one in cameras
        ]
    counts = {"spectral": options.frames, "fused": options.fused_frames}
    frames = {estimator: count for estimator, count in counts.items() if count}
    record = {
        "datasets": datasets,
        "kernels": "generated" if options.kernels is None else "paper",
        "noise_source": NOISE_SOURCE,
        "sigma_dn": SIGMA_DN,
        "seed": config.seed,
        **({"calibrated_over": "whole frames"} if options.whole_frames else {}),
        "cameras": [measure(camera, config, options.kernels, frames) for camera in cameras],
    }
    print(common.write("other_frames", record, options.out))


def _patches(frames: Sequence[Any]) -> int:
    return sum(len(item.patches["mtf"]) for item in frames)


if __name__ == "__main__":
    common.run(main)
