"""How a policy did in a scenario: average precision and regret, transients, ripple, frames lost, abstentions."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.cluster_intervals import bias_corrected
from pipeline.control.decision import Action
from pipeline.control.motion import motion_length
from pipeline.control.simulation.course import settling_frames
from pipeline.control.simulation.loop import StepRecord
from pipeline.control.simulation.scenario import Scenario
from pipeline.control.simulation.scoring import Score, average_precision
from pipeline.control.simulation.tables import PAIRS, STEPS, SUMMARY
from pipeline.detection.base import Detections
from pipeline.errors import InputError, did_you_mean
from pipeline.streams import stream

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.detection.settings import EvaluationSettings

LOST_SATURATED, LOST_MEAN = 0.25, 0.05
CEILING = "oracle"
"""Policy that regret is measured against."""


def steps_table(
    scenario: Scenario,
    policy: str,
    fold: int,
    records: Sequence[StepRecord],
    criteria: EvaluationSettings,
    reference: NDArray[np.float64],
    seed: int,
) -> pd.DataFrame:
    """One row per step: schema `STEPS`."""
    import pandas as pd

    rows: list[dict[str, Any]] = []
    without_interval = criteria.model_copy(update={"bootstrap_draws": 1})
    for record in records:
        mtf = record.estimate_mtf
        sigma = record.estimate_sigma_dn
        rows.append(
            {
                "scenario": scenario.name,
                "policy": policy,
                "fold": fold,
                "step": record.step,
                "light": record.light,
                "speed_px_s": record.speed_px_s,
                "exposure_ms": record.state.exposure_ms,
                "iso": record.state.iso,
                "motion_px": record.blur_px,
                "sigma_dn": record.sigma_dn,
                "mean_level": record.mean_level,
                "saturated_fraction": record.saturated_fraction,
                "estimated_sigma_dn": float("nan") if sigma is None else float(sigma.value),
                "estimated_motion_px": float("nan") if mtf is None else motion_length(mtf, reference).value_px,
                "action": str(record.decision.action.value),
                "reason": record.decision.reason,
                "expected_ap_percent": record.decision.ap_percent,
                "ap_percent": score([record], without_interval, seed).ap_percent,
            }
        )
    return STEPS.conform(pd.DataFrame(rows))


def score(records: Sequence[StepRecord], criteria: EvaluationSettings, seed: int) -> Score:
    """Average precision over all views of all records; equal seeds resample the same viewpoints."""
    results = [Detections.of(**arrays) for record in records for arrays in record.detections]
    seen = [view for record in records for view in record.views]
    return average_precision(results, seen, criteria, stream(seed, "closed loop score"))


def transients(scenario: Scenario, table: pd.DataFrame) -> dict[str, float]:
    """Settling, overshoot and ripple of brightness over the disturbances of a scenario, worst fold.

    Args:
        scenario: the drive.
        table: schema `STEPS` of one policy.

    Returns:
        ``settling_frames``, ``overshoot_stops`` and ``ripple_stops``. All are NaN where no part between disturbances
        shows new settings twice; settling also where a part did not settle, ripple where none settled for three frames.
    """
    settling: list[float] = []
    overshoot: list[float] = []
    ripple: list[float] = []
    edges = [*scenario.disturbances, scenario.steps]
    groups: Any = table.groupby("fold")
    for _, rows in groups:
        ordered = rows.sort_values("step")
        light, time, iso = (ordered[name].to_numpy() for name in ("light", "exposure_ms", "iso"))
        stops = np.log2(light * time * iso)
        for start, end in itertools.pairwise(edges):
            if end - start < 3 + scenario.delay_frames:  # too short to show new settings twice
                continue
            frames = settling_frames(stops, start, end)
            settling.append(frames)
            part = stops[start:end] - stops[end - 1]
            came = np.sign(part[0]) or 1.0
            overshoot.append(float(max(0.0, (-came * part).max())))
            if np.isfinite(frames) and end - start - int(frames) > 2:
                ripple.append(float(np.std(np.log2(time[start + int(frames) : end]))))
    measured = {"settling_frames": settling, "overshoot_stops": overshoot, "ripple_stops": ripple}
    return {name: _largest(values) for name, values in measured.items()}


def _largest(values: Sequence[float]) -> float:
    """The largest of some values; NaN where there is none, or one of them is NaN."""
    return float(np.max(values)) if values else math.nan


def summary(
    scenario: Scenario,
    tables: Mapping[str, pd.DataFrame],
    records: Mapping[str, Sequence[StepRecord]],
    criteria: EvaluationSettings,
    seed: int,
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Policies of one scenario side by side, and their paired differences.

    Args:
        scenario: the drive.
        tables: policy -> `STEPS` of all folds.
        records: policy -> records of all folds.
        criteria: how detections are judged.
        seed: of the bootstrap.

    Returns:
        schemas `SUMMARY` and `PAIRS`; regret is NaN where `CEILING` did not run.
    """
    import pandas as pd

    scores = {name: score(parts, criteria, seed) for name, parts in records.items()}
    rows, pairs = [], []
    for name, table in tables.items():
        lost = (table["saturated_fraction"] > LOST_SATURATED) | (table["mean_level"] < LOST_MEAN)
        selected = scores[name]
        regret = paired(scores[CEILING], selected) if CEILING in scores else (float("nan"),) * 3
        rows.append(
            {
                "scenario": scenario.name,
                "policy": name,
                "ap_percent": selected.ap_percent,
                "low_percent": selected.low_percent,
                "high_percent": selected.high_percent,
                **dict(zip(("regret_percent", "regret_low_percent", "regret_high_percent"), regret, strict=True)),
                **transients(scenario, table),
                "frames_lost_percent": 100.0 * float(lost.mean()),
                "abstained_percent": 100.0 * float((table["action"] == Action.ABSTAINED.value).mean()),
                "refused_percent": 100.0 * float((table["action"] == Action.REFUSED.value).mean()),
                "probes_percent": 100.0 * float((table["action"] == Action.PROBE.value).mean()),
                "objects": selected.objects,
                "frames": sum(len(record.views) for record in records[name]),
                "motion_in_poor_light": scenario.motion_in_poor_light,
            }
        )
        for other in tables:
            if other != name:
                difference = dict(
                    zip(
                        ("difference_percent", "low_percent", "high_percent"),
                        paired(selected, scores[other]),
                        strict=True,
                    )
                )
                pairs.append({"scenario": scenario.name, "policy": name, "other": other, **difference})
    empty = pd.DataFrame(pairs, columns=list(PAIRS.columns))
    return SUMMARY.conform(pd.DataFrame(rows)), PAIRS.conform(empty)


def metrics(table: pd.DataFrame) -> dict[str, dict[str, float]]:
    """Metrics of a scenario for comparing runs.

    Args:
        table: schema `SUMMARY` of one scenario.

    Returns:
        policy -> average precision, regret and frames lost, percent; without those that are unknown, as the regret is
        where the oracle did not run.
    """
    names = ("ap_percent", "regret_percent", "frames_lost_percent")
    return {
        str(row["policy"]): {name: float(row[name]) for name in names if np.isfinite(row[name])}
        for row in table.to_dict("records")
    }


def named_scenario(scenarios: Mapping[str, Any], name: str) -> Any:
    """A scenario's section.

    Raises:
        InputError: there is none of this name.
    """
    if name not in scenarios:
        raise InputError(f"job.scenario={name}: not in control.scenarios; {did_you_mean(name, scenarios)}")
    return scenarios[name]


def paired(one: Score, other: Score) -> tuple[float, float, float]:
    """Difference of two average precisions on the same viewpoints, with its bootstrap 95 % interval."""
    difference = one.ap_percent - other.ap_percent
    viewpoints = min(one.viewpoints, other.viewpoints)
    return difference, *bias_corrected(one.draws - other.draws, difference, viewpoints, bounds=(-100.0, 100.0))
