"""Cost of pinning the numerical libraries to AVX2: estimators, and training steps of the spectral network.

Each case runs in processes of its own, pinned and not pinned in turn, on one thread; times are of the processor.

    python benchmarks/pins.py [--turns 3] [--steps 20]
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks import common  # noqa: E402

common.one_thread()

ESTIMATORS = {
    "spectral_single": ("blur", "spectral", 192, 1),
    "spectral": ("blur", "spectral", 192, 16),
    "blur_cnn": ("blur", "cnn", 192, 4),
    "gbb": ("blur", "gbb", 192, 1),
    "adaptive": ("noise", "adaptive", 128, 64),
    "cellwise": ("noise", "cellwise", 128, 64),
    "noise_cnn": ("noise", "cnn", 128, 4),
    "pca": ("noise", "pca", 128, 64),
}
"""Case -> package, estimator, patch size in pixels, patches of a call."""
TRAININGS = {"training_bfloat16": True, "training_float32": False}
CALLS = 9


def estimator_call(name: str) -> Callable[[], object]:
    """One call of an estimator on noisy discs."""
    import importlib

    import numpy as np

    from pipeline.streams import stream

    package, kind, size, count = ESTIMATORS[name]
    generator = stream(1, "benchmark of pins", name)
    rows, columns = np.mgrid[:size, :size]
    patch = np.full((size, size), 0.5)
    for x, y, radius, level in generator.random((60, 4)) * (size, size, 40, 1):
        patch[(columns - x) ** 2 + (rows - y) ** 2 < radius**2] = level
    patches = patch + 0.02 * generator.standard_normal((count, 1, size, size))
    patches = (np.rint(255 * patches.clip(0, 1)) / 255).astype(np.float32)
    estimator = importlib.import_module(f"pipeline.{package}").create(kind)
    return lambda: estimator.estimate(patches)


def training_call(half_precision: bool) -> Callable[[], object]:
    """One step of the optimiser on a batch of 64."""
    import numpy as np
    import torch

    from pipeline.blur.networks.spectral_net import SpectralNet
    from pipeline.blur.training import spectral as spectral_training
    from pipeline.learning.initial import initialise
    from pipeline.learning.samples import Chunk
    from pipeline.streams import stream

    generator = stream(1, "benchmark of pins", "training")
    chunk = Chunk(
        generator.integers(0, 256, (64, 192, 192), dtype=np.uint8),
        generator.random((64, 2, 8), dtype=np.float32),
        generator.random(64, dtype=np.float32) * 20,
    )
    batch = {name: torch.from_numpy(values) for name, values in spectral_training.feature_arrays(chunk).items()}
    model = SpectralNet(half_precision=half_precision)
    initialise(model, 1, "spectral network")
    model.to(memory_format=torch.channels_last).train()  # type: ignore[call-overload]
    optimiser = torch.optim.AdamW(model.parameters(), lr=2e-3)

    def step() -> None:
        value, _ = spectral_training.loss(model, dict(batch))
        optimiser.zero_grad(set_to_none=True)
        value.backward()
        torch.nn.utils.clip_grad_norm_(model.parameters(), 1.0)
        optimiser.step()

    return step


def measure(case: str, calls: int) -> float:
    """Median processor time of a call in this process, ms; two calls before are not counted."""
    import pipeline  # noqa: F401  pins the libraries before torch is loaded

    call = training_call(TRAININGS[case]) if case in TRAININGS else estimator_call(case)
    common.hold_loaded_libraries()
    times = []
    for _ in range(calls + 2):
        start = time.process_time()
        call()
        times.append((time.process_time() - start) * 1e3)
    return sorted(times[2:])[calls // 2]


def main() -> None:
    """Measure all cases, pinned and not, and write the record."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--steps", type=int, default=20, help="of each training")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--case", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.case:
        print(json.dumps(measure(given.case, given.steps if given.case in TRAININGS else CALLS)))
        return
    results = {}
    for case in (*ESTIMATORS, *TRAININGS):
        times: dict[str, list[float]] = {"": [], "off": []}
        for _ in range(given.turns):
            for switch, measured in times.items():
                command = [sys.executable, __file__, "--case", case, "--steps", str(given.steps)]
                environment = os.environ | {"CAMERA_MONITOR_PINS": switch}
                ran = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
                measured.append(json.loads(ran.stdout.splitlines()[-1]))
        pinned, free = (sorted(times[switch])[given.turns // 2] for switch in ("", "off"))
        results[case] = {
            "pinned_ms": round(pinned, 2),
            "not_pinned_ms": round(free, 2),
            "ratio": round(pinned / free, 2),
        }
        print(f"{case:20} {pinned:9.1f} ms pinned {free:9.1f} ms not pinned  x {pinned / free:.2f}", file=sys.stderr)
    common.write("pins", {"machine": common.machine("torch"), "steps": given.steps, "results": results}, given.out)


if __name__ == "__main__":
    common.run(main)
