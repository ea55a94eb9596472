"""What has no trend, or no reliable one, in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pipeline.condition.change_point import LEAST_REFERENCE
from pipeline.condition.trend import QUANTITIES
from pipeline.errors import printable

if TYPE_CHECKING:
    from pipeline.cli.analysis.frame import FrameAnalysis


def without_trend(analysis: FrameAnalysis, reference_frames: int) -> str:
    """Which quantities have no trend, or no reliable one, and why; empty where all have one or none is expected.

    Args:
        analysis: of the frames so far.
        reference_frames: that a trend is compared with.
    """
    series = [trend.learning for trend in analysis.trends.values()]
    if not series:
        return ""
    sentences = _drifted(analysis, reference_frames)
    counts = {name: max(part[name] for part in series) for name in QUANTITIES if all(name in part for part in series)}
    if counts:
        of = "" if len(counts) == len(QUANTITIES) else f" of {', '.join(counts)}"
        frames = sorted({min(counts.values()), max(counts.values())})
        known = " to ".join(str(count) for count in frames)
        have = "frame of a series has" if frames == [1] else "frames of a series have"
        sentences.append(f"No trend{of}: {known} {have} an estimate, the reference alone takes {reference_frames}.")
    return " ".join(sentences)


def _drifted(analysis: FrameAnalysis, reference_frames: int) -> list[str]:
    """That quantities changed within their reference, so that later changes may not show: a sentence per series."""
    sentences = []
    for name, trend in analysis.trends.items():
        drifts = trend.drifts.values()
        if not drifts:
            continue
        where = f" in {printable(name)}" if len(analysis.trends) > 1 else ""
        words = "; ".join(drift.words() for drift in drifts)
        unreliable = [drift.quantity for drift in drifts if drift.instead is None]
        if unreliable:
            fewer = "give fewer --reference-frames, or " if reference_frames > LEAST_REFERENCE else ""
            sentences.append(
                f"No reliable trend of {', '.join(unreliable)}{where}: changed within the reference ({words}); "
                f"{fewer}start from a camera in order."
            )
        else:
            sentences.append(f"Changed within the first reference of the trend{where}: {words}.")
    return sentences
