"""Blur of real pictures: measured camera shake, noisy photographs beside the mean of many, and blur under strong noise.

All of it was recorded by benchmarks, on pictures that are not kept.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from pipeline.errors import InputError
from pipeline.report.descriptions import Descriptions
from pipeline.report.display_names import DATASETS, in_order, word
from pipeline.report.inputs import ReportInputs
from pipeline.report.spec import Run, Section
from pipeline.report.tables import Table

PAGE = Descriptions("real_blur")
RECORDS = {
    "real_blur": (
        "Blur of real pictures",
        ("pairs",),
        "python benchmarks/real_blur.py --shake FOLDER --pairs cc=FOLDER",
    ),
    "noisy_blur": ("Blur under strong noise", ("sigma_dn", "results"), "python benchmarks/noisy_blur.py"),
}
"""Benchmark -> title, what its record holds at least, and the command that makes it."""
ESTIMATORS = {"spectral": "Spectral, camera-calibrated", "fused": "Fused, camera-calibrated"}
KINDS = ("defocus", "linear_motion")


def shake(record: Mapping[str, Any]) -> Table:
    """Errors on every photograph blurred by camera shake, and their means."""
    rows = [{"scene": row["scene"], "kernel": row["kernel"], **row["error_percent"]} for row in record["photographs"]]
    means = {name: about["mean_percent"] for name, about in record["summary"].items()}
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
            row |= {kind: one["amae_percent"] for kind, one in kinds.items()}
            row |= {f"{kind}_patch": one["patch_error_percent"] for kind, one in kinds.items()}
            rows.append(row | {"coverage_percent": _mean_percent(one["coverage"] for one in kinds.values())})
    return PAGE.table("real_blur_strong_noise", rows, sigma=record["sigma_dn"])


def _percent(fraction: float | None) -> float | None:
    return None if fraction is None else 100 * fraction


def _mean_percent(fractions: Iterable[float]) -> float:
    known = list(fractions)
    return 100 * sum(known) / len(known)


def _tables(name: str, record: Mapping[str, Any]) -> list[Table]:
    """The tables of one record."""
    if name == "noisy_blur":
        return [strong_noise(record)]
    return [*([shake(record["shake"])] if "shake" in record else []), paired(record["pairs"])]


def section(inputs: ReportInputs) -> Section | None:
    """Blur of real pictures (``benchmarks/results/real_blur.json`` and ``noisy_blur.json``); None without records.

    Raises:
        InputError: a record holds something else.
    """
    blocks, runs = list[Table](), list[Run]()
    for name, (title, keys, command) in RECORDS.items():
        record = inputs.benchmark(name, keys, command)
        if record is None:
            continue
        try:
            blocks += _tables(name, record)
        except (KeyError, TypeError, AttributeError):
            raise InputError(f"{inputs.benchmarks[name]}: a number is missing; make it again: {command}") from None
        runs.append(Run(title, "", True, "", command))
    return PAGE.section(blocks, runs) if blocks else None
