"""What every benchmark needs: one thread, calls that take turns, a description of the machine, a JSON file."""

from __future__ import annotations

import argparse
import os
import platform
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "benchmarks" / "results"
THREAD_SETTINGS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS")


def one_thread() -> None:
    """Hold every library to one thread; call it before NumPy, torch or OpenCV are imported."""
    for name in THREAD_SETTINGS:
        os.environ[name] = "1"


def hold_loaded_libraries() -> None:
    """Hold torch and OpenCV to one thread where they are installed."""
    try:
        import torch

        torch.set_num_threads(1)
    except ImportError:
        pass
    try:
        import cv2

        cv2.setNumThreads(1)
    except ImportError:
        pass


def run(main: Callable[[], object]) -> None:
    """Run a benchmark; what it cannot use is one line on standard error, and exit code 2."""
    try:
        main()
    except Exception as error:
        from pipeline.errors import InputError  # not before: importing the package pins instruction sets

        if not isinstance(error, InputError):
            raise
        print(f"error: {error}", file=sys.stderr)
        raise SystemExit(2) from None


def positive(text: str) -> int:
    """A whole number of at least 1, of a command line."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text}: expected a whole number of at least 1")
    return int(text)


def dataset(text: str) -> tuple[str, str, str]:
    """Name, kind and folder of a dataset, from NAME=KIND:ROOT on the command line.

    Raises:
        InputError: it is no such text, or there is no such folder.
    """
    from pipeline.errors import InputError

    name, _, rest = text.partition("=")
    kind, _, root = rest.partition(":")
    if not (name and kind and root):
        raise InputError(f"{text}: expected NAME=KIND:ROOT, for example kitti=kitti:data/raw/kitti")
    if not Path(root).is_dir():
        raise InputError(f"{text}: no folder {root}; expected that of the dataset {name}")
    return name, kind, root


def machine(*packages: str) -> dict[str, Any]:
    """What the times were measured on.

    Args:
        packages: distributions whose versions matter, beside NumPy and SciPy.

    Returns:
        processor, cores, load, threads, Python and package versions (None where not installed).
    """
    versions: dict[str, str | None] = {}
    for package in ("numpy", "scipy", *packages):
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            versions[package] = None
    return {
        "processor": processor(),
        "cores": os.cpu_count(),
        "load": [round(value, 2) for value in os.getloadavg()],
        "threads": 1,
        "system": platform.system(),
        "python": platform.python_version(),
        "packages": versions,
    }


def processor() -> str:
    """Name of the processor, with the widest vector unit it reports."""
    listing = Path("/proc/cpuinfo")
    if not listing.exists():
        return platform.processor() or platform.machine()
    fields = dict(line.split(":", 1) for line in listing.read_text().splitlines() if ":" in line)
    fields = {key.strip(): value.strip() for key, value in fields.items()}
    flags = fields.get("flags", "").split()
    vectors = next((unit for unit in ("avx512f", "avx2", "avx", "sse2") if unit in flags), "")
    return " ".join(part for part in (fields.get("model name", platform.machine()), vectors) if part)


def take_turns(calls: Mapping[str, Callable[[], object]], repeats: int) -> dict[str, dict[str, float]]:
    """Time calls in turns, so that a busy moment of the machine hits all alike.

    Args:
        calls: name -> what to time; each is called once before, untimed.
        repeats: turns.

    Returns:
        name -> least and median time on the clock and of the processor (the calling thread's, which other programs do
        not enter), ms.
    """
    clock: dict[str, list[float]] = {name: [] for name in calls}
    worked: dict[str, list[float]] = {name: [] for name in calls}
    for turn in range(repeats + 1):
        for name, call in calls.items():
            start, start_worked = time.perf_counter(), time.thread_time()
            call()
            if turn:
                worked[name].append((time.thread_time() - start_worked) * 1e3)
                clock[name].append((time.perf_counter() - start) * 1e3)
    return {
        name: {
            "least_ms": round(min(clock[name]), 3),
            "median_ms": round(sorted(clock[name])[len(clock[name]) // 2], 3),
            "processor_least_ms": round(min(worked[name]), 3),
            "processor_median_ms": round(sorted(worked[name])[len(worked[name]) // 2], 3),
        }
        for name in calls
    }


def check_datasets(name: str, datasets: Iterable[str], out: Path | None = None) -> None:
    """Check that a record names every dataset of the record that it would replace.

    Benchmarks of several datasets call it before they measure; `write` calls it again.

    Args:
        name: of the benchmark.
        datasets: that the new record names (its key ``datasets``).
        out: file of the record; None for ``benchmarks/results/<name>.json``.

    Raises:
        InputError: the file names a dataset that the new record lacks, or cannot be read.
    """
    sys.path.insert(0, str(ROOT))
    from pipeline.errors import InputError
    from pipeline.store import read_json

    path = _path(name, out)
    recorded = read_json(path).get("datasets", []) if path.is_file() else []
    lacking = sorted(set(recorded) - set(datasets))
    if lacking:
        raise InputError(
            f"{path}: has {', '.join(recorded)}, the new record would lack {', '.join(lacking)}; "
            f"measure these too, or write another file with --out FILE"
        )


def write(name: str, record: Mapping[str, Any], out: Path | None = None) -> Path:
    """Write a benchmark's record.

    Args:
        name: of the benchmark; the file is ``benchmarks/results/<name>.json`` unless ``out`` names another.
        record: to write; of a benchmark of several datasets with their names as ``datasets``.
        out: another file.

    Returns:
        the file.

    Raises:
        InputError: errors of `check_datasets`; the file is left as it is.
    """
    check_datasets(name, record.get("datasets", []), out)
    from pipeline.store import write_json

    path = _path(name, out)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_json(path, dict(record))
    return path


def _path(name: str, out: Path | None) -> Path:
    return out or RESULTS / f"{name}.json"
