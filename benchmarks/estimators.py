"""Time of every blur and noise estimator: per patch, and for a 1920 x 1200 frame's whole grid of patches.

    python benchmarks/estimators.py [--out FILE] [--repeats N] [--frames N] [--only NAME ...] [--join]

Patches (192 px for blur, 128 px for noise) are cut from one procedural picture, blurred by a 5 px disc, with noise of
5 DN. One thread. ``one_patch`` is a call with a single patch, ``batched`` a call with many, per patch: least and median
time on the clock and of the processor, ms; on a busy machine the processor's is the one to read. ``preprocessing`` is
the part of the paper's blur network before its first layer, per patch. Networks whose weights are not released are
timed with fresh ones, which cost the same (``weights: untrained``).

``frame`` is the whole grid: 70 patches for blur, 150 for noise. ``clock_fps`` is what two processes reach together,
beside whatever else runs on the machine; ``processor_fps`` is two over the processor time of one frame, which is what
two free cores would give. ``joint`` is `pipeline.condition.ConditionMonitor`, blur, noise and maps in one call.

The report reads the file that this writes (benchmarks/results/estimators.json), so that its bytes do not depend on how
busy a machine was; measure again after a change of an estimator, and commit the file.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks import common  # noqa: E402

common.one_thread()

import numpy as np  # noqa: E402

from pipeline import blur, noise  # noqa: E402
from pipeline.datasets.patches import Patch, cut, tiles  # noqa: E402

FRAME_PX = (1200, 1920)
SIDES = {"blur": 192, "noise": 128}
ESTIMATORS: dict[str, tuple[tuple[str, str, dict[str, Any]], ...]] = {
    "blur": (
        ("spectral", "spectral", {}),
        ("cnn", "cnn", {}),
        ("pmp", "pmp", {"mode": "fast", "kernel_size": 31}),
        ("gbb", "gbb", {"mode": "fast", "kernel_size": 31}),
        ("pmp_exact", "pmp", {"mode": "exact", "kernel_size": 25}),
        ("gbb_exact", "gbb", {"mode": "exact", "kernel_size": 25}),
        ("fused", "fused", {"shared_blur": "never"}),
    ),
    "noise": tuple(
        (name, name, {}) for name in ("adaptive", "cellwise", "correlated", "cnn", "pca", "bf", "wavelet", "immerkaer")
    ),
}
SLOW_MS = 20.0
"""An estimator whose patch takes longer is timed in few turns, a few patches at a time, and on no whole frame."""

BATCHES = {"fast": 64, "slow": 4}
PROCESSES = 2


def frame() -> np.ndarray:
    """The picture: (1200, 1920) float32 in [0, 1] on the 8-bit grid."""
    from pipeline.camera.blur import blur as blurred
    from pipeline.camera.psf import create
    from pipeline.learning import dead_leaves
    from pipeline.streams import stream

    generator = stream(0, "estimators benchmark")
    squares = [dead_leaves.draw(generator, 640, supersampling=1) for _ in range(6)]
    picture = np.concatenate([np.concatenate(squares[:3], axis=1), np.concatenate(squares[3:], axis=1)])
    picture = np.asarray(blurred((0.1 * 255 + 0.8 * picture)[: FRAME_PX[0]], create("defocus", 5)))
    noisy = picture + generator.normal(0, 5, picture.shape)
    return (np.rint(np.clip(noisy, 0, 255)) / 255).astype(np.float32)


def create(task: str, kind: str, options: dict[str, Any]) -> tuple[Any, str]:
    """An estimator, and where its weights come from: ``"released"``, ``"untrained"``, or ``""`` without any."""
    released = {("blur", "cnn"): "mtf_cnn", ("noise", "cnn"): "sigma_cnn"}.get((task, kind))
    maker: Callable[..., Any] = blur.create if task == "blur" else noise.create
    if released is None:
        return maker(kind, **options), "released" if kind in ("spectral", "fused", "cellwise") else ""
    if (ROOT / f"data/weights/{released}.safetensors").is_file():
        return maker(kind, **options), "released"
    from pipeline.learning import weights
    from pipeline.learning.initial import initialise

    network: Any
    if task == "blur":
        from pipeline.blur.networks.cnn_net import ARCHITECTURE, MtfCnn

        network = MtfCnn()
    else:
        from pipeline.noise.networks.cnn_net import ARCHITECTURE, PixelNet

        network = PixelNet()
    initialise(network, 1, "estimators benchmark", "glorot")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "untrained.safetensors"
        weights.save(path, network.state_dict(), ARCHITECTURE)
        return maker(kind, weights=path, **options), "untrained"


def grid(task: str) -> list[Patch]:
    """Squares that cover the frame."""
    return tiles(FRAME_PX, SIDES[task], "cover")


def per_patch(task: str, estimator: Any, patches: np.ndarray, repeats: int) -> tuple[dict[str, Any], float]:
    """Times per patch, and the least processor time of one patch, ms."""
    estimator.estimate(patches[:1])
    start = time.thread_time()
    estimator.estimate(patches[:1])
    slow = (time.thread_time() - start) * 1e3 > SLOW_MS
    count = BATCHES["slow" if slow else "fast"]
    batch = patches[:count]
    turns = 3 if slow else repeats
    one = common.take_turns({"one": lambda: estimator.estimate(patches[:1])}, turns)["one"]
    many = common.take_turns({"many": lambda: estimator.estimate(batch)}, max(3, turns // 4))["many"]
    batched = {name: round(value / count, 4) for name, value in many.items()}
    return {"one_patch": one, "batched": {"patches": count, **batched}}, batched["processor_least_ms"]


def preprocessing(patches: np.ndarray) -> dict[str, Any]:
    """Times per patch of what the paper's blur network needs before it runs: grey levels and gradients, both ways."""
    import torch

    from pipeline.blur.networks.cnn_features import network_input

    image = torch.from_numpy(np.ascontiguousarray(patches[:, 0]))

    def both_directions() -> None:
        with torch.inference_mode():
            network_input(image)
            network_input(torch.rot90(image, -1, (1, 2)))

    times = common.take_turns({"both": both_directions}, 20)["both"]
    return {"patches": len(patches), **{name: round(value / len(patches), 4) for name, value in times.items()}}


def _worker(task: str, kind: str, options: dict[str, Any], frames: int, gate: Any, queue: Any) -> None:
    """Estimate whole frames in this process; tell when it began, when it ended, and its processor time per frame."""
    common.hold_loaded_libraries()
    picture = frame()
    call = whole_frame(task, kind, options, picture)
    common.hold_loaded_libraries()
    call()
    gate.wait()
    start, worked = time.time(), time.thread_time()
    for _ in range(frames):
        call()
    queue.put((start, time.time(), (time.thread_time() - worked) / frames))


def whole_frame(task: str, kind: str, options: dict[str, Any], picture: np.ndarray) -> Callable[[], Any]:
    """A call that estimates the whole grid of a frame, cutting the patches included."""
    if task == "joint":
        from pipeline.condition import ConditionMonitor

        monitor = ConditionMonitor()
        return lambda: monitor.frame(picture)
    estimator, squares = create(task, kind, options)[0], grid(task)
    return lambda: estimator.estimate(cut(picture, squares))


def frames_per_second(task: str, kind: str, options: dict[str, Any], frames: int) -> dict[str, float]:
    """Whole frames per second of two processes: on the clock, and by their processor time."""
    context = multiprocessing.get_context("spawn")
    gate, queue = context.Barrier(PROCESSES), context.Queue()
    arguments = (task, kind, options, frames, gate, queue)
    workers = [context.Process(target=_worker, args=arguments) for _ in range(PROCESSES)]
    for worker in workers:
        worker.start()
    results = [queue.get(timeout=600) for _ in workers]
    for worker in workers:
        worker.join()
    took = max(end for _, end, _ in results) - min(start for start, _, _ in results)
    seconds = float(np.mean([worked for _, _, worked in results]))
    return {
        "clock_fps": round(PROCESSES * frames / took, 2),
        "processor_fps": round(PROCESSES / seconds, 2),
        "processor_ms_per_frame": round(1e3 * seconds, 2),
        "patches": 0 if task == "joint" else len(grid(task)),
    }


def main() -> None:
    """Time, print, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, help="JSON file, by default benchmarks/results/estimators.json")
    parser.add_argument("--repeats", type=int, default=40)
    parser.add_argument("--frames", type=int, default=5, help="whole frames per process")
    parser.add_argument(
        "--only", nargs="*", default=(), help="tasks or estimators to time, e.g. noise, spectral, joint"
    )
    parser.add_argument("--join", action="store_true", help="keep what the file has of others, measured earlier")
    arguments = parser.parse_args()
    common.hold_loaded_libraries()
    picture = frame()
    results: dict[str, dict[str, Any]] = {}
    if arguments.join:
        path = arguments.out or common.RESULTS / "estimators.json"
        results = json.loads(path.read_text(encoding="utf-8"))["results"]
    for task, estimators in ESTIMATORS.items():
        patches = cut(picture, grid(task))
        for name, kind, options in estimators:
            if arguments.only and not {task, name} & set(arguments.only):
                continue
            estimator, weights = create(task, kind, options)
            common.hold_loaded_libraries()
            record, batched_ms = per_patch(task, estimator, patches, arguments.repeats)
            record |= {"options": options, **({"weights": weights} if weights else {})}
            if (task, kind) == ("blur", "cnn"):
                record["preprocessing"] = preprocessing(patches[: BATCHES["slow"]])
            if batched_ms <= SLOW_MS:
                record["frame"] = frames_per_second(task, kind, options, arguments.frames)
            results.setdefault(task, {})[name] = record
            one, fps = record["one_patch"]["processor_median_ms"], record.get("frame", {}).get("processor_fps", "-")
            print(f"{task:6s}{name:10s} one {one:9.3f} ms   batched {batched_ms:9.3f} ms   {fps} fps", flush=True)
    if not arguments.only or "joint" in arguments.only:
        results["joint"] = {"spectral + adaptive": {"frame": frames_per_second("joint", "", {}, arguments.frames)}}
        print("joint", results["joint"], flush=True)
    about = common.machine("torch", "opencv-python-headless", "scikit-image")
    sizes = {"frame_px": [FRAME_PX[1], FRAME_PX[0]], "patch_px": SIDES, "processes": PROCESSES}
    common.write("estimators", {"machine": about, **sizes, "results": results}, arguments.out)


if __name__ == "__main__":
    common.run(main)
