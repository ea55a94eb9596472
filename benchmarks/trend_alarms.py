"""Trend alarms on simulated series: false alarms an hour by law of the scatter, and delays of faults.

    python benchmarks/trend_alarms.py [--series N] [--frames N] [--out FILE]

Series of each law are stationary over the reference of 300 frames and what follows. The rate is that of three charts at
10 frames per second, one alarm an hour asked for. Faults begin 200 frames after the reference; delays are the median
and the 90th percentile of at most 200 series in seconds, null where a chart has not noticed within five minutes.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks import common  # noqa: E402

common.one_thread()

import numpy as np  # noqa: E402
from numpy.typing import NDArray  # noqa: E402

from pipeline.condition.change_point import Chart, Reference, drift  # noqa: E402
from pipeline.condition.trend import (  # noqa: E402
    FRAMES_BETWEEN_FALSE_ALARMS,
    FRAMES_PER_SECOND,
    QUANTITIES,
    REFERENCE_FRAMES,
)
from pipeline.streams import stream  # noqa: E402

Floats = NDArray[np.float64]
Law = Callable[[np.random.Generator, int, int], Floats]
CALM = 200
FAULT_FRAMES = 3000


def autoregressive(generator: np.random.Generator, phi: float, frames: int, series: int) -> Floats:
    """(frames, series) stationary values of unit variance."""
    values = generator.standard_normal((frames, series))
    values[1:] *= np.sqrt(1 - phi**2)
    for frame in range(1, frames):
        values[frame] += phi * values[frame - 1]
    return values


def stop_and_go(generator: np.random.Generator, frames: int, series: int) -> Floats:
    """A third of every 30 s at standstill, where the level is .1 higher; scatter of 5 %."""
    time = np.arange(frames)[:, None] + 300 * generator.random(series)
    return 0.1 * (time % 300 < 100) + 0.05 * generator.standard_normal((frames, series))


LAWS: dict[str, Law] = {
    "normal 5 %": lambda g, n, m: 0.05 * g.standard_normal((n, m)),
    "autoregressive .5, 5 %": lambda g, n, m: 0.05 * autoregressive(g, 0.5, n, m),
    "autoregressive .9, 5 %": lambda g, n, m: 0.05 * autoregressive(g, 0.9, n, m),
    "normal 5 %, 2 % of the frames .3 up": lambda g, n, m: (
        0.05 * g.standard_normal((n, m)) + 0.3 * (g.random((n, m)) < 0.02)
    ),
    "Laplace 5 %": lambda g, n, m: g.laplace(0, 0.035, (n, m)),
    "exponential 5 %": lambda g, n, m: g.exponential(0.05, (n, m)),
    "Student t of 3 degrees, 5 %": lambda g, n, m: 0.03 * g.standard_t(3, (n, m)),
    "stop and go of 30 s": stop_and_go,
    "autoregressive .95, 5 %, and white, 5 %": lambda g, n, m: (
        0.05 * autoregressive(g, 0.95, n, m) + 0.05 * g.standard_normal((n, m))
    ),
    "autoregressive .98, 2.5 %, and white, 5 %": lambda g, n, m: (
        0.025 * autoregressive(g, 0.98, n, m) + 0.05 * g.standard_normal((n, m))
    ),
    "autoregressive .98, 5 %, and white, 3 %": lambda g, n, m: (
        0.05 * autoregressive(g, 0.98, n, m) + 0.03 * g.standard_normal((n, m))
    ),
    "autoregressive .98, 5 %": lambda g, n, m: 0.05 * autoregressive(g, 0.98, n, m),
    "autoregressive .99, 5 %": lambda g, n, m: 0.05 * autoregressive(g, 0.99, n, m),
}
LAWS_OF_DELAYS = tuple(LAWS)[:4] + tuple(LAWS)[-3:-1]
TIME = np.arange(FAULT_FRAMES) / FRAMES_PER_SECOND
FAULTS = {
    "mean MTF .60 to .36 within five minutes": np.log(0.6 / 0.36) * TIME / 300,
    "mean MTF .60 to .35 at once": np.full(FAULT_FRAMES, np.log(0.6 / 0.35)),
    "noise 3 to 6 DN within two minutes": np.log((1 + 3 * 2 ** np.minimum(TIME / 120, 1)) / 4),
}


def false_alarms(name: str, series: int, frames: int) -> dict[str, float]:
    """Alarms of stationary series of a law."""
    values = LAWS[name](stream(0, "false alarms", name), REFERENCE_FRAMES + frames, series)
    start = values[:REFERENCE_FRAMES]
    chart = Chart(Reference.of(start), FRAMES_BETWEEN_FALSE_ALARMS)
    alarms = sum(chart.step(row).astype(int) for row in values[REFERENCE_FRAMES:])
    hours = frames / FRAMES_PER_SECOND / 3600
    return {
        "alarms_an_hour": round(len(QUANTITIES) * float(np.mean(alarms)) / hours, 3),
        "charts_with_an_alarm_percent": round(100 * float(np.mean(np.asarray(alarms) > 0)), 2),
        "references_that_drift_percent": round(100 * float(np.mean(drift(start)[2])), 2),
        "median_long_run_variance": round(float(np.median(chart.reference.long_run_variance)), 2),
    }


def delays(name: str, fault: str, series: int) -> dict[str, float | None]:
    """Seconds from the beginning of a fault to its alarm, scatter of a law."""
    calm = REFERENCE_FRAMES + CALM
    values = LAWS[name](stream(0, "delays", name, fault), calm + FAULT_FRAMES, series)
    values[calm:] += FAULTS[fault][:, None]
    chart = Chart(Reference.of(values[:REFERENCE_FRAMES]), FRAMES_BETWEEN_FALSE_ALARMS)
    first = np.full(series, np.inf)
    for frame, row in enumerate(values[REFERENCE_FRAMES:], -CALM):
        chart.step(row)
        if frame >= 0:
            first = np.where(chart.alarm & np.isinf(first), frame / FRAMES_PER_SECOND, first)
    ordered = np.sort(first)
    seconds = {"median_s": ordered[series // 2], "p90_s": ordered[int(0.9 * series)]}
    return {key: float(value) if np.isfinite(value) else None for key, value in seconds.items()}


def main(arguments: Sequence[str] | None = None) -> None:
    """Simulate, count, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--series", type=common.positive, default=600, metavar="N", help="of each law")
    parser.add_argument("--frames", type=common.positive, default=9000, metavar="N", help="after the reference")
    parser.add_argument("--out", type=Path, help="JSON file, by default benchmarks/results/trend_alarms.json")
    options = parser.parse_args(arguments)
    rates: dict[str, Any] = {}
    for name in LAWS:
        rates[name] = false_alarms(name, options.series, options.frames)
        print(name, rates[name], flush=True)
    noticed: dict[str, Any] = {}
    for name in LAWS_OF_DELAYS:
        noticed[name] = {fault: delays(name, fault, min(options.series, 200)) for fault in FAULTS}
        print(name, noticed[name], flush=True)
    record = {"series": options.series, "frames": options.frames, "false_alarms": rates, "delays": noticed}
    print(common.write("trend_alarms", record, options.out))


if __name__ == "__main__":
    common.run(main)
