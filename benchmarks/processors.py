"""Stages under emulated processors: which write the same bytes as natively.

    KEEP=1 .ci/smoke                                              # leaves a copy with every stage's outputs
    python benchmarks/processors.py FOLDER [--only STAGE ...] [--processors EPYC-Rome Haswell] [--minutes N]
                                           [--qemu PROGRAM] [--inputs TEXT]

Each stage of the copy's ``dvc.lock`` is run again by qemu's user mode (``qemu-x86_64``, about 20 times slower), on the
inputs made natively and without what the native run left in ``.cache`` (checkpoints, pictures), and its outputs are
compared file by file; then the native ones are put back. As with ``pipeline.dvc``, stages run in children of one
process that has the libraries loaded, which takes half a minute. A stage that takes longer than ``--minutes`` is
stopped. The record (``benchmarks/results/processors.json``) keeps, per stage and
processor, the emulator's version and ``same``, ``differs`` with the files, ``stopped``, or ``failed`` with the last
line; the rest of it stays. ``--inputs`` is kept in each answer: what the stages computed where it is not what a profile
says, for example fewer steps. An emulator that sorts wrongly is refused: qemu 7.2 (Debian 12) computes NumPy's AVX2
``argsort`` wrongly, qemu 10 rightly. FOLDER may be any project folder with ``dvc.lock`` and its outputs, whose
``params.yaml`` has ``executor.workers: 1``: further processes would run natively.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import shutil
import signal
import subprocess
import sys
import sysconfig
import tempfile
import threading
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks import common  # noqa: E402

PROCESSORS = ("EPYC-Rome", "Haswell")
RECORD = common.RESULTS / "processors.json"
INTERPRETER = str(Path(sys.executable).resolve())


def environment(*folders: Path) -> dict[str, str]:
    """Environment in which the interpreter itself, without the virtual environment's start, finds its packages."""
    return {
        "PYTHONPATH": ":".join([*map(str, folders), sysconfig.get_paths()["purelib"]]), "OMP_NUM_THREADS": "1"
    }  # fmt: skip


def command(qemu: str, processor: str, program: str) -> list[str]:
    """Command line that runs a Python program on an emulated processor.

    Its memory lies at the same addresses in every run, where the system grants that, so that what ran once runs again:
    at random addresses qemu 7.2 crashed once in some fifty runs (``uncaught target signal 11``).
    """
    fixed = ["setarch", "--addr-no-randomize"]
    try:
        granted = subprocess.run([*fixed, "true"], capture_output=True, check=False).returncode == 0
    except FileNotFoundError:
        granted = False
    return [*(fixed if granted else []), qemu, "-cpu", processor, INTERPRETER, "-c", program]


def hashes(folder: Path, outs: list[str]) -> dict[str, str]:
    """SHA-256 of every file of a stage's outputs.

    Without the package, which pins this process when it is imported: the emulated children would inherit that.
    """
    files = [
        file for out in outs for file in ([folder / out] if (folder / out).is_file() else (folder / out).rglob("*"))
    ]
    return {
        file.relative_to(folder).as_posix(): hashlib.sha256(file.read_bytes()).hexdigest()
        for file in sorted(files)
        if file.is_file()
    }


SORTED = """import numpy as np
values = np.random.default_rng(0).random(5000)
raise SystemExit(int((np.diff(values[np.argsort(values)]) < 0).any()))"""


def version(qemu: str, processor: str) -> str:
    """The emulator's version.

    Raises:
        SystemExit: it cannot run NumPy's sorting on that processor.
    """
    done = subprocess.run(command(qemu, processor, SORTED), env={**os.environ, **environment()}, check=False)
    if done.returncode:
        raise SystemExit(
            f"{qemu} -cpu {processor} sorts wrongly or not at all: --qemu with a newer one, 10 is known good"
        )
    return subprocess.run([qemu, "--version"], capture_output=True, text=True, check=True).stdout.splitlines()[0]


SERVER = """import importlib, os, sys, traceback
from pipeline.dvc import preloaded
for name in preloaded.LIBRARIES:
    importlib.import_module(name)
print(0, flush=True)
for line in sys.stdin:
    output, *words = line.split()
    child = os.fork()
    if not child:
        status, file = 1, os.open(output, os.O_WRONLY)
        os.dup2(file, 1)
        os.dup2(file, 2)
        try:
            preloaded.run(words, dict(os.environ), None, None)
            status = 0
        except SystemExit as end:
            status = end.code if isinstance(end.code, int) else int(end.code is not None)
        except BaseException:
            traceback.print_exc()
        os._exit(status)
    print(child, flush=True)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)"""


class Emulator:
    """An emulated processor with the libraries loaded once; stages run in its children, as ``pipeline.dvc`` runs them.

    Args:
        folder: project folder.
        qemu: the emulator.
        processor: its name there.
    """

    def __init__(self, folder: Path, qemu: str, processor: str) -> None:
        self._process = subprocess.Popen(
            command(qemu, processor, SERVER),
            cwd=folder, env={**os.environ, **environment(folder)},
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        )  # fmt: skip
        self._answer()

    def run(self, words: list[str], minutes: float) -> tuple[int | None, list[str]]:
        """A module's exit status, None where it took longer than the minutes and was stopped, and what it printed."""
        assert self._process.stdin is not None
        with tempfile.NamedTemporaryFile("r") as output:
            print(output.name, *words, file=self._process.stdin, flush=True)
            alarm = threading.Timer(60 * minutes, os.kill, (self._answer(), signal.SIGKILL))
            alarm.start()
            status = self._answer()
            alarm.cancel()
            return (None if status == -signal.SIGKILL else status), output.read().strip().splitlines()

    def _answer(self) -> int:
        assert self._process.stdout is not None
        return int(self._process.stdout.readline())


def emulated(folder: Path, entry: dict[str, Any], emulator: Emulator, minutes: float) -> dict[str, Any]:
    """Run a stage on an emulated processor and compare; its native outputs are there again afterwards."""
    outs = [out["path"] for out in entry["outs"]]
    native = hashes(folder, outs)
    root = yaml.safe_load((folder / "params.yaml").read_text(encoding="utf-8"))["root"]
    aside = [*outs, *(cache for cache in dict.fromkeys([".cache", f"{root}.cache"]) if (folder / cache).exists())]
    words = entry["cmd"].partition("python -m ")[2].split()
    with tempfile.TemporaryDirectory() as kept:
        for number, out in enumerate(aside):
            shutil.move(folder / out, Path(kept) / str(number))
        try:
            status, printed = emulator.run(words, minutes)
            again = hashes(folder, outs)
        finally:
            for number, out in enumerate(aside):
                path = folder / out
                shutil.rmtree(path, ignore_errors=True) if path.is_dir() else path.unlink(missing_ok=True)
                shutil.move(Path(kept) / str(number), path)
    if status is None:
        return {"result": "stopped", "minutes": minutes}
    if status:
        return {"result": "failed", "reason": (printed or ["?"])[-1]}
    differing = sorted(name for name in native.keys() | again.keys() if native.get(name) != again.get(name))
    return {"result": "differs" if differing else "same", "files": len(native), "differing": differing}


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="+", default=None, help="stages, by name or group")
    parser.add_argument("--processors", nargs="+", default=list(PROCESSORS), help="of qemu-x86_64 -cpu help")
    parser.add_argument("--minutes", type=float, default=30.0, help="per stage and processor")
    parser.add_argument("--qemu", default="qemu-x86_64", help="the emulator")
    parser.add_argument("--inputs", default=None, help="of the stages, kept in the record: other than a profile's")
    arguments = parser.parse_args()
    folder = arguments.folder.resolve()
    stages = yaml.safe_load((folder / "dvc.lock").read_text(encoding="utf-8"))["stages"]
    record = json.loads(RECORD.read_text()) if RECORD.exists() else {"stages": {}}
    versions = {processor: version(arguments.qemu, processor) for processor in arguments.processors}
    emulators: dict[str, Emulator] = {}
    record |= {"machine": common.machine("torch", "opencv-python-headless"), "not_run": []}
    for name, entry in stages.items():
        if not entry.get("outs") or (arguments.only and not {name, name.partition("@")[0]} & set(arguments.only)):
            continue
        for processor in arguments.processors:
            emulators[processor] = emulators.get(processor) or Emulator(folder, arguments.qemu, processor)
            answer = emulated(folder, entry, emulators[processor], arguments.minutes)
            answer["qemu"] = versions[processor]
            if arguments.inputs:
                answer["inputs"] = arguments.inputs
            print(name, processor, answer["result"], flush=True)
            record["stages"].setdefault(name, {})[processor] = answer
            record["not_run"] = sorted(name for name in stages if name not in record["stages"])
            common.write("processors", record)


if __name__ == "__main__":
    common.run(main)
