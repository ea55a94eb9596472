"""Stages under emulated processors: which write the same bytes as natively.

    KEEP=1 .ci/smoke                                              # leaves a copy with every stage's outputs
    python benchmarks/processors.py FOLDER [--only STAGE ...] [--processors EPYC-Rome Haswell] [--minutes N]
                                           [--numpy-without X86_V3]

Each stage of the copy's ``dvc.lock`` is run again by qemu's user mode (``qemu-x86_64``, about 20 times slower), on the
inputs made natively, and its outputs are compared file by file; then the native ones are put back. A stage that takes
longer than ``--minutes`` is stopped. The record (``benchmarks/results/processors.json``) keeps, per stage and
processor, ``same``, ``differs`` with the files, ``stopped``, or ``failed`` with the last line; the rest of it stays.
``--numpy-without`` switches off kernels of NumPy for the emulated run alone, where the emulator cannot run them; the
record names them. FOLDER may be any project folder with ``dvc.lock`` and its outputs, whose ``params.yaml`` has
``executor.workers: 1``: further processes would run natively.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks import common  # noqa: E402

PROCESSORS = ("EPYC-Rome", "Haswell")
RECORD = common.RESULTS / "processors.json"


def hashes(folder: Path, outs: list[str]) -> dict[str, str]:
    """SHA-256 of every file of a stage's outputs."""
    files = [
        file for out in outs for file in ([folder / out] if (folder / out).is_file() else (folder / out).rglob("*"))
    ]
    return {
        file.relative_to(folder).as_posix(): hashlib.sha256(file.read_bytes()).hexdigest()
        for file in sorted(files)
        if file.is_file()
    }


def emulated(folder: Path, entry: dict[str, Any], processor: str, minutes: float, without: str = "") -> dict[str, Any]:
    """Run a stage on an emulated processor and compare; its native outputs are there again afterwards."""
    outs = [out["path"] for out in entry["outs"]]
    native = hashes(folder, outs)
    module, *words = re.search(r"python -m (\S+)(.*)", " ".join(entry["cmd"].split()))[0].split()[2:]
    interpreter = str(Path(sys.executable).resolve())
    environment = {"PYTHONPATH": f"{folder}:{sysconfig.get_paths()['purelib']}", "OMP_NUM_THREADS": "1"}
    switched_off = {"numpy_without": without} if without else {}
    environment |= {"NPY_DISABLE_CPU_FEATURES": without} if without else {}
    with tempfile.TemporaryDirectory() as kept:
        for number, out in enumerate(outs):
            shutil.move(folder / out, Path(kept) / str(number))
        try:
            done = subprocess.run(
                ["qemu-x86_64", "-cpu", processor, interpreter, "-m", module, *words],
                cwd=folder, env={**os.environ, **environment}, capture_output=True, text=True, timeout=60 * minutes,
            )  # fmt: skip
            again = hashes(folder, outs)
        except subprocess.TimeoutExpired:
            return {"result": "stopped", "minutes": minutes, **switched_off}
        finally:
            for number, out in enumerate(outs):
                path = folder / out
                shutil.rmtree(path, ignore_errors=True) if path.is_dir() else path.unlink(missing_ok=True)
                shutil.move(Path(kept) / str(number), path)
    if done.returncode:
        return {"result": "failed", "reason": (done.stderr.strip().splitlines() or ["?"])[-1], **switched_off}
    differing = sorted(name for name in native.keys() | again.keys() if native.get(name) != again.get(name))
    return {
        "result": "differs" if differing else "same", "files": len(native), "differing": differing, **switched_off
    }  # fmt: skip


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="+", default=None, help="stages, by name or group")
    parser.add_argument("--processors", nargs="+", default=list(PROCESSORS), help="of qemu-x86_64 -cpu help")
    parser.add_argument("--minutes", type=float, default=30.0, help="per stage and processor")
    parser.add_argument("--numpy-without", default="", help="features that NumPy is held from, e.g. X86_V3")
    arguments = parser.parse_args()
    folder = arguments.folder.resolve()
    stages = yaml.safe_load((folder / "dvc.lock").read_text(encoding="utf-8"))["stages"]
    record = json.loads(RECORD.read_text()) if RECORD.exists() else {"stages": {}}
    record |= {"machine": common.machine("torch", "opencv-python-headless"), "not_run": []}
    for name, entry in stages.items():
        if not entry.get("outs") or (arguments.only and not {name, name.partition("@")[0]} & set(arguments.only)):
            continue
        for processor in arguments.processors:
            answer = emulated(folder, entry, processor, arguments.minutes, arguments.numpy_without)
            print(name, processor, answer["result"], flush=True)
            record["stages"].setdefault(name, {})[processor] = answer
    record["not_run"] = sorted(name for name in stages if name not in record["stages"])
    common.write("processors", record)


if __name__ == "__main__":
    main()
