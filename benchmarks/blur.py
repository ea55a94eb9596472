"""Blurring one frame: this package beside its peers, same boundary, one thread, outputs compared first.

    python benchmarks/blur.py [--out FILE] [--repeats N] [--sizes 3,7,...] [--frame 1242x375]

Every implementation blurs the same float32 frame by the same disc. One that differs from SciPy's direct convolution
in double precision by more than 1e-5 is reported as wrong and not timed. Timed calls take turns, so that a busy
moment of the machine hits all alike. ``ratio`` is a peer's least processor time over ours; below 1 we lose. Peers
that are not installed are named as absent.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks import common  # noqa: E402

common.one_thread()

import numpy as np  # noqa: E402

from pipeline import streams  # noqa: E402
from pipeline.camera.blur import blur  # noqa: E402
from pipeline.camera.psf import create  # noqa: E402

TOLERANCE = 1e-5
SLOW_MS = 40.0
"""A contestant whose first call takes longer is timed in few turns."""
Call = Callable[[], np.ndarray]


def contestants(image: np.ndarray, psf: np.ndarray, boundary: str) -> dict[str, Call | str]:
    """Name -> a call that blurs, or the reason why there is none.

    Args:
        image: (H, W) float32.
        psf: (n, n) float32, odd n.
        boundary: ``"reflect"`` (mirror about the border pixel) or ``"zero"``.
    """
    import cv2
    import scipy.ndimage
    import scipy.signal
    import torch

    half = psf.shape[0] // 2
    flipped = np.ascontiguousarray(psf[::-1, ::-1])
    tensor = torch.from_numpy(image)
    border = cv2.BORDER_REFLECT_101 if boundary == "reflect" else cv2.BORDER_CONSTANT
    mode = "reflect" if boundary == "reflect" else "constant"

    def padded() -> np.ndarray:
        return np.pad(image, half, mode="reflect") if boundary == "reflect" else np.pad(image, half)

    def conv2d() -> np.ndarray:
        pad = torch.nn.functional.pad(tensor[None, None], (half,) * 4, mode=mode)
        return torch.nn.functional.conv2d(pad, torch.from_numpy(flipped)[None, None])[0, 0].numpy()

    calls: dict[str, Call | str] = {
        "ours": lambda: blur(image, psf, boundary),
        "ours, torch tensor": lambda: blur(tensor, psf, boundary).numpy(),
        "cv2.filter2D": lambda: cv2.filter2D(image, -1, flipped, borderType=border),
        "scipy.signal.fftconvolve": lambda: scipy.signal.fftconvolve(padded(), psf, mode="valid"),
        "scipy.signal.oaconvolve": lambda: scipy.signal.oaconvolve(padded(), psf, mode="valid"),
        "scipy.ndimage.convolve": lambda: scipy.ndimage.convolve(
            image, psf, mode="mirror" if boundary == "reflect" else "constant"
        ),
        "torch conv2d": conv2d,
    }
    try:
        import kornia

        kernel = torch.from_numpy(flipped)[None]
        calls["kornia filter2d"] = lambda: kornia.filters.filter2d(tensor[None, None], kernel, mode)[0, 0].numpy()
        calls["kornia filter2d fft"] = lambda: kornia.filters.fft_conv(tensor[None, None], kernel, mode)[0, 0].numpy()
    except (ImportError, AttributeError) as error:
        calls["kornia"] = f"absent: {error}"
    try:
        import deepinv.physics.functional as deepinv

        if boundary == "reflect":
            filter_ = torch.from_numpy(psf)[None, None]
            calls["deepinv conv2d"] = lambda: deepinv.conv2d(tensor[None, None], filter_, padding="reflect")[
                0, 0
            ].numpy()
    except ImportError as error:
        calls["deepinv"] = f"absent: {error}"
    return calls


def compare(image: np.ndarray, psf: np.ndarray, boundary: str, repeats: int) -> dict[str, dict[str, Any]]:
    """Check and time every contestant: name -> its largest difference, times in ms and ratio to ours."""
    import scipy.ndimage

    reference = scipy.ndimage.convolve(
        image.astype(np.float64), psf.astype(np.float64), mode="mirror" if boundary == "reflect" else "constant"
    )
    records: dict[str, dict[str, Any]] = {}
    running: dict[str, Call] = {}
    for name, call in contestants(image, psf, boundary).items():
        if isinstance(call, str):
            records[name] = {"status": call}
            continue
        difference = float(np.abs(call() - reference).max())
        right = difference <= TOLERANCE
        records[name] = {"status": "ok" if right else "wrong output, not timed", "max_difference": difference}
        if right:
            running[name] = call
    slow = {name for name, call in running.items() if name != "ours" and first_ms(call) > SLOW_MS}
    times = common.take_turns({name: running[name] for name in running.keys() - slow}, repeats)
    times |= common.take_turns({name: running[name] for name in slow}, max(3, repeats // 20))
    for name, taken in times.items():
        ratio = taken["processor_least_ms"] / times["ours"]["processor_least_ms"]
        records[name] |= {**taken, "ratio": round(ratio, 2)}
    return records


def first_ms(call: Call) -> float:
    """Processor time of one call, ms."""
    start = time.thread_time()
    call()
    return (time.thread_time() - start) * 1e3


def main() -> None:
    """Compare, time, print, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, help="JSON file, by default benchmarks/results/blur.json")
    parser.add_argument("--repeats", type=int, default=100)
    parser.add_argument("--sizes", default="3,7,11,15,21,31", help="disc diameters, odd pixels")
    parser.add_argument("--frame", default="1242x375", help="width x height, pixels")
    arguments = parser.parse_args()
    common.hold_loaded_libraries()
    width, height = map(int, arguments.frame.split("x"))
    image = streams.stream(0, "blur benchmark").random((height, width), dtype=np.float32)
    results: dict[str, dict[str, dict[str, dict[str, Any]]]] = {}
    for boundary in ("reflect", "zero"):
        results[boundary] = {}
        for size in arguments.sizes.split(","):
            records = compare(image, create("defocus", int(size)), boundary, arguments.repeats)
            results[boundary][f"{size} px"] = records
            for name, record in records.items():
                times = record["status"]
                if "ratio" in record:
                    worked, clock = record["processor_least_ms"], record["least_ms"]
                    times = f"{worked:8.2f} ms   clock {clock:8.2f}   x {record['ratio']}"
                print(f"{boundary:8s}{size:>4s} px  {name:26s}{times}", flush=True)
    about = common.machine("torch", "opencv-python-headless", "kornia", "deepinv")
    common.write("blur", {"machine": about, "frame": arguments.frame, "results": results}, arguments.out)


if __name__ == "__main__":
    common.run(main)
