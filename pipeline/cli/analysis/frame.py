"""The analysis of one frame, for ``health`` and ``watch``: condition, flags, expected precision, advice, alarms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.datasets.decoding.video_coding import UNKNOWN, Coding
from pipeline.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pipeline.condition import Condition, ConditionMonitor
    from pipeline.condition.frame_flags import FrameMeasures
    from pipeline.condition.trend import TrendAlarm
    from pipeline.control.performance import Performance
    from pipeline.control.policy import ControlledCamera


@dataclass(frozen=True)
class Thresholds:
    """What counts as an alarm.

    Attributes:
        sigma_dn: noise above it, DN; None for no threshold.
        mtf50: half contrast below it on either axis, fraction of Nyquist; None for no threshold.
        flags: whether flags of a frame are alarms.
    """

    sigma_dn: float | None = None
    mtf50: float | None = None
    flags: bool = False


@dataclass(frozen=True)
class Settings:
    """Settings that frames were taken with, as far as they are given; None where they are not.

    Attributes:
        exposure: text such as ``4ms``.
        iso: ISO.
    """

    exposure: str | None = None
    iso: float | None = None

    def __post_init__(self) -> None:
        from pipeline.cli.frames.shot_settings import seconds

        if self.exposure is not None:
            seconds(self.exposure, "--exposure")

    def of(self, path: Path) -> tuple[tuple[float, float] | None, str]:
        """Exposure time in seconds and ISO of a file, as given or from its EXIF data.

        Returns:
            both, or None where one is missing; and which option would give it, where only one is.
        """
        from pipeline.cli.frames.shot_settings import shot_settings

        exposure_s, iso = shot_settings(path, self.exposure, self.iso)
        if exposure_s is not None and iso is not None:
            return (exposure_s, iso), ""
        half_known = (exposure_s is None) != (iso is None)
        return None, f"give --{'exposure' if exposure_s is None else 'iso'} too" if half_known else ""


@dataclass(frozen=True)
class Estimated:
    """Estimates of one frame: its condition, the measures of its flags, and how it was stored."""

    condition: Condition
    measures: FrameMeasures
    coding: Coding


class FrameAnalysis:
    """Analyses frames one after the other.

    Args:
        monitor: estimates blur and noise.
        thresholds: of alarms.
        performance: surface of average precision, or None.
        settings: of the frames.
        relative: whether the monitor's MTF is relative to sharp frames.
        reference_frames: of the trend; None for no trend.
        codec: of frames of which it is not known otherwise (``--codec``); empty for none.

    Attributes:
        trend_alarms: those that began, as rows.
    """

    def __init__(
        self,
        monitor: ConditionMonitor,
        thresholds: Thresholds,
        performance: Performance | None = None,
        settings: Settings | None = None,
        *,
        relative: bool = False,
        reference_frames: int | None = None,
        codec: str = "",
    ) -> None:
        from pipeline.condition.frame_flags import FrameInspector
        from pipeline.condition.trend import ConditionTrend

        self.monitor, self.thresholds, self.performance = monitor, thresholds, performance
        self.settings, self.relative, self.reference_frames = settings or Settings(), relative, reference_frames
        self.codec = codec
        self.trend_alarms: list[dict[str, Any]] = []
        self._inspector = FrameInspector()
        if reference_frames is not None:
            ConditionTrend(reference_frames)  # refuses a reference that is too short before anything is computed
        self.trends: dict[str, ConditionTrend] = {}
        self._camera: ControlledCamera | None = None

    def estimate(self, image: NDArray[np.float32], coding: Coding = UNKNOWN) -> Estimated:
        """What one frame shows without those before it; may be called in several threads at once.

        Args:
            image: (H, W) float in [0, 1].
            coding: how it was stored.

        Raises:
            InputError: not such a frame.
        """
        from pipeline.condition.frame_flags import measure

        known = coding.or_by(self.codec)
        return Estimated(self.monitor.frame(image, known.codec, known.quantiser), measure(image), known)

    def analyse(
        self,
        name: str,
        image: NDArray[np.float32],
        stream: str = "",
        sequence: str = "",
        estimated: Estimated | None = None,
        coding: Coding = UNKNOWN,
    ) -> tuple[dict[str, Any], Condition]:
        """The row and the condition of a frame.

        Args:
            name: of the frame.
            image: (H, W) float in [0, 1].
            stream: video or source that it is a frame of; empty for a picture, whose file has settings of its own.
            sequence: series of frames whose trend it belongs to; empty for none. Where there is no stream, its frames
                are compared for the flag ``frozen`` too.
            estimated: its estimates, where they are there already (`estimate`).
            coding: see `estimate`.

        Returns:
            the row (`pipeline.cli.analysis.rows.condition_row` and what follows from it), and the condition.

        Raises:
            InputError: not such a frame.
        """
        from pipeline.cli.analysis.rows import alarms, condition_row, undecided

        estimated = estimated or self.estimate(image, coding)
        condition = estimated.condition
        row = condition_row(name, condition, self._inspector.inspect(image, stream or sequence, estimated.measures))
        row |= {"codec": estimated.coding.codec, "quantiser": estimated.coding.quantiser}
        self._words(row, condition)
        self._precision(row, image, condition, Path(stream or name))
        row["trend"] = ", ".join(self._trend(row, condition, sequence)) if sequence else ""
        limits = self.thresholds
        raised = alarms(row, limits.sigma_dn, limits.mtf50, limits.flags)
        row["alarms"] = ", ".join(raised + [f"trend {name}" for name in row["trend"].split(", ") if name])
        row["undecided"] = ", ".join(undecided(row, limits.sigma_dn, limits.mtf50))
        return row, condition

    def _words(self, row: dict[str, Any], condition: Condition) -> None:
        from pipeline.condition.verdict import directed, grade

        mtf, shares = condition.mtf, directed(condition.blur.estimate.mtf)
        grades = grade(row["sigma_dn"], mtf.value, row["median_dn"], (mtf.low, mtf.high), shares)
        row |= {
            "blur": grades.blur, "blur_direction": grades.direction, "blur_range": grades.blur_range,
            "noise": grades.noise, "causes": "; ".join(grades.causes()),
        }  # fmt: skip

    def _precision(self, row: dict[str, Any], image: NDArray[np.float32], condition: Condition, file: Path) -> None:
        """Expected average precision, and advice where exposure and ISO are known."""
        nan = float("nan")
        row |= dict.fromkeys(("ap_percent", "ap_low_percent", "ap_high_percent", "best_exposure_ms", "best_iso"), nan)
        row["best_ap_percent"] = row["gain_percent"] = nan
        if self.performance is None:
            return
        from pipeline.cli.analysis.flag_words import left_out_words
        from pipeline.condition.verdict import noise_ends
        from pipeline.control.observation import brightness
        from pipeline.control.precision.expected_precision import expected_precision, interval_between

        level, mtf = brightness(image).mean_level, condition.mtf
        at = partial(expected_precision, self.performance, relative=self.relative, level=level)
        taken, without = self.settings.of(file)
        if left_out_words(row):  # detection was measured with white noise only
            row["sharp_ap_percent"] = at(nan, mtf.value).best_percent
            if taken is not None:
                row["advice"] = "none: noise of rows, columns or single pixels, with which detection was not measured"
            return
        here = at(row["sigma_dn"], mtf.value)
        row |= {
            "ap_percent": here.ap_percent, "ap_low_percent": here.low_percent, "ap_high_percent": here.high_percent,
            "sharp_ap_percent": here.best_percent,
        }  # fmt: skip
        least_mtf, most_mtf = (mtf.low, mtf.high) if row["blur_range"] else (mtf.value, mtf.value)
        least_dn, most_dn = noise_ends(row["sigma_dn"], row["sigma_low_dn"], row["sigma_high_dn"])
        if isnan(row["sigma_dn"]):  # AP falls with noise: the most that there may be gives the least AP
            row["ap_low_percent"] = at(row["sigma_at_most_dn"], least_mtf).low_percent
        elif (row["blur_range"] or least_dn != most_dn) and not isnan(here.ap_percent):
            low, high = interval_between(here, at(most_dn, least_mtf), at(least_dn, most_mtf))
            row |= {"ap_low_percent": low, "ap_high_percent": high}
        if taken is not None:
            row |= self._advice(image, condition, taken, here.ap_percent)
        elif without:
            row["advice"] = f"none: {without}"

    def _advice(
        self, image: NDArray[np.float32], condition: Condition, taken: tuple[float, float], ap_percent: float
    ) -> dict[str, Any]:
        from pipeline.control.advice import advise, usual_camera
        from pipeline.control.state import BASE_ISO, CameraState

        assert self.performance is not None
        if self._camera is None:
            self._camera = usual_camera()
        total = system_mtf(condition, self.performance.reference) if self.relative else condition
        state = CameraState(taken[0], taken[1] / BASE_ISO)
        try:
            advice = advise(image, state, self._camera, self.performance, condition=total)
        except InputError as error:
            return {"advice": f"none: {error}"}
        kept = advice.keeps_settings and not isnan(ap_percent)  # that of the row, which regards any kind of blur
        return {
            "exposure_ms": advice.exposure_ms, "iso": advice.iso, "best_exposure_ms": advice.best_exposure_ms,
            "best_iso": advice.best_iso, "best_ap_percent": ap_percent if kept else advice.best_ap_percent,
            "advice": "undecided" if advice.undecided else advice.action,
            "gain_percent": advice.gain_percent,
        }  # fmt: skip

    def _trend(self, row: dict[str, Any], condition: Condition, sequence: str) -> tuple[str, ...]:
        if self.reference_frames is None:
            return ()
        from pipeline.condition.trend import ConditionTrend

        trend = self.trends.setdefault(sequence, ConditionTrend(self.reference_frames))
        for alarm in trend.step(row["sigma_dn"], condition.mtf.value, row["picture"]):
            self.trend_alarms.append(_alarm_row(alarm, row["picture"], sequence))
        return trend.active


def series_name(source: str, shape: Sequence[int]) -> str:
    """Of the frames (H, W) of a source that share a trend: another size, as of another mode, has one of its own."""
    height, width = shape
    return f"{source} {width}x{height}"


def _alarm_row(alarm: TrendAlarm, picture: str, sequence: str) -> dict[str, Any]:
    return {
        "sequence": sequence, "picture": picture, "quantity": alarm.quantity, "frame": alarm.frame,
        "since_frame": alarm.since_frame, "since_picture": alarm.since_picture, "reference": alarm.reference,
        "level": alarm.level, "words": alarm.words(),
    }  # fmt: skip


def system_mtf(condition: Condition, reference: NDArray[np.floating]) -> Condition:
    """A condition whose MTF, relative to sharp frames, is multiplied by that of sharp frames.

    Args:
        condition: with a relative MTF.
        reference: (2, 8) MTF of sharp frames.
    """
    part = condition.blur.summary
    scaled = replace(part, value=part.value * reference, low=part.low * reference, high=part.high * reference)
    return replace(condition, blur=replace(condition.blur, summary=scaled))
