"""Time of a control decision by policy, of estimation and decision together, and of one step of the closed loop.

    python benchmarks/control.py [--out FILE] [--repeats N] [--viewpoints N]

One 896 x 768 frame, formed by the controlled camera from a procedural radiance; one thread. ``decision`` is the policy
alone with estimates at hand, ``estimation`` the condition monitor (noise, blur and maps), ``per_second`` what both
together reach on one core by processor time. ``loop_step`` is one step of the simulated loop without its cache: frames
of all viewpoints formed and searched by the detector, one estimate, one decision. On a busy machine the processor's
times are the ones to read. ``settling`` drives one viewpoint by estimated condition through constant scenes from wrong
starts and steps of light by 16 both ways, at delays of 0 to 3 frames.

Published beside it: Lee et al. (CVPR 2024, arXiv 2404.01636), learned exposure control (DRL-AE), 6 ms a frame on a
processor and about five frames to converge; Shin et al. (IROS 2019), 18.2 ms for its metric at 800 x 600. The report
reads the decision times from the record (benchmarks/results/control.json).
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks import common  # noqa: E402

common.one_thread()

import numpy as np  # noqa: E402

from pipeline import control  # noqa: E402
from pipeline.camera.exposure import Camera, Motion, noise_generator  # noqa: E402
from pipeline.control.motion import CYCLES_PER_PX, motion_mtf  # noqa: E402
from pipeline.control.observation import Observation, observe  # noqa: E402
from pipeline.control.performance import Performance  # noqa: E402
from pipeline.control.policy import ControlledCamera  # noqa: E402
from pipeline.control.simulation.evaluation import settling_frames  # noqa: E402
from pipeline.control.simulation.loop import Rig, run  # noqa: E402
from pipeline.control.simulation.scenario import Scenario  # noqa: E402
from pipeline.control.simulation.views import View  # noqa: E402
from pipeline.control.state import CameraState, DelayLine, Limits  # noqa: E402
from pipeline.curves.cells import Cells  # noqa: E402
from pipeline.curves.surface import Surface  # noqa: E402

FRAME_PX = (768, 896)
STATE = CameraState.of(8.0, 400.0)
LIGHT, SPEED_PX_S = 0.25, 760.0
SETTLING_SPEED_PX_S, SETTLING_FRAMES, SETTLING_LEAD, LAST_FRAMES = 400.0, 40, 6, 20
DRIVES = {
    "constant, from 1 ms": (CameraState.of(1.0, 100.0), 0.5, 0.5),
    "constant, from 33 ms": (CameraState.of(33.0, 200.0), 0.5, 0.5),
    "light / 16": (CameraState.of(8.0, 100.0), 1.0, 1.0 / 16),
    "light x 16": (CameraState.of(8.0, 400.0), 1.0 / 16, 1.0),
}
"""Settings at the start, and light before and after the disturbance."""

PUBLISHED_MS = {"drl_ae": 6.0, "shin2019_metric_800x600": 18.2}
STEPS = 3


def radiance(number: int = 0) -> np.ndarray:
    """(768, 896) float32: dead leaves, mean about that of a street in daylight."""
    from pipeline.learning import dead_leaves
    from pipeline.streams import stream

    generator = stream(0, "control benchmark", number)
    squares = [dead_leaves.draw(generator, 448, supersampling=1) for _ in range(4)]
    picture = np.concatenate([np.concatenate(squares[:2], axis=1), np.concatenate(squares[2:], axis=1)])
    return (2.5 * (np.asarray(picture)[: FRAME_PX[0]] / 255.0) ** 2.2).astype(np.float32)


def surface() -> Performance:
    """Surfaces of three brightnesses with the default ones' knots, from a formula: decisions cost the same on any."""
    darker = [_surface(level, np.array([0.0, 7, 12, 20]), np.array([0.0, 7, 15, 31])) for level in (0.3, 0.18)]
    return _surface(0.5, np.arange(0.0, 41.0, 5.0), np.array([0.0, 3, 7, 11, 15, 21, 31]), darker)


def _surface(level: float, sigmas: np.ndarray, sizes: np.ndarray, darker: Sequence[Performance] = ()) -> Performance:
    reference = np.tile(np.exp(-2.0 * CYCLES_PER_PX), (2, 1))
    mtf = motion_mtf(sizes, reference, 0)[::-1]
    shape = (len(sigmas), len(sizes))
    sigma = np.repeat(sigmas[:, None] + 1.0, len(sizes), 1)
    precision = 190.0 * level * np.exp(-sigma / 30.0 - (sizes[None, ::-1] / 14.0) ** 2)
    draws = np.clip(precision[None] + np.linspace(-3, 3, 300)[:, None, None], 0, 100)
    spread = np.broadcast_to(mtf, shape).copy()
    cells = Cells(sigmas, mtf, np.ones(shape, dtype=np.int64), sigma, spread, precision, draws, 0)
    return Performance(Surface(cells), reference, 0, float(sizes[-1]), level, darker)


def observation(monitor: Any) -> Observation:
    """What the camera and the monitor give at `STATE`."""
    frame = Camera().expose(
        radiance(), STATE.exposure_s, STATE.gain, noise_generator(0, "control benchmark"),
        light=LIGHT, motion=Motion(SPEED_PX_S),
    )  # fmt: skip
    return observe(frame.image, monitor)


def decisions(seen: Observation, performance: Performance, repeats: int) -> dict[str, dict[str, float]]:
    """Times of one decision of every policy that needs no truth."""
    calls = {}
    for name in control.REGISTRY.names():
        policy = control.create(name, camera=ControlledCamera(), performance=performance)
        if not policy.sees_truth:
            calls[name] = lambda policy=policy: policy.decide(seen, STATE)
    return common.take_turns(calls, repeats)


def loop_step(performance: Performance, viewpoints: int) -> dict[str, float]:
    """Processor time of one step of the loop with some viewpoints, ms."""
    from pipeline.store import write_arrays

    scenario = Scenario("benchmark", STEPS, ((0.0, LIGHT),), ((0.0, SPEED_PX_S),), STATE)
    with tempfile.TemporaryDirectory() as folder:
        views = []
        for number in range(viewpoints):
            path = Path(folder) / f"view-{number}.radiance.npz"
            write_arrays(path, radiance=radiance(number).astype(np.float16))
            views.append(View(f"view-{number}-0", f"view-{number}", 0, path, ()))
        rig = Rig(Camera(), ControlledCamera(), "compact", "{}", 0)
        times = []
        for _ in range(2):  # the first opens the detector and the monitor
            policy = control.create("iopc_continuous", camera=ControlledCamera(), performance=performance)
            start = time.thread_time()
            run(policy, rig, scenario, views)
            times.append((time.thread_time() - start) * 1e3 / STEPS)
    return {"viewpoints": viewpoints, "processor_ms": round(times[-1], 1)}


def settling(performance: Performance, monitor: Any) -> dict[str, dict[str, dict[str, float | None]]]:
    """Decisions until a policy has settled, by policy, drive and delay.

    Returns:
        policy -> drive -> measures by delay: ``frames_d`` from the disturbance to the first frame from which brightness
        stays within a quarter stop of its last value; ``change_stops_d`` range of the exposure times from then on;
        ``ripple_stops_d`` that of the last 20 frames, longer than the period of a cycle at a delay of 3 (11 frames): 0
        where nothing oscillates.
    """
    scene, known = radiance(), {}

    def seen(state: CameraState, light: float) -> Observation:
        key = (state, light)
        if key not in known:
            frame = Camera().expose(
                scene, state.exposure_s, state.gain, noise_generator(0, "control benchmark"),
                light=light, motion=Motion(SETTLING_SPEED_PX_S),
            )  # fmt: skip
            known[key] = observe(frame.image, monitor)
        return known[key]

    results: dict[str, dict[str, dict[str, float | None]]] = {}
    for name in ("iopc_optimal", "iopc_continuous"):
        results[name] = {}
        for drive, (start, before, after) in DRIVES.items():
            measures: dict[str, float | None] = {}
            for delay in range(4):
                camera = ControlledCamera(Limits(exposure_steps_per_stop=6, gain_step_db=1.0, delay_frames=delay))
                policy = control.create(name, camera=camera, performance=performance)
                state = camera.limits.nearest(start.exposure_s, start.gain)
                line, states = DelayLine.filled(state, delay), []
                lead = 0 if before == after else SETTLING_LEAD + delay
                for step in range(lead + SETTLING_FRAMES + 2 * delay):
                    light = before if step < lead else after
                    states.append(state)
                    state = line.next(policy.decide(seen(state, light), state).state)
                stops = np.log2([each.total_exposure_s for each in states[lead:]])
                frames = settling_frames(stops, 0, len(stops))
                times = np.log2([each.exposure_s for each in states])
                measures[f"frames_{delay}"] = None if np.isnan(frames) else int(frames)
                measures[f"change_stops_{delay}"] = round(float(np.ptp(times[lead + int(np.nan_to_num(frames)) :])), 3)
                measures[f"ripple_stops_{delay}"] = round(float(np.ptp(times[-LAST_FRAMES:])), 3)
            results[name][drive] = measures
    return results


def main(arguments: list[str] | None = None) -> None:
    """Measure and write the record."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--repeats", type=int, default=20)
    parser.add_argument("--viewpoints", type=int, default=4)
    options = parser.parse_args(arguments)
    from pipeline.condition import ConditionMonitor

    common.hold_loaded_libraries()
    monitor = ConditionMonitor()
    seen = observation(monitor)
    performance = surface()
    estimation = common.take_turns({"monitor": lambda: observe(seen.image, monitor)}, max(3, options.repeats // 2))
    common.hold_loaded_libraries()
    taken = decisions(seen, performance, options.repeats)
    estimate_ms = estimation["monitor"]["processor_median_ms"]
    together = {
        name: round(1e3 / (times["processor_median_ms"] + (estimate_ms if name.startswith("iopc") else 0.0)), 1)
        for name, times in taken.items()
    }
    record = {
        "machine": common.machine("torch", "opencv-python-headless"),
        "frame_px": list(FRAME_PX[::-1]),
        "abstained": seen.abstained,
        "decision": taken,
        "estimation": estimation["monitor"],
        "per_second": together,
        "settling": settling(performance, monitor),
        "loop_step": loop_step(performance, options.viewpoints),
        "published_ms": PUBLISHED_MS,
    }
    print(common.write("control", record, options.out))


if __name__ == "__main__":
    common.run(main)
