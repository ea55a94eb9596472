"""Blur estimators measured earlier on recorded pictures: what `pipeline.recording.blur` wrote, read again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.experiments.recorded.frames import folders_with, provenance_of
from pipeline.experiments.tables import BLUR_ESTIMATES, BLUR_SUMMARY
from pipeline.stage_files import any_table

if TYPE_CHECKING:
    import pandas as pd

SUMMARY_FILE, SHARP_FILE, PATCHES_FILE = "summary.csv", "sharp.csv", "patches.csv"
"""By the first of these a record of blur is known among others."""

METRICS_FILE = "metrics.json"
ESTIMATES_FILE = "estimates.parquet"
"""Estimates of every patch, which statistics can be computed from again; older records have none."""

EXACT = "exact"
"""Mode of PMP and GBB that gives what the original programs give."""

SUBSETS = "subsets"
"""Key of the provenance: estimator -> frames and patches that it was run on, where these are fewer than all."""

SUMMARISED = "summarised_again"
"""Key of the provenance: estimators whose statistics were computed again after they had been measured."""

KEYS = {"source", "dataset", "frames", "kernels", "blur"}
"""Of the provenance of a record."""


@dataclass(frozen=True)
class BlurRecord:
    """One record.

    Attributes:
        dataset: its name.
        provenance: where its numbers come from (`pipeline.recording.blur`).
        summary: `pipeline.experiments.tables.BLUR_SUMMARY`.
        sharp: `pipeline.experiments.sharp_curves.sharp_curves`.
        patches: how many each estimator was judged on.
    """

    dataset: str
    provenance: Mapping[str, Any]
    summary: pd.DataFrame
    sharp: pd.DataFrame
    patches: int

    @property
    def estimators(self) -> list[str]:
        """Names of those measured."""
        return list(self.provenance["blur"]["estimators"])

    @property
    def exact(self) -> dict[str, str]:
        """Estimator of the paper -> name of the one measured that is its program in exact mode."""
        settings = self.provenance["blur"]["estimators"]
        return {
            group["kind"]: name for name, group in settings.items() if group.get("options", {}).get("mode") == EXACT
        }

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

    def described(self) -> dict[str, Any]:
        """A row of the table of sources."""
        return {
            "dataset": self.dataset,
            "frames": len(self.provenance["frames"]),
            "patches": self.patches,
            "kernels": len(self.provenance["kernels"]),
            "source": self.provenance["source"],
        }

    def measured_on(self, estimator: str) -> tuple[int, int]:
        """Frames and patches that an estimator was run on."""
        subset = self.provenance.get(SUBSETS, {}).get(estimator)
        return (subset["frames"], subset["patches"]) if subset else (len(self.provenance["frames"]), self.patches)


def estimators(recorded: Path | None) -> dict[str, set[str]]:
    """Dataset -> the estimators recorded on it."""
    folders = folders_with(recorded, SUMMARY_FILE, KEYS)
    return {dataset: set(provenance_of(folder, KEYS)["blur"]["estimators"]) for dataset, folder in folders.items()}


def read(recorded: Path | None) -> list[BlurRecord]:
    """Every record of blur among the recorded measurements.

    Raises:
        InputError: a file of a record is missing or broken, or two records are of one dataset.
    """
    return [read_folder(folder) for folder in folders_with(recorded, SUMMARY_FILE, KEYS).values()]


def read_folder(folder: Path) -> BlurRecord:
    """The record of a folder.

    Raises:
        InputError: a file is missing or broken.
    """
    table, provenance = any_table(folder / SUMMARY_FILE), provenance_of(folder, KEYS)
    if "noise_source" in table:  # empty cells, "" for no noise beside the blur, are read as no number
        table = table.assign(noise_source=table["noise_source"].astype("string").fillna(""))
    summary = BLUR_SUMMARY.conform(table, str(folder / SUMMARY_FILE))
    patches = len(any_table(folder / PATCHES_FILE))
    return BlurRecord(str(provenance["dataset"]), provenance, summary, any_table(folder / SHARP_FILE), patches)


def estimates_of(folder: Path) -> pd.DataFrame:
    """Estimates of every patch that a record keeps: `pipeline.experiments.tables.BLUR_ESTIMATES`, empty without any.

    Raises:
        InputError: the file is broken.
    """
    import pandas as pd

    path = folder / ESTIMATES_FILE
    if path.exists():
        return BLUR_ESTIMATES.conform(any_table(path), str(path))
    return BLUR_ESTIMATES.conform(pd.DataFrame({column: [] for column in BLUR_ESTIMATES.columns}))
