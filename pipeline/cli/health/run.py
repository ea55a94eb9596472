"""What is known of a run of ``camera-monitor health`` while it goes on, and as one JSON object."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

from pipeline.cli.health.verdict import run_verdict


@dataclass
class HealthRun:
    """What is known of a run while it goes on.

    Attributes:
        about: estimators, settings, version.
        rows: of the finished frames.
        set_aside: one reason per file or frame that could not be used.
        hinted: pictures that seem to hold values of fewer bits in 16, by that number of bits, and under
            `pipeline.cli.frames.remarks.TURNED` those that metadata turn, under ``TRANSPARENT`` those with transparent
            pixels.
        trend_alarms: that began (`pipeline.cli.analysis.frame.FrameAnalysis.trend_alarms`).
        without_precision: why the expected precision is unknown, or empty.
        without_trend: the sentence that states what has no trend and why, or empty.
        complete: whether all frames were analysed; what fails after that, as where nobody reads the output, changes
            nothing of it.
    """

    about: dict[str, Any]
    rows: list[dict[str, Any]] = field(default_factory=list)
    set_aside: list[str] = field(default_factory=list)
    hinted: Counter[int] = field(default_factory=Counter)
    trend_alarms: list[dict[str, Any]] = field(default_factory=list)
    without_precision: str = ""
    without_trend: str = ""
    complete: bool = False

    def verdict(self) -> dict[str, Any]:
        """The verdict on the finished frames (`pipeline.cli.health.verdict.run_verdict`)."""
        return run_verdict(
            self.rows, without_precision=self.without_precision, trend_alarms=self.trend_alarms,
            without_trend=self.without_trend, set_aside=len(self.set_aside), hinted=self.hinted,
            relative_to=self.about["relative_to"],
        )  # fmt: skip

    def content(self) -> dict[str, Any]:
        """The run as one JSON object."""
        from pipeline.camera.mtf import FREQUENCIES

        alarmed, undecided = (sum(bool(row[name]) for row in self.rows) for name in ("alarms", "undecided"))
        return {
            **self.about, "verdict": self.verdict(), "alarmed_frames": alarmed, "undecided_frames": undecided,
            "complete": self.complete,
            "frequencies_of_nyquist": FREQUENCIES, "pictures": self.rows, "set_aside": self.set_aside,
            "trend_alarms": self.trend_alarms,
        }  # fmt: skip
