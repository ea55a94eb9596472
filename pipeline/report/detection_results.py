"""What the stages of detection left, by dataset and detector; a stage that has not run leaves its part empty."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from pipeline.curves import directions, iso_exposure, precision, regression
from pipeline.curves.surface import Surface
from pipeline.report.display_names import DATASETS, DETECTORS
from pipeline.report.inputs import ReportInputs
from pipeline.report.tables import NEARLY_0, ordered
from pipeline.stage_files import any_table, existing, optional
from pipeline.store import Schema, read_json

DIRECTION, SPREAD = "direction", "direction_spread"
"""Names of the tables of blur directions in a record."""


@dataclass(frozen=True)
class Results:
    """One detector on one dataset: the tables of `FILES`, None or empty where their stage has not run.

    ``draws``: label -> (conditions, B) resampled AP in percent, in the order of the rows of ``precision``;
    ``surfaces``: label -> its surface, whose bins a record keeps instead;
    ``refused``: label -> why it has no surface; ``fits``: label -> numbers of the fit, or its ``reason``;
    ``calibration``: see `pipeline.curves.iso_exposure.calibration`.
    """

    dataset: str
    detector: str
    precision: pd.DataFrame
    heat: pd.DataFrame
    isolated: pd.DataFrame
    directions: pd.DataFrame | None = None
    spread: pd.DataFrame | None = None
    coefficients: pd.DataFrame | None = None
    fitted: pd.DataFrame | None = None
    draws: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    surfaces: Mapping[str, Surface] = field(default_factory=dict)
    refused: dict[str, str] = field(default_factory=dict)
    fits: dict[str, Any] = field(default_factory=dict)
    calibration: dict[str, Any] = field(default_factory=dict)

    @property
    def labels(self) -> list[str]:
        """Classes with an object."""
        known = self.precision[self.precision["objects"] > 0]
        return sorted(set(known["label"]))

    def fitted_cells(self, label: str) -> pd.DataFrame:
        """Cells of a fit that were measured (`pipeline.curves.iso_exposure.FITTED`); empty without a fit."""
        if self.fitted is None:
            return pd.DataFrame({name: [] for name in iso_exposure.FITTED.columns})
        return self.fitted[(self.fitted["label"] == label) & self.fitted["ap_percent"].notna()]

    def raised_errors(self, label: str) -> NDArray[np.float64]:
        """Errors of the fitted cells that are larger than their bootstrap errors, which are too small for weights.

        Empty without a fit, or where no resampled values are kept.
        """
        errors = self.fitted_cells(label)["error_percent"].to_numpy(float)
        if label not in self.draws or not len(errors):
            return np.zeros(0)
        rows = self.precision[self.precision["label"] == label]
        points, draws = precision.tuples(rows, self.draws[label], average=True)
        order = np.lexsort([points["kernel_size_px"], points["target_sigma_dn"]])  # that of the cells
        order = order[points["ap_percent"].notna().to_numpy()[order]]
        known = [drawn[np.isfinite(drawn)] for drawn in draws[order]]
        bootstrap = np.array([np.std(drawn, ddof=1) if len(drawn) > 1 else 0.0 for drawn in known])
        return errors[errors > bootstrap + NEARLY_0]

    def unweighted_r2(self, label: str) -> float | None:
        """R² of a fit of the same terms to the same cells, each of the same weight as in the paper; None without a fit.

        Nor has a fit of no more cells than terms an R².
        """
        cells = self.fitted_cells(label)
        if self.fits.get(label, {}).get("r2") is None or self.coefficients is None or cells.empty:
            return None
        terms = self.coefficients.loc[self.coefficients["label"] == label, "term"]
        return regression.fit(cells["iso"], cells["exposure_ms"], cells["ap_percent"], terms=list(terms)).r2


FILES: Mapping[str, tuple[str, str, Schema | None]] = {
    "precision": ("curves", "precision.parquet", precision.PRECISION),
    "heat": ("curves", "heat.parquet", precision.HEAT),
    "isolated": ("curves", "isolated.parquet", precision.ISOLATED),
    "draws": ("curves", "draws.npz", None),
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
    pairs = pd.DataFrame(inputs.pairs("curves"), columns=["dataset", "detector"])
    results = []
    for dataset, detector in ordered(pairs, dataset=DATASETS, detector=DETECTORS).itertuples(index=False):
        files = {
            name: inputs.read(f"{stage}/{dataset}-{detector}/{file}", schema)
            for name, (stage, file, schema) in FILES.items()
        }
        parts = {name: content for name, content in files.items() if content is not None}
        if {"precision", "heat", "isolated"} <= set(parts):
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
    for path in sorted(folder.glob("[!.]*/precision.csv")) if folder is not None else []:
        about = read_json(path.parent / "provenance.json")
        table, isolated = (any_table(path.parent / f"{name}.csv") for name in ("precision", "iopc"))
        heat = optional(path.parent, "iopc_heat.csv")  # absent where there was too little for a surface
        heat = pd.DataFrame(columns=list(precision.HEAT.columns)) if heat is None else heat
        turned = {"directions": DIRECTION, "spread": SPREAD}  # of several directions only
        also = {name: optional(path.parent, f"{file}.csv") for name, file in turned.items()}
        files = {label: path.parent / precision.surface_file(label) for label in table["label"].unique()}
        surfaces = {label: Surface.load(file) for label, file in files.items() if file.is_file()}
        also["refused"] = optional(path.parent, "refused.json") or {}
        results = Results(about["dataset"], about["detector"]["kind"], table, heat, isolated, surfaces=surfaces, **also)
        records.append(Recorded(path.parent.name.replace("-", "_"), results, about))
    return records
