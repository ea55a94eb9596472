"""The files that a report reads: where each stage left them. What is absent is shown as not run, never dropped."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline import tables
from pipeline.camera.mtf import FREQUENCIES, SYSTEM
from pipeline.experiments.blur_records import EXACT
from pipeline.experiments.sharp_curves import NOMINAL_FREQUENCIES
from pipeline.experiments.tables import BLUR_CELLS, BLUR_ESTIMATES, BLUR_SUMMARY, CURVES, NOISE_CELLS
from pipeline.report.display_names import DATASETS, PAPER_NAMES, in_order, listing, word
from pipeline.stage_files import any_table, existing
from pipeline.store import Schema, read_table

if TYPE_CHECKING:
    import pandas as pd

PUBLISHED_COLUMNS = {
    "blur": "blur_kind",
    "size_px": "kernel_size_px",
    "effect": "noise_source",
    "level_dn": "target_sigma_dn",
}
"""Columns of the files of published numbers -> as our tables call them."""

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
            "noise_source", "target_sigma_dn"}], "frame": name}``, both lists in the order shown.
        noise: folder whose sub-folders hold ``summary.parquet`` and ``estimates.parquet``; one per dataset
            and estimator.
        noise_members: names of those sub-folders that belong to this run; None takes all.
        real_noise: recording of a real camera -> folder of the stage `real_noise`: ``recording.json`` and, where it has
            run, tables of `pipeline.experiments.real_noise_tables`.
        blur: folder whose sub-folders ``<dataset>-<estimator>`` hold ``estimates.parquet`` and ``summary.parquet``
            (`pipeline.experiments.tables`) and, for estimators that find kernels, ``gallery.npz`` and ``gallery.json``
            (`pipeline.experiments.kernel_gallery`).
        blur_members: names of those sub-folders that belong to this run; None takes all.
        combined: dataset -> folder of the stage `combined`: ``blur.parquet``, ``noise.parquet``, ``curves.parquet``
            (`pipeline.experiments.tables`), ``example.npz`` and ``example.json``
            (`pipeline.experiments.combined_example`).
        denoised: dataset -> folder of the stage `denoised_blur`: ``blur.parquet``.
        star: folder with ``star.npz`` (``image``, (H, W)) and ``star.json`` (``frequency`` in fractions of Nyquist,
            ``measured``, ``formula``).
        sensor: folder with ``formation.json`` (constants and moments of image formation, quantity -> number) and
            ``photon_transfer.json`` (see `pipeline.report.photon_transfer_figure`).
        detection: folder with ``curves``, ``direction`` and ``regression``, each with a folder
            ``<dataset>-<detector>``, and ``refit`` (`pipeline.report.detection_results`).
        detection_members: the pairs of dataset and detector of this run.
        detectors_absent: detector without weights -> the line that would get them and run it.
        control: folder with ``control_surface``, ``worked_examples``, ``order_study`` and ``closed_loop`` (a folder for
            each scenario), see `pipeline.control.tables`.
        scenarios: those of this run, in order.
        decision_times: record of the time per decision (``benchmarks/results/control.json``).
        recorded: folder whose sub-folders hold detection (`pipeline.recording.detection`), blur
            (`pipeline.recording.blur`), noise (`pipeline.recording.real_noise`) and sensor constants
            (`pipeline.recording.sensor`) measured on pictures that are not kept.
        results: ledger item -> table (CSV or Parquet) with the key and value columns of that item's published file.
        runtime: record of run times on declared hardware (``benchmarks/results/estimators.json``).
        flags: record of rank correlations with the true blur and noise (``benchmarks/results/flags.json``).
        unseen: record of blurs of other kinds than were trained on (``benchmarks/results/unseen_kernels.json``).
        weights: folder of released networks, each with its learning curve (`pipeline.learning.learning_curve`).
        ablation: folder of measures of short trainings with one thing changed; `ablations`: which of them, in order.
        absent: dataset without data -> the command that runs it.
        lock: ``dvc.lock``, for the hashes of what went in.
        stages: names of the stages that this version has; None if unknown.
        aliases: stages as tables name them, e.g. ``"noise@sim-pca"`` -> as ``dvc.yaml`` does.
        code_version: of the package.
        profile: name of the profile that ran.
        runs: stage -> the command that reproduces it, where that is not ``dvc repro <stage>``.
        modes: blur estimator -> its mode where that is not the exact one, see `mode_of`.
        seed: root of the bootstrap's random streams.
    """

    paper: Path
    index: Mapping[str, Path] = field(default_factory=dict)
    psf: Path | None = None
    corrupt: Mapping[str, Path] = field(default_factory=dict)
    noise: Path | None = None
    noise_members: frozenset[str] | None = None
    real_noise: Mapping[str, Path] = field(default_factory=dict)
    blur: Path | None = None
    blur_members: frozenset[str] | None = None
    combined: Mapping[str, Path] = field(default_factory=dict)
    denoised: Mapping[str, Path] = field(default_factory=dict)
    star: Path | None = None
    sensor: Path | None = None
    detection: Path | None = None
    detection_members: frozenset[tuple[str, str]] = frozenset()
    detectors_absent: Mapping[str, str] = field(default_factory=dict)
    control: Path | None = None
    scenarios: Sequence[str] = ()
    decision_times: Path | None = None
    recorded: Path | None = None
    results: Mapping[str, Path] = field(default_factory=dict)
    runtime: Path | None = None
    flags: Path | None = None
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
    modes: Mapping[str, str] = field(default_factory=dict)
    seed: int = 0

    def line(self, stage: str) -> str:
        """The command that runs a stage again, or `NO_STAGE` where this version has no such stage."""
        stage = self.in_graph(stage)
        if stage in self.runs:
            return self.runs[stage]
        group = stage.split("@")[0]
        if self.stages is not None and group not in self.stages and "<kind>" not in group:
            return NO_STAGE
        return f"dvc repro {stage}"

    def of_control(self, stage: str) -> Path | None:
        """The folder of a stage of control."""
        return None if self.control is None else self.control / stage

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
        return in_order([*self.index, *self.corrupt, *self.absent], DATASETS)


def relative_mtf(table: pd.DataFrame) -> dict[str, str]:
    """Estimators whose MTF, before any division, is not that of the system -> what it is relative to.

    Args:
        table: `pipeline.experiments.tables.BLUR_SUMMARY` or `BLUR_ESTIMATES`.
    """
    ordered = table.sort_values("calibrated", kind="stable") if "calibrated" in table else table
    first = ordered.groupby("estimator", sort=False)["relative_to"].first()
    return {str(name): str(to) for name, to in first.items() if to != SYSTEM}


def mode_of(settings: Mapping[str, Any]) -> str:
    """Mode of a blur estimator that has several, e.g. ``"fast"``; empty for the exact one and where there is one."""
    mode = str(settings.get("options", {}).get("mode", EXACT))
    return "" if mode == EXACT else mode


def mode_note(modes: Mapping[str, str], estimators: Iterable[str]) -> str:
    """A sentence on estimators shown that do not run as the paper ran them; empty without any."""
    names = [name for name in modes if name in set(estimators)]
    if not names:
        return ""
    shown = listing(f"{word(name)} in {modes[name]} mode" for name in names)
    return (
        f"{shown}: faster than the paper's programs and not the same numbers. Exact, with kernels of 25 px, they take "
        "several times as long (table of run times), too long for a default run: see recorded pictures."
    )


def published_table(path: Path) -> pd.DataFrame:
    """A file of published numbers, its columns named as ours.

    Args:
        path: of the file.

    Raises:
        InputError: see `any_table`.
    """
    return any_table(path).rename(columns=PUBLISHED_COLUMNS)


def paper_table(inputs: ReportInputs, name: str) -> pd.DataFrame | None:
    """A file of published numbers (`published_table`), or None where it is absent.

    Args:
        inputs: of the report.
        name: of the file.
    """
    path = existing(inputs.paper / name)
    return None if path is None else published_table(path)


def published(inputs: ReportInputs, name: str) -> pd.DataFrame | None:
    """A file of published numbers, those of the paper's Sim also under our name of its authors' frames.

    Args:
        inputs: of the report.
        name: of the file.
    """
    import pandas as pd

    table = paper_table(inputs, name)
    if table is None or "dataset" not in table:
        return table
    again = [table[table["dataset"] == theirs].assign(dataset=ours) for ours, theirs in PAPER_NAMES.items()]
    return pd.concat([table, *again], ignore_index=True)


def at_frequencies(table: pd.DataFrame) -> pd.DataFrame:
    """Published curves with ``at``: the frequency that the paper names in their column ``frequency``, exactly."""
    return table.assign(at=[FREQUENCIES[NOMINAL_FREQUENCIES.index(value)] for value in table["frequency"]])


def members(folder: Path | None, chosen: frozenset[str] | None) -> list[Path]:
    """Folders of stage members that exist, the given one itself among them, sorted.

    Args:
        folder: that holds a sub-folder for each member, or None.
        chosen: names of the sub-folders that count; None takes all.
    """
    parent = existing(folder)
    folders = sorted({path.parent for path in parent.rglob("*.parquet")}) if parent is not None else []
    return [path for path in folders if chosen is None or path.name in chosen]


def _joined(folders: Iterable[Path], name: str, schema: Schema) -> pd.DataFrame:
    """One table of several folders; empty, with its columns, where none holds it."""
    import pandas as pd

    parts = [read_table(folder / name, schema) for folder in folders if (folder / name).exists()]
    if not parts:
        return schema.conform(pd.DataFrame({column: [] for column in schema.columns}))
    return pd.concat(parts, ignore_index=True)


def noise_tables(inputs: ReportInputs) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Noise estimates of every dataset and estimator (empty where none is).

    Returns:
        summary (`pipeline.tables.NOISE_SUMMARY`), estimates (`pipeline.tables.NOISE_ESTIMATES`).
    """
    folders = members(inputs.noise, inputs.noise_members)
    summary = _joined(folders, "summary.parquet", tables.NOISE_SUMMARY)
    return summary, _joined(folders, "estimates.parquet", tables.NOISE_ESTIMATES)


def _blur(inputs: ReportInputs, file: str, schema: Schema) -> pd.DataFrame:
    """A table of the stage `blur` of all datasets and estimators, without added noise."""
    rows = _joined(members(inputs.blur, inputs.blur_members), file, schema)
    return rows[rows["target_sigma_dn"] == 0].reset_index(drop=True)


def blur_summary(inputs: ReportInputs) -> pd.DataFrame:
    """Blur summaries of all datasets and estimators, without noise: `pipeline.experiments.tables.BLUR_SUMMARY`."""
    return _blur(inputs, "summary.parquet", BLUR_SUMMARY)


def blur_estimates(inputs: ReportInputs) -> pd.DataFrame:
    """Blur estimates of every patch, without added noise: `pipeline.experiments.tables.BLUR_ESTIMATES`."""
    return _blur(inputs, "estimates.parquet", BLUR_ESTIMATES)


def combined_tables(inputs: ReportInputs) -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    """Statistics of blur and noise at once, each of all datasets as one table (empty where none is).

    Returns:
        blur (`BLUR_CELLS`), noise (`NOISE_CELLS`) and the example's curves (`CURVES`) of
        `pipeline.experiments.tables`.
    """
    folders = inputs.combined.values()
    names = {"blur.parquet": BLUR_CELLS, "noise.parquet": NOISE_CELLS, "curves.parquet": CURVES}
    blur, noise, curves = (_joined(folders, name, schema) for name, schema in names.items())
    return blur, noise, curves


def denoised_cells(inputs: ReportInputs) -> pd.DataFrame:
    """Errors with denoising before estimation: `pipeline.experiments.tables.BLUR_CELLS`; empty where none is."""
    return _joined(inputs.denoised.values(), "blur.parquet", BLUR_CELLS)
