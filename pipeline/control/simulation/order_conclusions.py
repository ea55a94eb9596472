"""Which conclusions of the paper survive the detector's order of photon noise and blur, and linear light.

A conclusion holds where the paired 95 % interval of its effect (``effects.parquet`` of the stage `order_study`)
excludes 0 on the side that it states.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd

PAPER, DETECTOR = "paper", "detector"
ENCODED, LINEAR = "encoded", "linear"
KEPT_FRACTION = 0.8
"""Photon noise counts as softened by the blur where less than this fraction of its unblurred amount is present."""

Verdict = bool | None


@dataclass(frozen=True)
class Conclusion:
    """A conclusion of the paper and what the study measures of it.

    Attributes:
        claim: in words.
        cause: of the effect (``noise`` or ``motion``); empty where noise left by the blur decides.
        measure: column of the effect.
        sign: of the change that the claim states.
    """

    claim: str
    cause: str = ""
    measure: str = ""
    sign: int = 1


CONCLUSIONS = (
    Conclusion("Blur softens photon noise: less of it is present in a blurred frame"),
    Conclusion(
        "Photon noise disturbs the estimate of a blur (advice: avoid photon noise): AMAE grows with it",
        "noise",
        "amae_percent",
    ),
    Conclusion("AP falls with photon noise", "noise", "ap_percent", -1),
    Conclusion("AP falls with motion blur", "motion", "ap_percent", -1),
)
SETTINGS = ((PAPER, ENCODED), (DETECTOR, ENCODED), (PAPER, LINEAR), (DETECTOR, LINEAR))


@dataclass(frozen=True, eq=False)
class StudyTables:
    """Both tables of the stage: conditions, and the effects of noise and motion with paired intervals."""

    conditions: pd.DataFrame
    effects: pd.DataFrame

    def at(self, setting: tuple[str, str]) -> pd.DataFrame:
        """Conditions of an order and a light."""
        order, light = setting
        return self.conditions[(self.conditions["order"] == order) & (self.conditions["light"] == light)]

    def kept(self, setting: tuple[str, str]) -> float:
        """Noise present under the longest motion as a fraction of that without motion, at the strongest noise."""
        rows = self.at(setting)
        rows = rows[rows["target_sigma_dn"] == rows["target_sigma_dn"].max()].sort_values("motion_px")
        return float(rows["clipped_sigma_dn"].iloc[-1] / rows["clipped_sigma_dn"].iloc[0])

    def effect(self, conclusion: Conclusion, setting: tuple[str, str]) -> dict[str, Any] | None:
        """The effect that decides a conclusion; None where the study has one level of its cause."""
        rows = self.effects
        for column, value in zip(
            ("order", "light", "cause", "measure"), (*setting, conclusion.cause, conclusion.measure), strict=True
        ):
            rows = rows[rows[column] == value]
        return {str(name): value for name, value in rows.iloc[0].items()} if len(rows) else None

    def holds(self, conclusion: Conclusion, setting: tuple[str, str]) -> Verdict:
        """Whether the numbers of one order and light support a conclusion; None where they do not decide."""
        if not conclusion.cause:
            return self.kept(setting) < KEPT_FRACTION
        effect = self.effect(conclusion, setting)
        if effect is None:
            return None
        ends = sorted((conclusion.sign * effect["low"], conclusion.sign * effect["high"]))
        return True if ends[0] > 0 else False if ends[1] < 0 else None

    def survival(self, conclusion: Conclusion) -> str:
        """The word of the verdict under the detector's order, in both lights."""
        detector = [self.holds(conclusion, (DETECTOR, light)) for light in (ENCODED, LINEAR)]
        if all(detector):
            return "survives"
        if any(verdict is False for verdict in detector):
            paper = self.holds(conclusion, (PAPER, ENCODED))
            return "holds in the paper's order only" if paper else "does not survive"
        return "not decided"
