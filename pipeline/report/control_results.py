"""The files of the closed-loop stages: a `ScenarioResult` for each scenario that ran; and the words for policies."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.control.scenario_result import ScenarioResult
from pipeline.control.tables import PAIRS, STEPS, SUMMARY
from pipeline.report.inputs import ReportInputs
from pipeline.stage_files import optional

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
_STEP = re.compile(r"^step_(\d+)$")


def policy_word(name: str) -> str:
    """The word for a policy."""
    return POLICIES.get(name, name.replace("_", " "))


def scenario_word(name: str) -> str:
    """The word for a scenario."""
    return name.replace("_", " ").capitalize()


def scenario_results(inputs: ReportInputs) -> list[ScenarioResult]:
    """Every scenario of this run whose stage has run, in order."""
    results = []
    for name, folder in inputs.folders("closed_loop").items():
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
    keys, command = ("machine", "decision"), "python benchmarks/control.py"
    content: Mapping[str, Any] | None = inputs.benchmark("control", keys, command)
    if content is None:
        return {}
    return {name: float(times["processor_median_ms"]) for name, times in content["decision"].items()}
