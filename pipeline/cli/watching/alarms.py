"""Alarms of a watched source: when each begins and clears, and its words."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pipeline.cli.analysis.flag_words import line_noise_dn, words_of_flag

if TYPE_CHECKING:
    from pipeline.cli.analysis.frame import Thresholds

CLEAR_FRAMES = 3
"""Frames known to keep the threshold, with none between them that violates it, that clear an alarm, so that a value
close to it does not flap. Undecided frames between them do not count: where some come again and again the alarm would
never clear, and a later violation would be no event."""


class ActiveAlarms:
    """Follows alarms from frame to frame."""

    def __init__(self) -> None:
        self._kept: dict[str, int] = {}  # active alarms, each with its frames without violation since the last one

    def update(self, violated: list[str], undecided: list[str]) -> tuple[list[str], list[str]]:
        """Take the alarms of the next frame.

        Args:
            violated: names of the alarms that the frame raises.
            undecided: names of those that it does not decide; they neither begin nor clear with it.

        Returns:
            names of the alarms that begin and of those that clear with this frame.
        """
        begun = [name for name in violated if name not in self._kept]
        self._kept |= dict.fromkeys(violated, 0)
        for name in self._kept:
            if name not in violated and name not in undecided:
                self._kept[name] += 1
        ended = [name for name, frames in self._kept.items() if frames >= CLEAR_FRAMES]
        for name in ended:
            del self._kept[name]
        return begun, ended


def alarm_words(name: str, row: dict[str, Any], thresholds: Thresholds) -> str:
    """Why a frame raises an alarm that is not of a trend.

    Args:
        name: ``noise``, ``blur horizontal``, ``blur vertical`` or a flag.
        row: of the frame (`pipeline.cli.analysis.frame.FrameAnalysis.analyse`).
        thresholds: of alarms.
    """
    if name == "noise" and thresholds.sigma_dn is not None:
        return f"{_noise_words(row, thresholds.sigma_dn)}, above {thresholds.sigma_dn:g} DN"
    if name.startswith("blur "):
        axis = name.removeprefix("blur ")
        return f"MTF50 {axis} {row[f'mtf50_{axis}']:.3f}, below {thresholds.mtf50:g} of Nyquist"
    return f"frame flagged {words_of_flag(name, row)}"


def _noise_words(row: dict[str, Any], most_sigma_dn: float) -> str:
    """Which noise of a frame is above a threshold (`pipeline.cli.analysis.rows.alarms`)."""
    from pipeline.noise.abstentions import LARGEST_DN

    if row["sigma_dn"] > most_sigma_dn:
        return f"noise {row['sigma_dn']:.2f} DN"
    if line_noise_dn(row) > most_sigma_dn:
        return f"noise of whole rows or columns {line_noise_dn(row):.2f} DN"
    return f"noise beyond {LARGEST_DN:g} DN"
