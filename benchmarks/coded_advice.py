"""Advice on frames whose noise a codec hides: what it gains or loses with the noise that the frame has.

    python benchmarks/coded_advice.py [--dataset NAME=KIND:ROOT ...] [--frames N] [--out FILE]

Frames as in ``coded_noise.py``, without noise and with 2 and 5 DN of it, stored as JPEG, MPEG-4 and H.264. Each counts
as taken at several settings (`SETTINGS`) and speeds of the image (`SPEEDS_PX_S`; None takes it from the estimated MTF).
Of frames without an estimate of noise, with a bound, two decisions are judged by the surface of average precision with
the true noise of the frame (`coded_noise.true_dn`, in the median tile) and the motion that the advice assumes:

    within the bound    `pipeline.control.advice.advise`: settings better with any noise up to the bound
    at the bound        the same policy, as if the bound were the estimate

So the judge knows the noise and nothing else better than the advice. ``moved`` counts other settings than those of the
frame, ``lost`` of these those that lose more than `LOSS_PERCENT` points; ``least_gain_percent`` and
``mean_gain_percent`` are over those moved, 0 where none is. ``unjudged`` counts advice that names other settings, or
none, whose gain is not known; it is in none of the other three.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks import coded_noise, common  # noqa: E402

common.one_thread()

import numpy as np  # noqa: E402
import pandas as pd  # noqa: E402

from pipeline.camera.processing.codec import Codec  # noqa: E402
from pipeline.condition import ConditionMonitor  # noqa: E402
from pipeline.control.advice import advise, usual_camera  # noqa: E402
from pipeline.control.observation import brightness  # noqa: E402
from pipeline.control.performance import Performance  # noqa: E402
from pipeline.control.state import BASE_ISO, CameraState  # noqa: E402
from pipeline.control.worst_case import expected_with  # noqa: E402
from pipeline.datasets.decoding.pictures import read_grey8  # noqa: E402
from pipeline.datasets.selection import evenly_spread  # noqa: E402

if TYPE_CHECKING:
    from pipeline.condition import Condition
    from pipeline.control.advice import Advice
    from pipeline.datasets.dataset import Dataset

CODECS = (Codec("jpeg", 80), Codec("jpeg", 95), Codec("mpeg4", 4), Codec("h264", 23))
SIGMAS_DN = (0.0, 2.0, 5.0)
SETTINGS = tuple(CameraState(ms / 1e3, iso / BASE_ISO) for ms, iso in ((4, 800), (8, 400), (16, 200), (33, 100)))
SPEEDS_PX_S = (None, 400.0, 760.0)
WITHIN, AT = "within_the_bound", "at_the_bound"
LOSS_PERCENT = 0.1
CAMERA = usual_camera()


def as_if_estimated(condition: Condition) -> Condition:
    """A condition whose bound is taken for an estimate of the noise."""
    bound = np.asarray(condition.noise.at_most_dn)
    summary = replace(condition.noise.summary, value=bound, low=bound, high=bound)
    return replace(condition, noise=replace(condition.noise, summary=summary))


def gained(advice: Advice, state: CameraState, true_dn: float, level: float, surface: Performance) -> float:
    """Points of average precision by the settings advised, with the noise that the frame has."""
    best = CameraState(advice.best_exposure_ms / 1e3, advice.best_iso / BASE_ISO)
    here, there = expected_with(true_dn, advice.motion_px, level, state, [state, best], CAMERA.formation, surface)
    return float(there - here)


def measure(dataset: Dataset, frames: int, surface: Performance) -> pd.DataFrame:
    """Gains of both decisions on the coded frames of a dataset that have no estimate, one row each."""
    monitor, rows = ConditionMonitor(), []
    chosen = evenly_spread(dataset.frames(), frames)
    for number, frame in enumerate(chosen):
        grey = read_grey8(frame.path)
        for codec in CODECS:
            for sigma_dn in SIGMAS_DN:
                key = dataset.name, frame.name, codec.name, codec.quality, sigma_dn
                taken = coded_noise.shots(grey, codec, sigma_dn, *key)
                image = taken[0].astype(np.float32) / np.float32(255)
                condition = monitor.frame(image)
                if np.isfinite(condition.sigma_dn.value) or not np.isfinite(condition.noise.at_most_dn):
                    continue
                true_dn = float(np.median(coded_noise.true_dn(taken, condition.noise.patches)))
                level = brightness(image).mean_level
                conditions = {WITHIN: condition, AT: as_if_estimated(condition)}
                for state, speed, name in product(SETTINGS, SPEEDS_PX_S, conditions):
                    advice = advise(image, state, CAMERA, surface, monitor, speed, conditions[name])
                    gain = gained(advice, state, true_dn, level, surface)
                    moved = (advice.best_exposure_ms, advice.best_iso) != (state.exposure_ms, state.iso)
                    rows.append((sigma_dn, name, moved, gain))
        print(dataset.name, f"{number + 1} of {len(chosen)} frames", flush=True)
    return pd.DataFrame(rows, columns=["added_dn", "decision", "moved", "gain_percent"])


def summarised(table: pd.DataFrame) -> dict[str, Any]:
    """Counts and gains of one kind of decision.

    Args:
        table: columns ``moved`` (bool) and ``gain_percent`` (NaN where it cannot be judged), a row per decision.
    """
    known = np.isfinite(table["gain_percent"])
    moved = table[table["moved"] & known]
    return {
        "count": len(table),
        "moved": len(moved),
        "unjudged": int((table["moved"] & ~known).sum()),
        "lost": int((moved["gain_percent"] < -LOSS_PERCENT).sum()),
        "least_gain_percent": round(float(moved["gain_percent"].min()), 2) if len(moved) else 0.0,
        "mean_gain_percent": round(float(moved["gain_percent"].mean()), 2) if len(moved) else 0.0,
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Store, advise, judge, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dataset", action="append", default=[], metavar="NAME=KIND:ROOT", help="may be repeated")
    parser.add_argument("--frames", type=common.positive, default=6, help="at most this many of each dataset")
    parser.add_argument("--out", type=Path, help="JSON file, by default benchmarks/results/coded_advice.json")
    options = parser.parse_args(arguments)
    common.hold_loaded_libraries()
    named_sets = [coded_noise.parse(text) for text in (f"sim=sim:{ROOT / 'data/sim'}", *options.dataset)]
    common.check_datasets("coded_advice", [one.name for one in named_sets], options.out)
    surface = Performance.load(ROOT / "data/control_surface/all.npz")
    table = pd.concat([measure(one, options.frames, surface) for one in named_sets], ignore_index=True)
    record = {
        str(decision): {f"{added:g}": summarised(cell) for added, cell in part.groupby("added_dn")}
        for decision, part in table.groupby("decision", sort=False)
    }
    about = {
        "datasets": [one.name for one in named_sets],
        "frames_per_dataset": options.frames,
        "seed": coded_noise.SEED,
    }
    print(common.write("coded_advice", about | record, options.out))


if __name__ == "__main__":
    common.run(main)
