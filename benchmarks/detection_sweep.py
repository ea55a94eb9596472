"""Cost of the detection sweep: per frame and detector, over the number of conditions, and over the number of workers.

Usage::

    python benchmarks/detection_sweep.py [--out FILE] [--detector compact | yolox=path.onnx ...] [--frames N]

One thread per process. A frame of Sim's size is made here (dead leaves: detectors do not care for its content, their
time depends on its size); parts are timed apart: forming a condition, detecting, estimating noise and MTF on objects.
Growth is measured on whole runs of the stage's own work, over conditions at one worker and over workers at one number
of conditions. Detectors whose weights are absent are left out and named.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks import common  # noqa: E402

common.one_thread()

import numpy as np  # noqa: E402

from pipeline.config.compose import compose, parse  # noqa: E402
from pipeline.datasets.frame import Box, Frame  # noqa: E402
from pipeline.detection import opened  # noqa: E402
from pipeline.executor import one_thread, run_map  # noqa: E402
from pipeline.experiments import iopc  # noqa: E402
from pipeline.experiments.class_maps import class_map  # noqa: E402
from pipeline.experiments.condition import grid, sweep_kernels  # noqa: E402
from pipeline.experiments.corrupt import SharpFrame  # noqa: E402
from pipeline.experiments.detect import Sweep, options_of  # noqa: E402
from pipeline.learning.dead_leaves import draw  # noqa: E402
from pipeline.store import write_image  # noqa: E402
from pipeline.streams import stream  # noqa: E402

WIDTH_PX, HEIGHT_PX = 896, 768
REPEATS = 5


def least(work: Callable[[], Any], repeats: int = REPEATS) -> float:
    """Least processor time of several calls, seconds, after one to warm up."""
    work()
    times = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


def frames(folder: Path, count: int) -> list[Frame]:
    """Frames of Sim's size with two objects each."""
    made = []
    for number in range(count):
        picture = draw(stream(0, "sweep benchmark", number), max(WIDTH_PX, HEIGHT_PX))[:HEIGHT_PX, :WIDTH_PX] / 255.0
        path = folder / f"frame-{number}.png"
        write_image(path, np.clip(picture, 0.0, 1.0).astype(np.float32))
        boxes = (Box("car", 100, 300, 300, 420), Box("person", 600, 250, 660, 430))
        made.append(Frame("sim", path.stem, path, boxes))
    return made


def detect(work: tuple[Any, Any], *, sweep: Sweep) -> int:
    """What the stage does for one frame and kernel."""
    return len(sweep.detect(*work)["score"])


def growth(sweep: Sweep, shown: list[Frame], blurs: list[Any]) -> dict[str, Any]:
    """Wall time of whole runs: over conditions, and over workers."""
    results: dict[str, Any] = {"conditions": {}, "workers": {}}
    for count in (1, len(blurs) // 2, len(blurs)):
        start = time.perf_counter()
        run_map(partial(detect, sweep=sweep), [(frame, kernel) for frame in shown for kernel in blurs[:count]])
        results["conditions"][str(count * len(sweep.target_sigmas_dn))] = time.perf_counter() - start
    for workers in (1, 2):
        start = time.perf_counter()
        work = [(frame, kernel) for frame in shown for kernel in blurs]
        run_map(partial(detect, sweep=sweep), work, workers=workers)
        results["workers"][str(workers)] = time.perf_counter() - start
    return results


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, help="JSON file, by default benchmarks/results/detection_sweep.json")
    parser.add_argument("--detector", action="append", help="name in conf/detector, or name=weights")
    parser.add_argument("--frames", type=int, default=2)
    parser.add_argument("--kernels", type=int, help="only so many, for a trial")
    arguments = parser.parse_args()
    os.chdir(ROOT)
    one_thread()
    names = [entry.partition("=") for entry in arguments.detector or ["compact", "compact_two_stage", "yolox"]]
    overrides = [f"+detector@detection.detectors.{n}={n}" for n, _, _ in names if not n.startswith("compact")]
    overrides += [f"detection.detectors.{name}.weights={weights}" for name, _, weights in names if weights]
    config = parse(compose(overrides), "conf/")
    section, criteria = config.detection.sweep, config.detection.evaluation
    camera, levels = config.camera, tuple(section.target_sigmas_dn)
    blurs = sweep_kernels(section.blur, section.sizes_px, section.angles_deg, section.match, config.seed)
    blurs = blurs[: arguments.kernels]
    result: dict[str, Any] = {
        "frame": f"{WIDTH_PX}x{HEIGHT_PX} px",
        "conditions": len(blurs) * len(levels),
        "unit": "s of one core",
        "detectors": {},
        "absent": [],
    }
    with tempfile.TemporaryDirectory() as position:
        shown = frames(Path(position), arguments.frames)
        conditions = grid([blurs[-1]], [section.noise_source], levels)
        words, sharp = class_map("sim"), shown[0].image()

        def form() -> None:
            frame = SharpFrame(shown[0], camera, 1)
            for condition in conditions:
                frame.under(condition)

        result["form_a_condition"] = least(form) / len(levels)
        where = iopc.on_objects(shown[:1], words, config.detection.measure, criteria)
        see = partial(
            iopc.measure,
            where,
            [blurs[-1]],
            section.noise_source,
            levels,
            config.detection.measure,
            camera=camera,
            seed=1,
        )
        result["form_and_measure_a_condition"] = least(see) / len(levels)
        for name, _, _ in names:
            chosen = config.detection.detectors[name]
            if chosen.weights is None or not Path(chosen.weights).is_file():
                result["absent"].append(f"{name}: {chosen.fetch_command}")
                continue
            options = options_of(chosen)
            detector = opened(chosen.kind, options)
            sweep = Sweep(chosen.kind, options, tuple(words.classes), section.noise_source, levels, camera, 1)
            each = {"detect_a_frame": least(lambda d=detector: d.detect([sharp]))}  # type: ignore[misc]
            result["detectors"][name] = each | growth(sweep, shown, blurs)
    about = common.machine("onnxruntime", "torch", "opencv-python-headless")
    print(common.write("detection_sweep", {"machine": about, **result}, arguments.out).read_text(encoding="utf-8"))


if __name__ == "__main__":
    common.run(main)
