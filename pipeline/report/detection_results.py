"""What the stages of detection left, by dataset and detector; a stage that has not run leaves its part empty."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import pandas as pd

from pipeline.curves import directions, iso_exposure, precision
from pipeline.report.display_names import DATASETS, DETECTORS, in_order
from pipeline.report.inputs import ReportInputs
from pipeline.stage_files import any_table, existing, optional
from pipeline.store import Schema, read_json

DIRECTION, SPREAD = "direction", "direction_spread"
"""Names of the tables of blur directions in a record."""


@dataclass(frozen=True)
class Results:
    """One detector on one dataset: the tables of `FILES`, None or empty where their stage has not run.

    ``refused``: label -> why it has no surface; ``fits``: label -> numbers of the fit, or its ``reason``;
    ``calibration``: see `pipeline.curves.iso_exposure.calibration`.
    """

    dataset: str
    detector: str
    precision: pd.DataFrame
    heat: pd.DataFrame
    isolated: pd.DataFrame
    refused: dict[str, str]
    directions: pd.DataFrame | None
    spread: pd.DataFrame | None
    coefficients: pd.DataFrame | None
    fitted: pd.DataFrame | None
    fits: dict[str, Any]
    calibration: dict[str, Any]

    @property
    def labels(self) -> list[str]:
        """Classes with an object."""
        known = self.precision[self.precision["objects"] > 0]
        return sorted(set(known["label"]))


FILES: Mapping[str, tuple[str, str, Schema | None]] = {
    "precision": ("curves", "precision.parquet", precision.PRECISION),
    "heat": ("curves", "heat.parquet", precision.HEAT),
    "isolated": ("curves", "isolated.parquet", precision.ISOLATED),
    "refused": ("curves", "refused.json", None),
    "directions": ("direction", "table.parquet", directions.TABLE),
    "spread": ("direction", "spread.parquet", directions.SPREAD),
    "coefficients": ("regression", "coefficients.parquet", iso_exposure.COEFFICIENTS),
    "fitted": ("regression", "fitted.parquet", iso_exposure.FITTED),
    "fits": ("regression", "fits.json", None),
    "calibration": ("regression", "calibration.json", None),
}
"""Part of the results -> stage, file and schema."""


def read(inputs: ReportInputs) -> list[Results]:
    """Everything that has run, in the paper's order of datasets and ours of detectors."""
    results, pairs = [], inputs.pairs("curves")
    for dataset in in_order((pair[0] for pair in pairs), DATASETS):
        for detector in in_order((one[1] for one in pairs if one[0] == dataset), DETECTORS):
            parts: dict[str, Any] = {
                name: inputs.read(f"{stage}/{dataset}-{detector}/{file}", schema)
                for name, (stage, file, schema) in FILES.items()
            }
            if all(parts[name] is not None for name in ("precision", "heat", "isolated")):
                parts |= {name: parts[name] or {} for name in ("refused", "fits", "calibration")}
                results.append(Results(dataset, detector, **parts))
    return results


@dataclass(frozen=True)
class Recorded:
    """One sweep recorded on pictures that are not kept (`pipeline.recording.detection`): name of its folder, tables."""

    name: str
    results: Results
    provenance: dict[str, Any]

    @property
    def objects(self) -> int:
        """Objects of all classes."""
        return int(self.results.precision.groupby("label")["objects"].max().sum())


def recorded(inputs: ReportInputs) -> list[Recorded]:
    """Every recorded sweep, by the name of its folder."""
    folder = existing(inputs.recorded)
    records = []
    for path in sorted(folder.glob("*/precision.csv")) if folder is not None else []:
        about = read_json(path.parent / "provenance.json")
        table, isolated = (any_table(path.parent / f"{name}.csv") for name in ("precision", "iopc"))
        heat = optional(path.parent, "iopc_heat.csv")  # absent where there was too little for a surface
        heat = pd.DataFrame(columns=list(precision.HEAT.columns)) if heat is None else heat
        pair = about["dataset"], about["detector"]["kind"]
        turned = [optional(path.parent, f"{name}.csv") for name in (DIRECTION, SPREAD)]  # of several directions only
        results = Results(*pair, table, heat, isolated, {}, turned[0], turned[1], None, None, {}, {})
        records.append(Recorded(path.parent.name.replace("-", "_"), results, about))
    return records
