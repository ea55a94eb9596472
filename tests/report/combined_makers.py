"""Small synthetic outputs of the stages `combined` and `denoised_blur`, written as those stages write them."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pandas as pd
from report_makers import picture

from pipeline import store
from pipeline.camera import mtf
from pipeline.experiments.tables import BLUR_CELLS, CURVES, NOISE_CELLS
from pipeline.report.inputs import ReportInputs

EXPERIMENTS = {
    "defocus_dcsn": ("defocus", "dcsn"),
    "photon_linear": ("linear_motion", "photon"),
    "photon_defocus": ("defocus", "photon"),
    "linear_dcsn": ("linear_motion", "dcsn"),
}
SIZES, LEVELS = (3.0, 11.0), (0.0, 10.0, 25.0)


def amae(size: float, level: float, filter_px: float, is_calibrated: bool) -> float:
    """What the made-up estimator errs by: more with noise, least when calibrated, most when smoothed."""
    return 1.0 + size / 100 + level / 10 + filter_px - 0.5 * is_calibrated


def blur_cells(dataset: str, *, experiments: tuple[str, ...] = tuple(EXPERIMENTS), filters: tuple[float, ...] = (7.0,),
               sizes: tuple[float, ...] = SIZES) -> pd.DataFrame:  # fmt: skip
    """Cells of one estimator on one dataset; photon noise is never smoothed."""
    rows = []
    for name in experiments:
        kind, noise_source = EXPERIMENTS[name]
        for way in (False, True):
            for size in sizes:
                for level in LEVELS:
                    for filter_px in (0.0, *filters):
                        if filter_px and level == 0:
                            continue
                        value = amae(size, level, filter_px, way)
                        rows.append(
                            {
                                "dataset": dataset, "estimator": "spectral", "experiment": name,
                                "noise_source": noise_source,
                                "target_sigma_dn": level, "blur_kind": kind, "kernel_size_px": size,
                                "filter_px": filter_px,
                                "relative_to": "camera" if way else "system", "calibrated": way,
                                "amae_percent": value, "low_percent": value - 0.5,
                                "high_percent": value + 0.5, "patch_error_percent": value + 1, "coverage": 0.9,
                                "angles": 1, "count": 9, "abstained": 1,
                                "smoothed_fraction": float(filter_px > 0 and noise_source == "dcsn"),
                                "frequencies_fraction": 0.8,
                                "mae_h_percent": value + 0.2, "mae_v_percent": value - 0.2,
                                "expected_amae_percent": 5.0 if filter_px else np.nan,
                            }
                        )  # fmt: skip
    return BLUR_CELLS.conform(pd.DataFrame(rows))


def noise_cells(dataset: str) -> pd.DataFrame:
    """Sensor noise is read at its level, photon noise behind a blur hardly at all."""
    rows = []
    for name, (kind, noise_source) in EXPERIMENTS.items():
        for estimator in ("cellwise", "pca"):
            for size in (0.0, *SIZES):
                for level in LEVELS:
                    present = level if noise_source == "dcsn" or size == 0 else level / size
                    rows.append(
                        {
                            "dataset": dataset, "estimator": estimator, "experiment": name, "blur_kind": kind,
                            "kernel_size_px": size, "noise_source": noise_source, "target_sigma_dn": level,
                            "median_dn": 0.95 * present,
                            "minimum_dn": 0.9 * present, "maximum_dn": present, "low_dn": 0.93 * present,
                            "high_dn": 0.97 * present, "clipped_median_dn": present, "unclipped_median_dn": present,
                            "patch_error_dn": 0.05 * present, "coverage": np.nan, "count": 8, "rejected": 0,
                            "abstained": 2 if estimator == "pca" else 0,
                        }
                    )  # fmt: skip
    return NOISE_CELLS.conform(pd.DataFrame(rows))


def curves(dataset: str) -> pd.DataFrame:
    """Every curve is a straight fall; noise lifts what is read by 1 % of its level, smoothing by a tenth."""
    rows = []
    for name, (kind, _) in EXPERIMENTS.items():
        for way in (False, True):
            for level in LEVELS:
                for filter_px in (0.0, 7.0):
                    for axis in ("H", "V", "HV"):
                        for index, frequency in enumerate(mtf.FREQUENCIES):
                            truth = 1 - frequency
                            rows.append(
                                {
                                    "dataset": dataset, "estimator": "spectral", "experiment": name, "blur_kind": kind,
                                    "kernel_size_px": 11.0, "angle_deg": 0.0 if kind == "defocus" else 45.0,
                                    "target_sigma_dn": level, "filter_px": filter_px, "calibrated": way, "axis": axis,
                                    "frequency_index": index, "frequency": frequency, "true_mtf": truth,
                                    "median": truth + 0.01 * level + 0.1 * (filter_px > 0), "minimum": 0.0,
                                    "maximum": 1.0, "change_low": 0.01 * level - 0.005 if level else np.nan,
                                    "change_high": 0.01 * level + 0.005 if level else np.nan, "count": 9,
                                    "abstained": 1,
                                }
                            )  # fmt: skip
    return CURVES.conform(pd.DataFrame(rows))


def make_combined(folder: Path, dataset: str) -> None:
    """All files of the stage `combined` for one dataset."""
    arrays, entries = {}, []
    for name, (kind, noise_source) in EXPERIMENTS.items():
        steps = (
            ["scene", "optics", "dark", "frame"] if noise_source == "dcsn" else ["scene", "photon", "optics", "frame"]
        )
        arrays |= {f"step_{name}_{step}": picture(f"{name} {step}", (96, 96)) for step in steps}
        arrays |= {f"level_{name}_{index}": picture(f"{name} {index}", (96, 96)) for index in range(len(LEVELS))}
        entries.append({"experiment": name, "kernel": f"{kind}_11", "blur_kind": kind, "noise_source": noise_source,
            "angle_deg": 0.0,
                        "steps": steps, "target_sigmas_dn": list(LEVELS)})  # fmt: skip
    head = {"dataset": dataset, "frame": f"{dataset}-0000", "label": "car", "kernel_size_px": 11.0}
    store.write_table(folder / "blur.parquet", blur_cells(dataset), BLUR_CELLS)
    store.write_table(folder / "noise.parquet", noise_cells(dataset), NOISE_CELLS)
    store.write_table(folder / "curves.parquet", curves(dataset), CURVES)
    store.write_arrays(folder / "example.npz", **arrays)
    store.write_json(folder / "example.json", {**head, "experiments": entries})


def add_combined(inputs: ReportInputs, root: Path, datasets: tuple[str, ...]) -> ReportInputs:
    """The inputs with blur and noise at once, and the supplement's table, on these datasets."""
    for dataset in datasets:
        make_combined(root / "combined" / dataset, dataset)
        cells = blur_cells(dataset, experiments=("linear_dcsn",), filters=(7.0, 11.0), sizes=(3.0, 7.0, 11.0))
        store.write_table(root / "denoised_blur" / dataset / "blur.parquet", cells, BLUR_CELLS)
    return dataclasses.replace(inputs, data=root)
