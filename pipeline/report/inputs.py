"""What a report is made from: where each stage left its files. What is absent is shown as not run, never dropped."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline import tables
from pipeline.errors import InputError
from pipeline.store import Schema, read_arrays, read_json, read_table

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

NO_STAGE = "(no stage of this version makes it)"


@dataclass(frozen=True)
class ReportInputs:
    """Folders and files of the stages before the report. A folder that does not exist counts as not run.

    Attributes:
        paper: folder of published numbers (``data/paper``).
        index: dataset -> folder with ``frames.parquet``, ``patches.parquet``, ``quarantine.parquet``,
            ``samples.npz`` (up to four arrays ``frame_<name>``, (H, W) uint8) and ``samples.json``
            (frame name -> list of ``{label, x1, y1, x2, y2, ignore}``).
        psf: folder with ``kernels.parquet`` and ``kernels.npz`` (kernel name -> (k, k)).
        corrupt: dataset -> folder with ``corruption.parquet``, ``gallery.npz`` (named (H, W) arrays, uint8 or float
            in [0, 1]) and ``gallery.json``: ``{"chain": [{"array", "title", "caption"}], "effects": [{"array",
            "effect", "level_dn"}], "frame": name}``, both lists in the order shown.
        noise: folder whose sub-folders hold ``summary.parquet`` and ``estimates.parquet``; one per dataset
            and estimator.
        noise_members: names of those sub-folders that belong to this run; None takes all.
        blur: folder whose sub-folders ``<dataset>-<estimator>`` hold ``estimates.parquet`` and ``summary.parquet``
            (`pipeline.blur.evaluation`) and, for estimators that find kernels, ``gallery.npz`` and ``gallery.json``
            (`pipeline.blur.gallery`).
        blur_members: names of those sub-folders that belong to this run; None takes all.
        combined: dataset -> folder of the stage `combined`: ``blur.parquet``, ``noise.parquet``, ``curves.parquet``
            (`pipeline.condition.combined_tables`), ``example.npz`` and ``example.json``
            (`pipeline.condition.combined_example`).
        denoised: dataset -> folder of the stage `denoised_blur`: ``blur.parquet``.
        star: folder with ``star.npz`` (``image``, (H, W)) and ``star.json`` (``frequency`` in fractions of Nyquist,
            ``measured``, ``formula``).
        sensor: folder with ``formation.json`` (constants and moments of image formation, quantity -> number) and
            ``photon_transfer.json`` (see `pipeline.report.photon_transfer_figure`).
        detection: folder with ``curves``, ``direction`` and ``regression``, each with a folder
            ``<dataset>-<detector>``, and ``refit`` (`pipeline.report.detection_results`).
        detection_members: the pairs of dataset and detector of this run.
        detectors_absent: detector without weights -> the line that would get them and run it.
        recorded: folder whose sub-folders hold detection (`pipeline.report.recorded`) and blur
            (`pipeline.report.recorded_blur`) measured on pictures that are not kept.
        results: ledger item -> table (CSV or Parquet) with the key and value columns of that item's published file.
        runtime: record of run times on declared hardware (``benchmarks/results/estimators.json``).
        unseen: record of blurs of other kinds than were trained on (``benchmarks/results/unseen_kernels.json``).
        weights: folder of released networks, each with its learning curve (`pipeline.report.learning_curves`).
        ablation: folder of measures of short trainings with one thing changed; `ablations`: which of them, in order.
        absent: dataset without data -> the line that would run it.
        lock: ``dvc.lock``, for the hashes of what went in.
        stages: names of the stages that this version has; None if unknown.
        aliases: stages as tables name them, e.g. ``"noise@sim-pca"`` -> as ``dvc.yaml`` does.
        code_version: of the package.
        profile: name of the profile that ran.
        runs: stage -> the line that re-runs it, where that is not ``dvc repro <stage>``.
    """

    paper: Path
    index: Mapping[str, Path] = field(default_factory=dict)
    psf: Path | None = None
    corrupt: Mapping[str, Path] = field(default_factory=dict)
    noise: Path | None = None
    noise_members: frozenset[str] | None = None
    blur: Path | None = None
    blur_members: frozenset[str] | None = None
    combined: Mapping[str, Path] = field(default_factory=dict)
    denoised: Mapping[str, Path] = field(default_factory=dict)
    star: Path | None = None
    sensor: Path | None = None
    detection: Path | None = None
    detection_members: frozenset[tuple[str, str]] = frozenset()
    detectors_absent: Mapping[str, str] = field(default_factory=dict)
    recorded: Path | None = None
    results: Mapping[str, Path] = field(default_factory=dict)
    runtime: Path | None = None
    unseen: Path | None = None
    weights: Path | None = None
    ablation: Path | None = None
    ablations: Sequence[str] = ()
    absent: Mapping[str, str] = field(default_factory=dict)
    lock: Path | None = None
    stages: frozenset[str] | None = None
    aliases: Mapping[str, str] = field(default_factory=dict)
    code_version: str = ""
    profile: str = "default"
    runs: Mapping[str, str] = field(default_factory=dict)

    def line(self, stage: str) -> str:
        """The command that runs a stage again, or `NO_STAGE` where this version has no such stage."""
        stage = self.in_graph(stage)
        if stage in self.runs:
            return self.runs[stage]
        group = stage.split("@")[0]
        if self.stages is not None and group not in self.stages and "<kind>" not in group:
            return NO_STAGE
        return f"dvc repro {stage}"

    def in_graph(self, stage: str) -> str:
        """The name of a stage in ``dvc.yaml``, which has one group for each registry name of an estimator."""
        if stage in self.aliases or self.stages is None:
            return self.aliases.get(stage, stage)
        group, at, item = stage.partition("@")
        grouped = group not in self.stages and any(name.startswith(f"{group}_") for name in self.stages)
        return f"{group}_<kind>{at}{item}" if grouped else stage

    @property
    def datasets(self) -> list[str]:
        """Every dataset named, run or absent, in the paper's order."""
        from pipeline.report.wording import DATASETS, in_order

        return in_order([*self.index, *self.corrupt, *self.absent], DATASETS)


def existing(path: Path | None) -> Path | None:
    """The path if something is there, else None."""
    return path if path is not None and path.exists() else None


def benchmark_record(path: Path | None, keys: set[str], line: str) -> dict[str, Any] | None:
    """What a benchmark recorded, or None where it was not run.

    Args:
        path: of its JSON file.
        keys: that it must have.
        line: the command that makes it.

    Raises:
        InputError: the file holds something else.
    """
    place = existing(path)
    if place is None:
        return None
    content = read_json(place)
    if not isinstance(content, dict) or not keys <= set(content):
        raise InputError(f"{place}: expected the record of a benchmark; make it again: {line}")
    return content


def optional_table(folder: Path | None, name: str, schema: Schema) -> pd.DataFrame | None:
    """A table of a stage's folder, or None where the stage has not run."""
    path = existing(folder / name if folder is not None else None)
    return None if path is None else read_table(path, schema)


def optional_arrays(folder: Path | None, name: str) -> dict[str, np.ndarray]:
    """The arrays of a stage's folder; empty where the stage has not run."""
    path = existing(folder / name if folder is not None else None)
    return {} if path is None else read_arrays(path)


def optional_json(folder: Path | None, name: str) -> Any:
    """JSON of a stage's folder, or None where the stage has not run."""
    path = existing(folder / name if folder is not None else None)
    return None if path is None else read_json(path)


def any_table(path: Path) -> pd.DataFrame:
    """A CSV or Parquet table without a declared schema.

    Raises:
        InputError: the file is absent, of another kind, or broken.
    """
    import pandas as pd

    try:
        if path.suffix == ".csv":
            return pd.read_csv(path)
        if path.suffix == ".parquet":
            return pd.read_parquet(path)
    except FileNotFoundError:
        raise InputError(f"{path}: no such table; run the stage that makes it (dvc repro)") from None
    except (ValueError, OSError) as error:
        raise InputError(f"{path}: not a readable table ({error}); delete it and run dvc repro") from None
    raise InputError(f"{path}: expected a .csv or .parquet table")


def records(table: pd.DataFrame) -> list[dict[str, Any]]:
    """The rows of a table as dictionaries of plain Python values."""
    return [{str(name): cell for name, cell in row.items()} for row in table.to_dict("records")]


def members(folder: Path | None, chosen: frozenset[str] | None) -> list[Path]:
    """Folders of stage members that are there, the given one itself among them, sorted.

    Args:
        folder: that holds a sub-folder for each member, or None.
        chosen: names of the sub-folders that count; None takes all.
    """
    place = existing(folder)
    found = sorted({path.parent for path in place.rglob("*.parquet")}) if place is not None else []
    return [path for path in found if chosen is None or path.name in chosen]


def _joined(folders: Iterable[Path], name: str, schema: Schema) -> pd.DataFrame:
    """One table of several folders; empty, with its columns, where none holds it."""
    import pandas as pd

    parts = [read_table(folder / name, schema) for folder in folders if (folder / name).exists()]
    if not parts:
        return schema.conform(pd.DataFrame({column: [] for column in schema.columns}))
    return pd.concat(parts, ignore_index=True)


def noise_tables(inputs: ReportInputs) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Every noise summary and every patch-wise estimate found, each as one table (empty where none is).

    Returns:
        summary (`pipeline.tables.NOISE_SUMMARY`), estimates (`pipeline.tables.NOISE_ESTIMATES`).
    """
    found = members(inputs.noise, inputs.noise_members)
    summary = _joined(found, "summary.parquet", tables.NOISE_SUMMARY)
    return summary, _joined(found, "estimates.parquet", tables.NOISE_ESTIMATES)


def blur_summary(inputs: ReportInputs) -> pd.DataFrame:
    """Every blur summary found, without noise beside the blur: `pipeline.blur.evaluation.SUMMARY`."""
    from pipeline.blur.evaluation import SUMMARY

    summary = _joined(members(inputs.blur, inputs.blur_members), "summary.parquet", SUMMARY)
    return summary[summary["level_dn"] == 0].reset_index(drop=True)


def blur_estimates(inputs: ReportInputs) -> pd.DataFrame:
    """Every patch-wise blur estimate found, without noise beside the blur: `pipeline.blur.evaluation.ESTIMATES`."""
    from pipeline.blur.evaluation import ESTIMATES

    estimates = _joined(members(inputs.blur, inputs.blur_members), "estimates.parquet", ESTIMATES)
    return estimates[estimates["level_dn"] == 0].reset_index(drop=True)


def combined_folders(inputs: ReportInputs) -> dict[str, Path]:
    """Dataset -> folder of the stage `combined`, those that are there."""
    return {name: folder for name, folder in inputs.combined.items() if folder.exists()}


def combined_tables(inputs: ReportInputs) -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    """Statistics of blur and noise at once, each of all datasets as one table (empty where none is).

    Returns:
        blur (`BLUR_CELLS`), noise (`NOISE_CELLS`) and the example's curves (`CURVES`) of
        `pipeline.condition.combined_tables`.
    """
    from pipeline.condition.combined_tables import BLUR_CELLS, CURVES, NOISE_CELLS

    folders = combined_folders(inputs).values()
    names = {"blur.parquet": BLUR_CELLS, "noise.parquet": NOISE_CELLS, "curves.parquet": CURVES}
    blur, noise, curves = (_joined(folders, name, schema) for name, schema in names.items())
    return blur, noise, curves


def denoised_cells(inputs: ReportInputs) -> pd.DataFrame:
    """Errors of smoothing before estimating: `pipeline.condition.combined_tables.BLUR_CELLS`; empty where none is."""
    from pipeline.condition.combined_tables import BLUR_CELLS

    return _joined(inputs.denoised.values(), "blur.parquet", BLUR_CELLS)
