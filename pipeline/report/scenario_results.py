"""Results of the closed loop's scenarios, as the stages of this run wrote them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.control.simulation.scenario_result import ScenarioResult
from pipeline.control.simulation.tables import PAIRS, STEPS, SUMMARY
from pipeline.report.inputs import ReportInputs
from pipeline.stage_files import optional


def scenario_results(inputs: ReportInputs) -> list[ScenarioResult]:
    """Every scenario of this run whose stage has run, in order."""
    results = []
    for name, folder in inputs.folders("closed_loop").items():
        steps = optional(folder, "steps.parquet", STEPS)
        if steps is not None:
            summary, pairs = optional(folder, "summary.parquet", SUMMARY), optional(folder, "pairs.parquet", PAIRS)
            films = {path.stem.removeprefix("film-"): _film(path) for path in sorted(folder.glob("film-*.npz"))}
            results.append(ScenarioResult(name, steps, summary, pairs, films))
    return results


def _film(path: Path) -> dict[int, NDArray[np.uint8]]:
    """Number of the step, in the names ``step_<number>`` of a film's arrays -> picture."""
    arrays = optional(path.parent, path.name)
    return {int(name[5:]): arrays[name] for name in sorted(arrays) if name.startswith("step_")}
