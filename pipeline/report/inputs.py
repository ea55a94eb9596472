"""What a report is made of: outputs of the stages, published numbers, records. What is absent is shown as not run."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from inspect import signature
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
import pandas as pd

from pipeline import tables
from pipeline.blur import REGISTRY
from pipeline.camera.mtf import FREQUENCIES, SYSTEM
from pipeline.errors import InputError, did_you_mean
from pipeline.experiments.factors import KERNEL_ESTIMATORS
from pipeline.experiments.recorded.blur import EXACT
from pipeline.experiments.recorded.frames import COMBINED_FILES, DENOISED_FILE, NOISE_FILE, joined, with_records
from pipeline.experiments.sharp_curves import NOMINAL_FREQUENCIES
from pipeline.experiments.tables import BLUR_CELLS, BLUR_ESTIMATES, BLUR_SUMMARY, CURVES, NOISE_CELLS
from pipeline.report.display_names import DATASETS, PAPER_NAMES, in_order, listing, word
from pipeline.report.tables import where
from pipeline.stage_files import any_table, benchmark_record, described, existing, optional
from pipeline.store import Schema

PUBLISHED_COLUMNS = {
    "blur": "blur_kind",
    "size_px": "kernel_size_px",
    "effect": "noise_source",
    "level_dn": "target_sigma_dn",
}
"""Columns of the files of published numbers -> as our tables call them."""

Shown = TypeVar("Shown")
NO_STAGE = "(no stage of this version makes it)"


class Result(NamedTuple):
    """A table that every member of a stage makes: its file and schema, and its file in a record of recorded frames."""

    stage: str
    file: str
    schema: Schema
    recorded: str = ""


RESULTS: Mapping[str, Result] = {
    "noise_summary": Result("noise", "summary.parquet", tables.NOISE_SUMMARY, NOISE_FILE),
    "noise_estimates": Result("noise", "estimates.parquet", tables.NOISE_ESTIMATES),
    "blur_summary": Result("blur", "summary.parquet", BLUR_SUMMARY),
    "blur_estimates": Result("blur", "estimates.parquet", BLUR_ESTIMATES),
    "combined_blur": Result("combined", "blur.parquet", BLUR_CELLS, COMBINED_FILES[0]),
    "combined_noise": Result("combined", "noise.parquet", NOISE_CELLS, COMBINED_FILES[1]),
    "combined_curves": Result("combined", "curves.parquet", CURVES, COMBINED_FILES[2]),
    "denoised_blur": Result("denoised_blur", "blur.parquet", BLUR_CELLS, DENOISED_FILE),
}
"""Tables over datasets and estimators that sections, the ledger and claims share."""


class Benchmark(NamedTuple):
    """A benchmark whose record a section shows: its name, the command that makes it, and what it holds at least."""

    name: str
    command: str
    keys: tuple[str, ...]


class Arrays(dict[str, np.ndarray]):
    """Arrays by name, of a file that a stage stored; an absent one is an `InputError` that names it."""

    def __missing__(self, name: str) -> np.ndarray:
        raise InputError(f"no array '{name}' among those stored; {did_you_mean(name, self)}; run the stage again")


@dataclass(frozen=True)
class ReportInputs:
    """Folders and files of everything before the report. What does not exist counts as not run.

    Attributes:
        paper: folder of published numbers (``data/paper``).
        data: folder of the stages' outputs: ``<stage>/<file>``, or ``<stage>/<member>/<file>`` where a stage is run for
            each dataset (and estimator), e.g. ``blur/sim-pmp/summary.parquet``; None where no stage has run.
        members: stage -> those of its members that belong to this run, in order; all that there are of other stages.
        weights: folder of released networks, each with its learning curve (`pipeline.learning.learning_curve`).
        ablation: folder of measures of short trainings with one thing changed; `ablations`: which of them, in order.
        recorded: folder whose sub-folders hold detection (`pipeline.recording.detection`), blur
            (`pipeline.recording.blur`), noise (`pipeline.recording.real_noise`) and sensor constants
            (`pipeline.recording.sensor`) measured on pictures that are not kept.
        benchmarks: name of a benchmark -> its record on declared hardware (``benchmarks/results/<name>.json``).
        absent: dataset without data -> the command that runs it.
        detectors_absent: detector without weights -> the line that would get them and run it.
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
    data: Path | None = None
    members: Mapping[str, Sequence[str]] = field(default_factory=dict)
    weights: Path | None = None
    ablation: Path | None = None
    ablations: Sequence[str] = ()
    recorded: Path | None = None
    benchmarks: Mapping[str, Path] = field(default_factory=dict)
    absent: Mapping[str, str] = field(default_factory=dict)
    detectors_absent: Mapping[str, str] = field(default_factory=dict)
    lock: Path | None = None
    stages: frozenset[str] | None = None
    aliases: Mapping[str, str] = field(default_factory=dict)
    code_version: str = ""
    profile: str = "default"
    runs: Mapping[str, str] = field(default_factory=dict)
    modes: Mapping[str, str] = field(default_factory=dict)
    seed: int = 0

    def read(self, path: str, schema: Schema | None = None) -> Any:
        """A file of a stage, or None where it has not run (`pipeline.stage_files.optional`)."""
        return optional(self.data, path, schema)

    def arrays(self, path: str) -> Arrays:
        """The arrays of a stage's file, none where it has not run."""
        return Arrays(self.read(path) or {})

    def folder(self, stage: str) -> Path | None:
        """The folder of a stage's outputs, which need not exist; None where no stage has run."""
        return None if self.data is None else self.data / stage

    def folders(self, stage: str) -> dict[str, Path]:
        """Member of a stage that belongs to this run -> its folder, which need not exist."""
        parent = self.folder(stage)
        there = existing(parent)
        known = sorted(path.name for path in there.iterdir() if path.is_dir()) if there is not None else []
        return {name: parent / name for name in self.members.get(stage, known)} if parent is not None else {}

    def pairs(self, stage: str) -> list[tuple[str, str]]:
        """Dataset and estimator, or detector, of each member of a stage."""
        return [(dataset, name) for dataset, _, name in (member.partition("-") for member in self.folders(stage))]

    def each(self, stage: str, file: str, schema: Schema | None = None) -> dict[str, Any]:
        """Member of a stage -> a file of it, of those members that have it, in the paper's order of datasets."""
        contents = {name: optional(folder, file, schema) for name, folder in self.folders(stage).items()}
        return {name: contents[name] for name in in_order(contents, DATASETS) if contents[name] is not None}

    def galleries(
        self, stage: str, file: str, alike: Sequence[str], also: Sequence[str] = ()
    ) -> dict[str, list[tuple[dict[str, Any], Arrays]]]:
        """Pictures that members of a stage stored, one estimator each: dataset -> their descriptions and arrays.

        Descriptions of a dataset have to agree in the keys ``alike``.

        Raises:
            InputError: a description lacks a key, or members show different things.
        """
        stored: dict[str, list[tuple[dict[str, Any], Arrays]]] = {}
        for member, folder in self.folders(stage).items():
            about = described(folder, f"{file}.json", ("dataset", "estimator", *alike, *also))
            if about is not None:
                pair = about, self.arrays(f"{stage}/{member}/{file}.npz")
                stored.setdefault(about["dataset"], []).append(pair)
        for dataset, shown in stored.items():
            if any(about[key] != shown[0][0][key] for about, _ in shown for key in alike):
                raise InputError(
                    f"{file}.json of '{dataset}' show different frames or patches; run the stage {stage} again for all"
                )
        return stored

    def result(self, name: str) -> pd.DataFrame:
        """One of `RESULTS` over all members of its stage; empty, with its columns, where none has run."""
        about = RESULTS[name]
        parts = list(self.each(about.stage, about.file, about.schema).values())
        empty = pd.DataFrame({column: [] for column in about.schema.columns})
        return pd.concat(parts, ignore_index=True) if parts else about.schema.conform(empty)

    def noiseless(self, name: str) -> pd.DataFrame:
        """Rows of one of `RESULTS` without added noise."""
        return where(self.result(name), target_sigma_dn=0).reset_index(drop=True)

    def recorded_result(self, name: str) -> pd.DataFrame:
        """One of `RESULTS` over all records of recorded frames; empty, with its columns, where there are none."""
        return joined(self.recorded, RESULTS[name].recorded)

    def result_with_records(self, name: str) -> pd.DataFrame:
        """One of `RESULTS`, with records of datasets on which its stage has not run."""
        return with_records(self.result(name), self.recorded, RESULTS[name].recorded)

    def benchmark(self, benchmark: Benchmark, made: Callable[[Any], Shown]) -> Shown | None:
        """What is made of a benchmark's record, or None where there is no record.

        Raises:
            InputError: the record holds something else.
        """
        path = self.benchmarks.get(benchmark.name)
        record = benchmark_record(path, benchmark.keys, benchmark.command)
        try:
            return None if record is None else made(record)
        except (AttributeError, LookupError, TypeError, ValueError, ZeroDivisionError):
            raise InputError(
                f"{path}: not a record of this benchmark; make the record again: {benchmark.command}"
            ) from None

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
        return in_order([*self.folders("index"), *self.folders("corrupt"), *self.absent], DATASETS)


def relative_mtf(table: pd.DataFrame) -> dict[str, str]:
    """Estimators whose MTF, before any division, is not that of the system -> what it is relative to."""
    ordered = table.sort_values("calibrated", kind="stable") if "calibrated" in table else table
    first = ordered.groupby("estimator", sort=False)["relative_to"].first()
    return {str(name): str(to) for name, to in first.items() if to != SYSTEM}


def options_of(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Options of a blur estimator; of one of the paper's programs with the defaults of those left out.

    Args:
        settings: ``kind``, its registry name, and ``options``; without a kind no defaults are known.

    Raises:
        InputError: the program's module cannot be imported.
    """
    options = dict(settings.get("options", {}))
    if settings.get("kind") not in KERNEL_ESTIMATORS:
        return options
    parameters = signature(REGISTRY.get(settings["kind"])).parameters.values()
    return {parameter.name: parameter.default for parameter in parameters} | options


def mode_of(settings: Mapping[str, Any]) -> str:
    """Mode of a blur estimator that has several, e.g. ``"fast"``; empty for the exact one and where there is one.

    Args:
        settings: see `options_of`; a mode left out is the estimator's default.
    """
    mode = str(options_of(settings).get("mode", EXACT))
    return "" if mode == EXACT else mode


def mode_note(modes: Mapping[str, str], estimators: Iterable[str]) -> str:
    """A sentence on estimators shown that do not run as the paper ran them; empty without any."""
    names = [name for name in modes if name in set(estimators)]
    if not names:
        return ""
    shown = listing(f"{word(name)} in {modes[name]} mode" for name in names)
    return (
        f"{shown}: faster than the paper's programs and not the same numbers. Exact, with kernels of 25 px, they take "
        "several times as long (table of run times), too long for a default run; they were run on recorded frames."
    )


def published_table(path: Path) -> pd.DataFrame:
    """A file of published numbers, its columns named as ours.

    Raises:
        InputError: there is no such file, or it is broken.
    """
    if not path.exists():
        raise InputError(f"{path}: no such file of published numbers; restore data/paper from git")
    return any_table(path).rename(columns=PUBLISHED_COLUMNS)


def published(inputs: ReportInputs, file: str) -> pd.DataFrame:
    """`published_table`, with the numbers of the paper's Sim also under our name of its authors' frames."""
    table = published_table(inputs.paper / file)
    if "dataset" not in table:
        return table
    again = [where(table, dataset=theirs).assign(dataset=ours) for ours, theirs in PAPER_NAMES.items()]
    return pd.concat([table, *again], ignore_index=True)


def at_frequencies(table: pd.DataFrame) -> pd.DataFrame:
    """Published curves with ``at``: the frequency that the paper names in their column ``frequency``, exactly."""
    return table.assign(at=[FREQUENCIES[NOMINAL_FREQUENCIES.index(value)] for value in table["frequency"]])
