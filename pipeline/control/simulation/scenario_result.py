"""The result of one closed-loop scenario, and comparisons of its policies by paired differences of AP."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pandas as pd

OURS = ("iopc_optimal", "iopc_continuous")
BRIGHTNESS_ONLY = ("mean_intensity", "fixed", "shim", "shin2019")
"""Policies without knowledge of motion that ours are compared with."""

LIGHT_STEP_STOPS = 3.0


@dataclass(frozen=True, eq=False)
class ScenarioResult:
    """One scenario of the closed loop.

    Attributes:
        name: of the scenario.
        steps: `pipeline.control.simulation.tables.STEPS`.
        summary: `pipeline.control.simulation.tables.SUMMARY`.
        pairs: `pipeline.control.simulation.tables.PAIRS`.
        films: policy -> step -> (h, w) uint8 picture of the leading viewpoint.
    """

    name: str
    steps: pd.DataFrame
    summary: pd.DataFrame
    pairs: pd.DataFrame
    films: Mapping[str, Mapping[int, NDArray[np.uint8]]]

    @property
    def is_demanding(self) -> bool:
        """Whether motion and noise have to be traded; see `Scenario.motion_in_poor_light`."""
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

    def compared(self, policy: str) -> dict[str, tuple[float, float, float]]:
        """Policies that know no motion and that ran -> `difference` of a policy to each; empty if it did not run."""
        known = {other: self.difference(policy, other) for other in BRIGHTNESS_ONLY}
        return {other: difference for other, difference in known.items() if difference is not None}

    def exceeded(self, policy: str) -> list[str]:
        """Policies that know no motion, and that a policy exceeds: the interval of the difference lies above 0."""
        return [other for other, (_, low, _) in self.compared(policy).items() if low > 0]

    def not_exceeded(self, policy: str) -> list[str]:
        """Policies that know no motion, that ran, and that a policy does not exceed."""
        return [other for other, (_, low, _) in self.compared(policy).items() if not low > 0]

    def exceeding(self, policy: str) -> list[str]:
        """Policies that know no motion, and that exceed a policy: the interval of the difference lies below 0."""
        return [other for other, (_, _, high) in self.compared(policy).items() if high < 0]

    def beats_all(self, policy: str) -> bool:
        """Whether a policy exceeds every policy that knows no motion, of those that ran; False where none did."""
        return bool(self.compared(policy)) and not self.not_exceeded(policy)

    @property
    def not_run(self) -> list[str]:
        """Policies of `OURS` and `BRIGHTNESS_ONLY` that did not run in this scenario."""
        ran = set(self.summary["policy"])
        return [policy for policy in (*OURS, *BRIGHTNESS_ONLY) if policy not in ran]

    def measure(self, policy: str, name: str) -> float | None:
        """A column of the summary for a policy; None where it did not run."""
        rows = self.summary.loc[self.summary["policy"] == policy, name]
        return float(rows.iloc[0]) if len(rows) else None

    def largest_loss_percent(self, policy: str) -> float | None:
        """How far AP of a policy is below the best of those that know no motion, points; None where none ran."""
        losses = [-points for points, _, _ in self.compared(policy).values()]
        return max(losses) if losses else None


def rises(knots: pd.DataFrame) -> list[tuple[float, float]]:
    """Where the measured surface is not monotonic with certainty.

    Args:
        knots: `pipeline.control.simulation.tables.KNOTS`.

    Returns:
        noise (DN) and motion (px) of knots whose AP exceeds, beyond both intervals, that at less noise or shorter
        motion.
    """
    certain = []
    for _, table in knots.groupby("level"):
        cells = {(row["target_sigma_dn"], row["motion_px"]): row for row in table.to_dict("records")}
        levels, motions = (sorted(set(table[name])) for name in ("target_sigma_dn", "motion_px"))
        for (level, motion), row in cells.items():
            down, across = levels.index(level), motions.index(motion)
            before = [cells[levels[down - 1], motion]] if down else []
            before += [cells[level, motions[across - 1]]] if across else []
            if any(row["low_percent"] > other["high_percent"] for other in before):
                certain.append((float(level), float(motion)))
    return certain
