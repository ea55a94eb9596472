"""What the closed-loop stages left: one `ScenarioResult` for each scenario that ran, and the words for policies."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.control.tables import PAIRS, STEPS, SUMMARY
from pipeline.report.inputs import ReportInputs, described, optional

if TYPE_CHECKING:
    import pandas as pd

POLICIES = {
    "fixed": "Fixed",
    "mean_intensity": "Mean intensity",
    "prosilica": "Prosilica",
    "shim": "Shim",
    "shin2019": "Shin 2019",
    "iopc_target": "IOPC target",
    "iopc_optimal": "IOPC optimal",
    "iopc_continuous": "IOPC continuous",
    "iopc_lamp": "IOPC continuous, lamp",
    "oracle": "Oracle",
}
OURS = ("iopc_optimal", "iopc_continuous")
BRIGHTNESS_ONLY = ("mean_intensity", "fixed", "shim", "shin2019")
"""Policies without knowledge of motion that ours are compared with."""

LIGHT_STEP_STOPS = 3.0
_STEP = re.compile(r"^step_(\d+)$")


@dataclass(frozen=True, eq=False)
class ScenarioResult:
    """One scenario of the closed loop.

    Attributes:
        name: of the scenario.
        steps: `pipeline.control.tables.STEPS`.
        summary: `pipeline.control.tables.SUMMARY`.
        pairs: `pipeline.control.tables.PAIRS`.
        films: policy -> step -> (h, w) uint8 picture of the leading viewpoint.
    """

    name: str
    steps: pd.DataFrame
    summary: pd.DataFrame
    pairs: pd.DataFrame
    films: Mapping[str, Mapping[int, NDArray[np.uint8]]]

    @property
    def is_demanding(self) -> bool:
        """Whether the image moves in poor light (the scenario's flag): motion and noise have to be traded."""
        return bool(self.summary["motion_in_poor_light"].any())

    @property
    def stands(self) -> bool:
        """Whether nothing moves."""
        return bool((self.steps["speed_px_s"] == 0).all())

    @property
    def has_light_step(self) -> bool:
        """Whether the light changes eightfold or more from one frame to the next."""
        light = self.steps.groupby("step")["light"].median().sort_index().to_numpy()
        return bool((np.abs(np.diff(np.log2(light))) >= LIGHT_STEP_STOPS).any())

    def difference(self, policy: str, other: str) -> tuple[float, float, float] | None:
        """AP of a policy less that of another with its 95 % interval, percent points; None where one did not run."""
        rows = self.pairs[(self.pairs["policy"] == policy) & (self.pairs["other"] == other)]
        if rows.empty:
            return None
        row = rows.iloc[0]
        return float(row["difference_percent"]), float(row["low_percent"]), float(row["high_percent"])


def policy_word(name: str) -> str:
    """The word for a policy."""
    return POLICIES.get(name, name.replace("_", " "))


def scenario_word(name: str) -> str:
    """The word for a scenario."""
    return name.replace("_", " ").capitalize()


def scenario_results(inputs: ReportInputs) -> list[ScenarioResult]:
    """Every scenario of this run whose stage has run, in order."""
    if inputs.control is None:
        return []
    results = []
    for name in inputs.scenarios:
        folder = inputs.control / "closed_loop" / name
        steps = optional(folder, "steps.parquet", STEPS)
        if steps is None:
            continue
        summary, pairs = optional(folder, "summary.parquet", SUMMARY), optional(folder, "pairs.parquet", PAIRS)
        results.append(ScenarioResult(name, steps, summary, pairs, _films(folder)))
    return results


def _films(folder: Path) -> dict[str, dict[int, NDArray[np.uint8]]]:
    films = {}
    for path in sorted(folder.glob("film-*.npz")):
        arrays = optional(folder, path.name) or {}
        pictures = {int(match[1]): arrays[name] for name in sorted(arrays) if (match := _STEP.match(name))}
        films[path.stem.removeprefix("film-")] = pictures
    return films


def decision_ms(inputs: ReportInputs) -> dict[str, float]:
    """Processor time of one decision by registry name of the policy, ms; empty without a record.

    Raises:
        InputError: the record holds something else.
    """
    if inputs.decision_times is None:
        return {}
    content: Mapping[str, Any] | None = described(
        inputs.decision_times.parent,
        inputs.decision_times.name,
        ("machine", "decision"),
        "make the record again: python benchmarks/control.py",
    )
    if content is None:
        return {}
    return {name: float(times["processor_median_ms"]) for name, times in content["decision"].items()}
