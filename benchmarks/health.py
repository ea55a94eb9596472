"""Throughput and memory of ``camera-monitor health`` on full-HD frames, beside all tiles of a frame and stand-ins.

    python benchmarks/health.py [--out FILE] [--frames N] [--cores N]

Frames are JPEG files of procedural pictures with noise of 5 DN, so that both noise networks could run on every tile.
The command runs as a user runs it, in a process of its own, twice: on a quarter of the frames and on all. The
difference of the two is free of start-up:

    processor_ms    processor time a frame, all threads
    clock_fps       frames a second on the clock, beside whatever else runs on the machine
    processor_fps   cores over the processor time a frame: what as many free cores give at most
    peak_mb         largest memory on a quarter of the frames and on all

``every tile and patch`` is ``--tiles 1000 --patches 1000``: noise on all 135 tiles of a frame instead of 54, blur on
all 60 patches instead of 28. ``colour`` are the frames as colour JPEG. ``stand-ins`` are the variance of the Laplacian
(OpenCV) and scikit-image's ``estimate_sigma``, decoding included: what they cost, not what they know.

``median`` compares the frame's noise from the selected tiles with that from all of them, on the pictures without JPEG
and with, for noise of several strengths: mean absolute error to the noise added, and the largest difference.
``blur median`` compares the frame's MTF from the selected patches with that from all of them, for blur of several
strengths, the same everywhere or growing from the middle to the corners (``uneven``): mean and largest absolute
difference, half the width of the selection's 95 % interval, and the fraction of values of all patches within it.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks import common  # noqa: E402

common.one_thread()

import cv2  # noqa: E402
import numpy as np  # noqa: E402
from numpy.typing import NDArray  # noqa: E402

from pipeline.streams import stream  # noqa: E402

HEIGHT_PX, WIDTH_PX = 1080, 1920
PICTURES = 4
SIGMA_DN = 5.0
QUALITY = 92
EVERY_TILE = 1000
LEVELS_DN = (2.0, 5.0, 10.0, 20.0)
MEDIAN_QUALITIES = (0, 80)  # of JPEG; 0: not coded
BLURS_PX = (0.0, 1.0, 2.0, 4.0)  # standard deviation of a Gaussian


def pictures() -> list[NDArray[np.float32]]:
    """Procedural pictures (1080, 1920), DN, slightly blurred as by a lens."""
    from pipeline.learning import dead_leaves

    results = []
    for number in range(PICTURES):
        generator = stream(0, "health benchmark", number)
        squares = [dead_leaves.draw(generator, 640, supersampling=1) for _ in range(6)]
        whole = np.concatenate([np.concatenate(squares[:3], axis=1), np.concatenate(squares[3:], axis=1)])
        results.append(np.asarray(cv2.GaussianBlur(whole[:HEIGHT_PX, :WIDTH_PX], (0, 0), 0.8), dtype=np.float32))
    return results


def noisy(picture: NDArray[np.float32], sigma_dn: float, number: int, quality: int) -> NDArray[np.uint8]:
    """The picture with white noise, (1080, 1920) 8 bit, stored as JPEG and read again unless the quality is 0."""
    draw = stream(0, "health benchmark noise", sigma_dn, number)
    levels = picture + np.float32(sigma_dn) * draw.standard_normal(picture.shape, dtype=np.float32)
    frame = np.clip(np.rint(levels), 0, 255).astype(np.uint8)
    return _decoded(_jpeg(frame, quality)) if quality else frame


def coloured(frame: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A grey frame as a colour frame (1080, 1920, 3) of smoothly varying hue."""
    across = np.linspace(-1, 1, frame.shape[1], dtype=np.float32)[None, :, None]
    tint = np.float32(12) * across * np.array([1, -0.2, -0.8], np.float32)
    return np.clip(np.rint(frame[..., None] + tint), 0, 255).astype(np.uint8)


def _jpeg(frame: NDArray[np.uint8], quality: int) -> NDArray[np.uint8]:
    return np.asarray(cv2.imencode(".jpg", frame, [cv2.IMWRITE_JPEG_QUALITY, quality])[1], dtype=np.uint8)


def _decoded(code: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.asarray(cv2.imdecode(code, cv2.IMREAD_GRAYSCALE), dtype=np.uint8)


def health(files: list[Path], out: Path, options: tuple[str, ...], cores: int) -> dict[str, float]:
    """Wall time, processor time and peak memory of one run of the command."""
    command = [sys.executable, "-m", "pipeline.cli", "health", *map(str, files), "--out", str(out), *options]
    start = time.perf_counter()
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    os.sched_setaffinity(process.pid, set(sorted(os.sched_getaffinity(0))[:cores]))
    _, status, used = os.wait4(process.pid, 0)
    if os.waitstatus_to_exitcode(status) != 0:
        raise SystemExit(f"health failed: {' '.join(command[:5])} ...")
    return {
        "clock_s": time.perf_counter() - start,
        "processor_s": used.ru_utime + used.ru_stime,
        "peak_mb": used.ru_maxrss / 1024,
    }


def throughput(files: list[Path], folder: Path, options: tuple[str, ...], cores: int) -> dict[str, Any]:
    """Per-frame figures from the difference of a run on a quarter of the frames and one on all."""
    part, whole = (health(files[:count], folder / "out", options, cores) for count in (len(files) // 4, len(files)))
    frames = len(files) - len(files) // 4
    seconds, worked = whole["clock_s"] - part["clock_s"], whole["processor_s"] - part["processor_s"]
    return {
        "options": list(options),
        "processor_ms": round(1e3 * worked / frames, 1),
        "clock_fps": round(frames / seconds, 2),
        "processor_fps": round(cores * frames / worked, 2),
        "whole_run_fps": round(len(files) / whole["clock_s"], 2),
        "peak_mb": [round(part["peak_mb"]), round(whole["peak_mb"])],
    }


def stand_ins(files: list[Path]) -> dict[str, float]:
    """Processor time a frame of usual measures of sharpness and noise, decoding included, ms."""
    from skimage.restoration import estimate_sigma

    def read(file: Path) -> NDArray[np.uint8]:
        return _decoded(np.frombuffer(file.read_bytes(), np.uint8))

    def laplacian(file: Path) -> None:
        cv2.Laplacian(read(file), cv2.CV_32F).var()

    def wavelet(file: Path) -> None:
        estimate_sigma(read(file))

    results = {}
    for name, call in {"Laplacian": laplacian, "scikit-image estimate_sigma": wavelet}.items():
        call(files[0])
        start = time.thread_time()
        for file in files[:10]:
            call(file)
        results[name] = round(1e3 * (time.thread_time() - start) / len(files[:10]), 1)
    return results


def medians() -> list[dict[str, Any]]:
    """The frame's noise by the selected tiles and by all."""
    from pipeline import noise
    from pipeline.condition.frame_tiles import MOST_TILES, frame_tiles
    from pipeline.condition.summary import summarise
    from pipeline.datasets.patches import cut

    estimator = noise.create(noise.DEFAULT)
    common.hold_loaded_libraries()
    rows = []
    for quality in MEDIAN_QUALITIES:
        for sigma_dn in LEVELS_DN:
            answers = []
            for number, picture in enumerate(pictures()):
                frame = noisy(picture, sigma_dn, number, quality).astype(np.float32) / np.float32(255)
                line = []
                for most in (MOST_TILES, EVERY_TILE):
                    estimate = estimator.estimate(cut(frame, frame_tiles(frame.shape, 128, most)))
                    line.append(float(summarise(estimate.sigma_dn, estimate.low_dn, estimate.high_dn).value))
                answers.append(line)
            selected, every = np.array(answers).T
            rows.append({
                "sigma_dn": sigma_dn, "jpeg_quality": quality or None,
                "error_selected_dn": round(float(np.abs(selected - sigma_dn).mean()), 3),
                "error_every_dn": round(float(np.abs(every - sigma_dn).mean()), 3),
                "largest_difference_dn": round(float(np.abs(selected - every).max()), 3),
            })  # fmt: skip
            print(rows[-1], flush=True)
    return rows


def blurred(picture: NDArray[np.float32], blur_px: float, uneven: bool) -> NDArray[np.float32]:
    """The picture blurred everywhere, or from nothing in the middle to all of it in the corners, as 8 bit in [0, 1]."""
    wide = np.asarray(cv2.GaussianBlur(picture, (0, 0), blur_px), np.float32) if blur_px else picture
    if uneven:
        down, across = (np.linspace(-1, 1, side, dtype=np.float32) for side in picture.shape)
        weight = ((down[:, None] ** 2 + across[None] ** 2) / 2).astype(np.float32)
        wide = (1 - weight) * picture + weight * wide
    return np.asarray(np.rint(np.clip(wide, 0, 255)) / np.float32(255), dtype=np.float32)


def blur_medians() -> list[dict[str, Any]]:
    """The frame's MTF by the selected patches and by all."""
    from pipeline import blur
    from pipeline.condition.frame_tiles import MOST_PATCHES, frame_tiles
    from pipeline.condition.summary import summarise
    from pipeline.datasets.patches import cut

    estimator = blur.create("spectral")
    rows = []
    for blur_px, uneven in [(blur_px, False) for blur_px in BLURS_PX] + [(BLURS_PX[-1], True)]:
        differences, reaches, within = [], [], []
        for picture in pictures():
            frame = blurred(picture, blur_px, uneven)
            selected, every = (
                summarise(estimate.mtf, estimate.low, estimate.high)
                for most in (MOST_PATCHES, EVERY_TILE)
                for estimate in [estimator.estimate(cut(frame, frame_tiles(frame.shape, 192, most)))]
            )
            differences.append(np.abs(selected.value - every.value))
            reaches.append((selected.high - selected.low) / 2)
            within.append((selected.low <= every.value) & (every.value <= selected.high))
        rows.append({
            "blur_px": blur_px, "uneven": uneven,
            "mean_difference_percent": round(100 * float(np.mean(differences)), 2),
            "largest_difference_percent": round(100 * float(np.max(differences)), 2),
            "half_interval_percent": round(100 * float(np.mean(reaches)), 2),
            "within_interval_fraction": round(float(np.mean(within)), 3),
        })  # fmt: skip
        print(rows[-1], flush=True)
    return rows


def main() -> None:
    """Make frames, run, print, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--frames", type=int, default=100)
    parser.add_argument("--cores", type=int, default=2)
    arguments = parser.parse_args()
    common.hold_loaded_libraries()
    with tempfile.TemporaryDirectory() as name:
        folder, made = Path(name), pictures()
        grey, colour = ([folder / f"{kind}{number:04d}.jpg" for number in range(arguments.frames)] for kind in "gc")
        for number in range(arguments.frames):
            frame = noisy(made[number % PICTURES], SIGMA_DN, number, 0)
            grey[number].write_bytes(_jpeg(frame, QUALITY).tobytes())
            colour[number].write_bytes(_jpeg(coloured(frame), QUALITY).tobytes())
        results: dict[str, Any] = {}
        every = ("--tiles", str(EVERY_TILE), "--patches", str(EVERY_TILE))
        for title, files, options in (
            ("health", grey, ()), ("health, colour", colour, ()), ("health, every tile and patch", grey, every),
        ):  # fmt: skip
            results[title] = throughput(files, folder, options, arguments.cores)
            print(title, results[title], flush=True)
        results["stand-ins, processor ms"] = stand_ins(grey)
    record = {
        "machine": common.machine("torch", "opencv-python-headless", "scikit-image"),
        "frame_px": [WIDTH_PX, HEIGHT_PX],
        "frames": arguments.frames,
        "cores": arguments.cores,
        "jpeg_quality": QUALITY,
        "sigma_dn": SIGMA_DN,
        "results": results,
        "median": medians(),
        "blur median": blur_medians(),
    }
    common.write("health", record, arguments.out)


if __name__ == "__main__":
    common.run(main)
