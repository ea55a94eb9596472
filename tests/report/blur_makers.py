"""Small synthetic outputs of the stage `blur`, written as that stage writes them."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pandas as pd
from report_makers import picture

from pipeline import store, tables
from pipeline.camera import mtf
from pipeline.camera.psf import stored
from pipeline.camera.psf.defocus import create as defocus
from pipeline.camera.psf.kernel import Kernel
from pipeline.camera.psf.linear_motion import create as motion
from pipeline.experiments.calibrate import divided_by_sharp
from pipeline.experiments.condition import SHARP, sharp_kernel
from pipeline.experiments.table_one import summarise
from pipeline.experiments.tables import BLUR_ESTIMATES, BLUR_SUMMARY, measurements_of
from pipeline.report.inputs import ReportInputs
from pipeline.streams import stream

# What each made-up estimator reads: a bias of its own on top of the camera's MTF, and whether it has kernels.
BIAS = {"spectral": 0.01, "pmp": 0.06, "gbb": -0.08, "cnn": 0.03}
WITH_KERNEL = ("pmp", "gbb")
SIZES = (3, 7, 11, 15, 21)


def bank(sizes: tuple[int, ...] = SIZES) -> list[Kernel]:
    """Discs, lines and crooked lines; motion in two rotations."""
    made = [Kernel(f"defocus_{size}", "defocus", size, 0.0, defocus(float(size))) for size in sizes]
    for kind in ("linear_motion", "nonlinear_motion"):
        for size in sizes:
            for angle in (0, 90):
                psf = np.asarray(motion(float(size), angle), dtype=float)
                if kind == "nonlinear_motion":  # bent: the second half of the track turned back
                    psf = np.pad(psf, 2) + np.pad(np.tril(np.rot90(psf)), 2)
                made.append(Kernel(f"{kind}_{size}_{angle}", kind, size, float(angle), psf / psf.sum()))
    return made


def make_blur(
    folder: Path,
    dataset: str,
    estimator: str,
    kernels: list[Kernel],
    *,
    frames: int = 2,
    patches: int = 4,
    abstained: int = 1,
) -> None:
    """Estimates, their summaries and, for estimators with kernels, the gallery of one dataset and estimator.

    Every answer is the camera's own MTF times the kernel's, plus the estimator's bias and a little scatter; the first
    ``abstained`` patches of the last frame are refused as flat.
    """
    generator = stream(0, "blur", dataset, estimator)
    camera = np.exp(-0.6 * mtf.FREQUENCIES)
    rows, entries, arrays = [], [], {}
    for kernel in [sharp_kernel(), *kernels]:
        truth = mtf.sample(kernel.psf)
        for number in range(frames):
            for patch in range(patches):
                refused = number == frames - 1 and patch < abstained
                answer = truth * camera + BIAS[estimator] * (1 - truth) + generator.normal(scale=0.01, size=(2, 8))
                answer = np.full((2, 8), np.nan) if refused else np.clip(answer, 0, 1)
                common = {
                    "dataset": dataset, "estimator": estimator, "kernel": kernel.name, "blur_kind": kernel.kind,
                    "kernel_size_px": float(kernel.size_px), "angle_deg": kernel.angle_deg, "noise_source": "",
                    "target_sigma_dn": 0.0,
                    "frame": f"{dataset}-{number:04d}", "patch": patch, "abstained": refused,
                    "reason": "flat" if refused else "", "relative_to": "system",
                }  # fmt: skip
                for axis, index in np.ndindex(2, 8):
                    has_interval = estimator == "spectral"
                    value = answer[axis, index]
                    rows.append(
                        {
                            **common, "axis": "HV"[axis], "frequency": mtf.FREQUENCIES[index],
                            "true_mtf": truth[axis, index], "mtf": value,
                            "low": value - 0.1 if has_interval else np.nan,
                            "high": value + 0.1 if has_interval else np.nan,
                        }
                    )  # fmt: skip
                if (number, patch) == (0, 0) and kernel.name != SHARP and kernel.angle_deg == 0:
                    refuse = kernel.name == "defocus_21" and estimator == "gbb"
                    shown = np.full((2, 8), np.nan) if refuse else answer
                    entries.append(
                        {
                            "kernel": kernel.name, "blur_kind": kernel.kind, "kernel_size_px": float(kernel.size_px),
                            "mtf": shown,
                            "true_mtf": truth, "amae_percent": float(mtf.amae(shown, truth)), "abstained": refuse,
                            "reason": "no kernel found" if refuse else "",
                        }
                    )  # fmt: skip
                    arrays[f"patch_{kernel.name}"] = blurred(picture(f"blur-{dataset}", (192, 192)), kernel.psf)
                    arrays[f"truth_{kernel.name}"] = kernel.psf.astype(np.float32)
                    arrays[f"estimate_{kernel.name}"] = rough(kernel.psf, generator)
    estimates = BLUR_ESTIMATES.conform(pd.DataFrame(rows))
    rows = measurements_of(estimates, "mtf")
    parts = [summarise(rows, 1, 5), summarise(divided_by_sharp(rows), 1, 5, calibrated=True)]
    summary = pd.concat(parts, ignore_index=True)
    index = folder / f"{dataset}-{estimator}"
    store.write_table(index / "estimates.parquet", estimates, BLUR_ESTIMATES)
    store.write_table(index / "summary.parquet", summary, BLUR_SUMMARY)
    if estimator in WITH_KERNEL:
        head = {"dataset": dataset, "estimator": estimator, "frame": f"{dataset}-0000", "patch": 0, "label": "car"}
        store.write_arrays(index / "gallery.npz", **arrays)
        store.write_json(index / "gallery.json", {**head, "kernels": entries})


def blurred(image: np.ndarray, psf: np.ndarray) -> np.ndarray:
    """A picture under a kernel, uint8."""
    import cv2

    return np.clip(cv2.filter2D(image.astype(float), -1, psf.astype(float)), 0, 255).round().astype(np.uint8)


def rough(psf: np.ndarray, generator: np.random.Generator, side: int = 31) -> np.ndarray:
    """A kernel as an estimator might find it: on its own grid, with crumbs around it."""
    out = np.zeros((side, side))
    tall, wide = psf.shape
    top, left = (side - tall) // 2, (side - wide) // 2
    out[top : top + tall, left : left + wide] = psf
    out += 0.004 * generator.random(out.shape) ** 8
    return (out / out.sum()).astype(np.float32)


def add_blur(
    inputs: ReportInputs,
    root: Path,
    datasets: tuple[str, ...],
    estimators: tuple[str, ...] = ("spectral", "pmp", "gbb"),
    sizes: tuple[int, ...] = SIZES,
) -> ReportInputs:
    """The inputs with blur estimates of these datasets and estimators, and their bank of kernels."""
    kernels = bank(sizes)
    for dataset in datasets:
        for estimator in estimators:
            make_blur(root / "blur", dataset, estimator, kernels)
    stored.write(root / "psf", kernels, "generated")
    store.read_table(root / "psf/kernels.parquet", tables.KERNELS)
    return dataclasses.replace(inputs, data=root)
