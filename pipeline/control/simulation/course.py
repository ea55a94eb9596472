"""How settings, brightness and condition went over a drive: settling, rise, hunting, writes, limit cycles, image.

All is read off the stored steps of a closed loop. Brightness is ``b = log2(light x time x gain)``, stops. A part of a
drive begins at the first frame or at a disturbance (`disturbances`) and ends at the next one; parts of fewer than three
frames show no transient.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pipeline.control.simulation.largest_loss import LIGHT_FACTOR, SPEED_FACTOR
from pipeline.control.state import CameraState
from pipeline.control.temporal.hysteresis import Hysteresis

if TYPE_CHECKING:
    import pandas as pd

SETTLED_STOPS = 0.25
RISEN = 0.9
"""Fraction of the way to its last value that brightness has to cover."""

FRAMES_PER_S = 30.0
"""At which rates are stated, whatever the period of the simulated frames."""

LEAST_FRAMES = 3
COURSE = (
    "rise_frames",
    "reversals_per_s",
    "writes_per_s",
    "cycle_stops",
    "motion_px",
    "sigma_dn",
    "saturated_percent",
    "unestimated_percent",
)
"""Columns of `course`."""

Floats = NDArray[np.float64]


def settling_frames(stops: Floats, start: int, end: int) -> float:
    """Frames after a disturbance until brightness stays within a quarter stop of its last value; NaN if it never does.

    Args:
        stops: (S,) log2 of light x time x gain per step.
        start: step of the disturbance.
        end: step of the next one, or the number of steps.
    """
    part = stops[start:end]
    outside = np.flatnonzero(np.abs(part - part[-1]) > SETTLED_STOPS)
    if not outside.size:
        return 0.0
    settled = int(outside[-1]) + 1
    return float(settled) if settled < len(part) - 1 else float("nan")


def rise_frames(stops: Floats) -> float:
    """Frames after a disturbance until brightness has first covered nine tenths of the way to its last value.

        min { k : (b_k - b_0) / (b_S - b_0) >= 0.9 }

    Args:
        stops: (S,) brightness from the disturbance to the next one, stops.

    Returns:
        frames, at least 1; NaN where the way is no longer than a quarter stop: nothing rose.
    """
    way = stops[-1] - stops[0]
    if abs(way) <= SETTLED_STOPS:
        return float("nan")
    return float(np.argmax((stops - stops[0]) / way >= RISEN))


def cycle_stops(exposure_ms: Floats, total_ms: Floats) -> float:
    """Amplitude of a limit cycle: half of the swing of the exposure time, or of the total where that swings farther.

    Args:
        exposure_ms: (S,) exposure times after settling.
        total_ms: (S,) time x gain.

    Returns:
        half of the difference of the highest and the lowest log2, stops; 0 without a reversal, as where settings follow
        a scene in one direction.
    """
    if not reversals(exposure_ms, total_ms / exposure_ms):
        return 0.0
    return max(float(np.ptp(np.log2(each))) for each in (exposure_ms, total_ms)) / 2.0


def reversals(exposure_ms: Floats, gain: Floats) -> int:
    """Changes of the exposure time against the direction of the change before, as `Hysteresis` counts them.

    Args:
        exposure_ms: (S,) exposure time of each frame.
        gain: (S,) likewise; where the time stays, the total exposure's direction counts.
    """
    counter = Hysteresis(0.0)
    states = [CameraState(float(time) / 1e3, float(factor)) for time, factor in zip(exposure_ms, gain, strict=True)]
    for before, after in itertools.pairwise(states):
        counter.count(before, after)
    return counter.reversals


def disturbances(steps: pd.DataFrame) -> list[int]:
    """Steps at which the light has changed by more than a factor of 2, or the speed by more than 1.5, and the first.

    Args:
        steps: `pipeline.control.simulation.tables.STEPS` of one scenario. Light is the median over policies, which
            flicker shows different light.
    """
    table = steps.groupby("step")[["light", "speed_px_s"]].median().sort_index()
    changed = {0}
    for name, factor in (("light", LIGHT_FACTOR), ("speed_px_s", SPEED_FACTOR)):
        for step, (before, after) in enumerate(itertools.pairwise(table[name]), start=1):
            if max(before, after) > factor * min(before, after):
                changed.add(step)
    return sorted(changed)


def course(steps: pd.DataFrame) -> pd.DataFrame:
    """Measures of each drive of a scenario.

    Args:
        steps: `pipeline.control.simulation.tables.STEPS` of one scenario.

    Returns:
        a row per policy and fold: ``policy``, ``fold`` and `COURSE` ::

            rise_frames           `rise_frames`, mean over the parts in which brightness rose or fell; NaN without one
            reversals_per_s       `reversals` of the whole drive, which has S - 1 intervals of 1 / 30 s
            writes_per_s          frames whose time or gain differs from that of the frame before, likewise
            cycle_stops           `cycle_stops` behind `settling_frames`, largest of the parts; NaN where none settled
                                  for three frames, fewer of which show no reversal
            motion_px, sigma_dn   mean over the frames of true motion blur and noise of the leading viewpoint
            saturated_percent     mean fraction of saturated pixels
            unestimated_percent   frames without an estimate of noise or of motion
    """
    import pandas as pd

    edges = [*disturbances(steps), int(steps["step"].max()) + 1]
    rows = []
    for (policy, fold), table in steps.groupby(["policy", "fold"], sort=False):
        drive = table.sort_values("step")
        light, time, iso = (drive[name].to_numpy(float) for name in ("light", "exposure_ms", "iso"))
        seconds = max(len(drive) - 1, 1) / FRAMES_PER_S
        changed = ~(np.isclose(time[1:], time[:-1]) & np.isclose(iso[1:], iso[:-1]))
        silent = drive["estimated_sigma_dn"].isna() | drive["estimated_motion_px"].isna()
        rows.append(
            {
                "policy": policy,
                "fold": fold,
                **_transients(np.log2(light * time * iso), time, iso, edges),
                "reversals_per_s": reversals(time, iso) / seconds,
                "writes_per_s": float(changed.sum()) / seconds,
                "motion_px": float(drive["motion_px"].mean()),
                "sigma_dn": float(drive["sigma_dn"].mean()),
                "saturated_percent": 100.0 * float(drive["saturated_fraction"].mean()),
                "unestimated_percent": 100.0 * float(silent.mean()),
            }
        )
    return pd.DataFrame(rows, columns=["policy", "fold", *COURSE])


def _transients(stops: Floats, time: Floats, iso: Floats, edges: list[int]) -> dict[str, float]:
    rises, cycles = [], []
    for start, end in itertools.pairwise(edges):
        if end - start < LEAST_FRAMES:
            continue
        rises.append(rise_frames(stops[start:end]))
        settling = settling_frames(stops, start, end)
        if end - start - settling >= LEAST_FRAMES:  # never where it did not settle: NaN
            settled = slice(start + int(settling), end)
            cycles.append(cycle_stops(time[settled], (time * iso)[settled]))
    risen = [frames for frames in rises if np.isfinite(frames)]
    return {
        "rise_frames": float(np.mean(risen)) if risen else float("nan"),
        "cycle_stops": max(cycles) if cycles else float("nan"),
    }
