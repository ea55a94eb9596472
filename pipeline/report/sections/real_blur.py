"""Blur of real pictures: measured shake, noisy photographs beside the mean of many, strong noise, calibrated cameras.

All of it was recorded by benchmarks, on pictures that are not kept.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from pipeline.report.descriptions import Descriptions
from pipeline.report.display_names import DATASETS, in_order, word
from pipeline.report.inputs import Benchmark, ReportInputs
from pipeline.report.spec import Section
from pipeline.report.tables import Table

PAGE = Descriptions("real_blur")
REAL = Benchmark("real_blur", "python benchmarks/real_blur.py --shake FOLDER --pairs cc=FOLDER", ("pairs",))
NOISY = Benchmark("noisy_blur", "python benchmarks/noisy_blur.py", ("sigma_dn", "results"))
OTHER = Benchmark(
    "other_frames",
    "python benchmarks/other_frames.py --calibrate NAME=KIND:FOLDER --evaluate NAME=KIND:FOLDER "
    "--leave-one-out NAME=KIND:FOLDER --kernels FOLDER",
    ("kernels", "sigma_dn", "cameras"),
)  # fmt: skip
ESTIMATORS = {"spectral": "Spectral, camera-calibrated", "fused": "Fused, camera-calibrated"}
KINDS = ("defocus", "linear_motion")
ENDS = ("low", "high")
KERNELS = {"paper": "kernels_paper", "generated": "kernels_generated"}


def shake(record: Mapping[str, Any]) -> Table:
    """Errors on every photograph blurred by camera shake, and their means."""
    rows = [{"scene": row["scene"], "kernel": row["kernel"], **row["error_percent"]} for row in record["photographs"]]
    means = {name: about["mean_percent"] for name, about in record["summary"].items()}
    means |= {f"{name}_{end}": about[f"{end}_percent"] for name, about in record["summary"].items() for end in ENDS}
    return PAGE.table("real_blur_shake", [*rows, {"scene": "Mean", **means}])


def paired(record: Mapping[str, Any]) -> Table:
    """Differences between a photograph and the mean of many of its scene, of each recording and estimator."""
    rows = [
        {"recording": name, "estimator": estimator, "pictures": about["pictures"], **about[estimator]}
        for name, about in record.items()
        for estimator in about
        if isinstance(about[estimator], dict)
    ]
    return PAGE.table("real_blur_pairs", rows, cells={"held_percent": lambda row: _percent(row["held_fraction"])})


def strong_noise(record: Mapping[str, Any]) -> Table:
    """AMAE of discs and lines under strong noise, of each dataset and estimator."""
    rows = []
    for dataset in in_order(record["results"], DATASETS):
        for estimator, about in record["results"][dataset].items():
            kinds = {kind: about[kind] for kind in KINDS}
            row = {"dataset": dataset, "estimator": ESTIMATORS.get(estimator, word(estimator))}
            row |= {"patches": about["patches"]}
            for kind, one in kinds.items():
                row |= {kind: one["amae_percent"]}
                row |= {f"{kind}_{end}": one[f"amae_{end}_percent"] for end in ENDS}
            row |= {f"{kind}_patch": one["patch_error_percent"] for kind, one in kinds.items()}
            rows.append(row | {"coverage_percent": _mean_percent(one["coverage"] for one in kinds.values())})
    return PAGE.table("real_blur_strong_noise", rows, sigma=record["sigma_dn"])


def other_frames(record: Mapping[str, Any]) -> Table:
    """AMAE on frames of a camera by the calibration to others of it, of each camera and estimator."""
    rows = [
        {
            "dataset": camera["calibrated_on"]["dataset"],
            "calibrated_frames": camera["calibrated_on"]["frames"],
            "estimator": ESTIMATORS.get(estimator, word(estimator)),
            "frames": results["frames"],
            "patches": results["patches"],
            "blur": name,
            **one,
            "coverage_percent": 100 * one["coverage"],
        }
        for camera in record["cameras"]
        for estimator, results in camera["estimators"].items()
        for name, one in _blurs(results).items()
    ]
    kernels = PAGE.text(KERNELS[record["kernels"]])
    return PAGE.table("real_blur_other_frames", rows, sigma=record["sigma_dn"], kernels=kernels)


def _blurs(results: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """Kind of blur -> errors of one estimator on one camera."""
    parts = {"table_one": results["table_one"]["mean"]}
    parts |= {f"noisy_{kind}": results["noisy"][kind] for kind in KINDS}
    return parts | ({"optics": results["optics"]["mean"]} if "optics" in results else {})


def _percent(fraction: float | None) -> float | None:
    return None if fraction is None else 100 * fraction


def _mean_percent(fractions: Iterable[float]) -> float:
    known = list(fractions)
    return 100 * sum(known) / len(known)


def section(inputs: ReportInputs) -> Section | None:
    """Blur of real pictures (``real_blur``, ``noisy_blur`` and ``other_frames`` of ``benchmarks/results``); else None.

    Errors of `ReportInputs.benchmark`.
    """
    benchmarks = (
        ("Blur of real pictures", REAL, _real),
        ("Blur under strong noise", NOISY, lambda record: [strong_noise(record)]),
        ("Blur of other frames of a calibrated camera", OTHER, lambda record: [other_frames(record)]),
    )
    return PAGE.of_benchmarks(inputs, benchmarks)


def _real(record: Mapping[str, Any]) -> list[Table]:
    return [*([shake(record["shake"])] if "shake" in record else []), paired(record["pairs"])]
