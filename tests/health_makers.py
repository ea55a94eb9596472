"""Rows, runs and an estimator of known conditions, for tests of what ``camera-monitor health`` makes of frames."""

from __future__ import annotations

import numpy as np

from pipeline.blur.base import BlurEstimate
from pipeline.cli.health.run import HealthRun
from pipeline.condition import BlurState, Condition, ConditionMonitor, NoiseState
from pipeline.condition.summary import summarise
from pipeline.noise.base import NoiseEstimate

CONDITION = ConditionMonitor(noise_name="immerkaer").patches(np.full((1, 1, 192, 192), 0.5, np.float32))


def frame_row(number, **changes):
    """The row of a frame of a video; ``changes`` of its columns."""
    row = {
        "picture": f"v.mp4#{number}", "sigma_dn": 2.0, "sigma_low_dn": 1.8, "sigma_high_dn": 2.3,
        "sigma_at_most_dn": 2.3, "mtf50_horizontal": 0.3, "mtf50_vertical": 0.4,
        "median_dn": 90.0, "mtf": np.full((2, 8), 0.7), "flags": "", "alarms": "", "undecided": "", "trend": "",
        "mtf_low": np.full((2, 8), 0.7), "mtf_high": np.full((2, 8), 0.7),
        "blur": "slightly blurred", "blur_direction": "", "blur_range": "", "blurred_fraction": 0.0, "noise": "low",
        "causes": "", "abstained": {}, "noise_patches": 20,
        "ap_percent": np.nan, "ap_low_percent": np.nan, "ap_high_percent": np.nan,
        "best_exposure_ms": np.nan, "best_iso": np.nan,
        "best_ap_percent": np.nan, "white_sigma_dn": 2.0, "noise_correlation": 0.0,
    }  # fmt: skip
    return row | changes


def run_of(rows, **changes):
    """A run of ``camera-monitor health`` with these rows; ``changes`` of its other parts."""
    about = {
        "version": "1", "blur_estimator": "spectral", "noise_estimator": "adaptive",
        "relative": False, "relative_to": "",
        "sharp": [], "camera": None,
        "thresholds": {"sigma_dn": 8.0, "mtf50": None, "flags": False},
        "weights_released": {"blur": True, "noise": False}, "weights_sha256": {"a.safetensors": "f" * 64},
    }  # fmt: skip
    return HealthRun(about, rows=rows, **changes)


class KnownMonitor:
    """Stands for the estimators: the condition that a picture's mean level names, so that long series take no time."""

    def frame(self, image, codec="", quantiser=None):
        """The condition of a picture."""
        level = float(image.mean())
        mtf = np.full((1, 2, 8), 0.9 * np.exp(-level) + 0.001 * image[0, 0], np.float32)
        no, why = np.zeros(1, bool), np.array([""], dtype=np.str_)
        blur = BlurEstimate(mtf, no, why)
        noise = NoiseEstimate(np.array([1 + 10 * level]), np.array([1.0]), np.array([9.0]), no, why.astype(object))
        return Condition(
            BlurState((), blur, (1, 1), summarise(mtf), 1.0),
            NoiseState((), noise, (1, 1), summarise(noise.sigma_dn), noise.sigma_dn.reshape(1, 1), 1.0),
        )
