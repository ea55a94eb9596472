"""Blur estimators measured earlier on recorded pictures: what `pipeline.recording.blur` wrote, read again."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.errors import InputError
from pipeline.experiments.tables import BLUR_SUMMARY
from pipeline.report.display_names import DATASETS, in_order
from pipeline.report.inputs import EXACT, ReportInputs, any_table, existing
from pipeline.store import read_json

if TYPE_CHECKING:
    import pandas as pd

SUMMARY_FILE, SHARP_FILE, PATCHES_FILE, PROVENANCE_FILE = "summary.csv", "sharp.csv", "patches.csv", "provenance.json"
"""By the first of these a record of blur is known among others."""

METRICS_FILE = "metrics.json"
SUBSETS = "subsets"
"""Key of the provenance: estimator -> frames and patches that it was run on, where these are fewer than all."""

SAID = {"source", "dataset", "frames", "kernels", "blur"}
SAME = ("dataset", "kind", "frames", "previous", "kernels", "psf", "camera", "seed")
"""What must agree, beside how patches are taken, for two measurements to stand in one record."""


@dataclass(frozen=True)
class BlurRecord:
    """One record.

    Attributes:
        dataset: its name.
        said: its provenance (`pipeline.recording.blur`).
        summary: `pipeline.experiments.tables.BLUR_SUMMARY`.
        sharp: `pipeline.experiments.sharp_curves.sharp_curves`.
        patches: how many each estimator was judged on.
    """

    dataset: str
    said: Mapping[str, Any]
    summary: pd.DataFrame
    sharp: pd.DataFrame
    patches: int

    @property
    def estimators(self) -> list[str]:
        """Names of those measured."""
        return list(self.said["blur"]["estimators"])

    @property
    def exact(self) -> dict[str, str]:
        """Estimator of the paper -> name of the one measured that is its program in exact mode."""
        settings = self.said["blur"]["estimators"]
        return {own["kind"]: name for name, own in settings.items() if own.get("options", {}).get("mode") == EXACT}

    def name_of(self, estimator: str) -> str:
        """The estimator measured that stands for one of the paper: its program in exact mode where that was run."""
        return self.exact.get(estimator, estimator)

    def as_the_paper_ran(self, table: pd.DataFrame) -> pd.DataFrame:
        """A table of the record with exact programs under the paper's names, and without their faster variants.

        Args:
            table: with a column ``estimator``.
        """
        exact = self.exact
        kept = table[~table["estimator"].isin([name for name in exact if exact[name] != name])]
        names = {name: paper for paper, name in exact.items()}
        return kept.assign(estimator=kept["estimator"].replace(names))

    def measured_on(self, estimator: str) -> tuple[int, int]:
        """Frames and patches that an estimator was run on."""
        subset = self.said.get(SUBSETS, {}).get(estimator)
        return (subset["frames"], subset["patches"]) if subset else (len(self.said["frames"]), self.patches)


@dataclass(frozen=True)
class Others:
    """What a record holds of estimators that are not measured again.

    Attributes:
        said: its provenance, of those estimators.
        summary, sharp: see `BlurRecord`.
        metrics: estimator -> metrics.
    """

    said: dict[str, Any]
    summary: pd.DataFrame
    sharp: pd.DataFrame
    metrics: dict[str, Any]


def others(folder: Path, said: Mapping[str, Any]) -> Others | None:
    """What a folder holds of estimators other than those of a new measurement; None where there is no such folder.

    Args:
        folder: of a record.
        said: provenance of the new measurement.

    Raises:
        InputError: the record is broken, or of other pictures, kernels or settings.
    """
    if not folder.is_dir():
        return None
    earlier, said = _said(folder), json.loads(json.dumps(said))  # lists for tuples, as in the file
    new, old = ({name: one["blur"][name] for name in one["blur"] if name != "estimators"} for one in (said, earlier))
    differing = [name for name in SAME if earlier.get(name) != said[name]] + ["blur"] * (new != old)
    if differing:
        raise InputError(
            f"{folder}: measured with another {', '.join(differing)}, so nothing can join it; measure all estimators "
            "anew into another folder"
        )
    names = [name for name in earlier["blur"]["estimators"] if name not in said["blur"]["estimators"]]
    for part in (earlier["weights"], earlier["blur"]["estimators"], earlier.get(SUBSETS, {})):
        for name in set(part) - set(names):
            del part[name]
    known = _read(str(earlier["dataset"]), folder)
    summary, sharp = (table[table["estimator"].isin(names)] for table in (known.summary, known.sharp))
    metrics = {name: found for name, found in read_json(folder / METRICS_FILE).items() if name in names}
    return Others(earlier, summary, sharp, metrics)


def folders(inputs: ReportInputs) -> dict[str, Path]:
    """Dataset -> folder of its record, in the report's order.

    Raises:
        InputError: a provenance is missing or broken, or two records are of one dataset.
    """
    place = existing(inputs.recorded)
    found: dict[str, Path] = {}
    for path in sorted(place.glob(f"*/{SUMMARY_FILE}")) if place is not None else []:
        dataset = str(_said(path.parent)["dataset"])
        if dataset in found:
            raise InputError(f"{found[dataset]} and {path.parent}: both record blur on '{dataset}'; keep one of them")
        found[dataset] = path.parent
    return {dataset: found[dataset] for dataset in in_order(found, DATASETS)}


def estimators(inputs: ReportInputs) -> dict[str, set[str]]:
    """Dataset -> the estimators recorded on it."""
    return {dataset: set(_said(folder)["blur"]["estimators"]) for dataset, folder in folders(inputs).items()}


def read(inputs: ReportInputs) -> list[BlurRecord]:
    """Every record of blur among the recorded measurements.

    Raises:
        InputError: a file of a record is missing or broken.
    """
    return [_read(dataset, folder) for dataset, folder in folders(inputs).items()]


def _said(folder: Path) -> dict[str, Any]:
    said = read_json(folder / PROVENANCE_FILE)
    if not isinstance(said, dict) or not set(said) >= SAID:
        raise InputError(
            f"{folder / PROVENANCE_FILE}: not the provenance of a record of blur; see reports/recorded/README.md"
        )
    return said


def _read(dataset: str, folder: Path) -> BlurRecord:
    table = any_table(folder / SUMMARY_FILE)
    if "noise_source" in table:  # empty cells, "" for no noise beside the blur, are read as no number
        table = table.assign(noise_source=table["noise_source"].astype("string").fillna(""))
    summary = BLUR_SUMMARY.conform(table, str(folder / SUMMARY_FILE))
    patches = len(any_table(folder / PATCHES_FILE))
    return BlurRecord(dataset, _said(folder), summary, any_table(folder / SHARP_FILE), patches)
