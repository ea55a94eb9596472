"""Commands of stages run in children of one server process that has the third-party libraries loaded.

A process of its own per stage spends 1.5 to 3 s of processor time on importing torch, SciPy and pandas, which is more
than many stages compute. Python's fork server (`multiprocessing`) imports them once; each command ``python -m
pipeline.NAME ...`` runs in a child forked from it, which imports the modules of `pipeline` itself, so that what a stage
executes is what its process executed.

Commands of another form, and stages that lift the pins of torch before it is loaded
(`pipeline.processor.release_torch`), run as DVC runs them.
"""

from __future__ import annotations

import multiprocessing
import os
import re
import shutil
import signal
import sys
import threading
from collections.abc import Collection, Mapping, Sequence
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkServerProcess
from pathlib import Path

from pipeline import freed_memory

LIBRARIES = (
    "numpy", "scipy.fft", "scipy.ndimage", "scipy.optimize", "scipy.signal", "scipy.sparse.linalg", "scipy.spatial",
    "scipy.special", "scipy.stats", "pydantic", "yaml", "cv2", "pandas", "pyarrow.parquet", "safetensors.numpy", "tqdm",
    "torch",
)  # fmt: skip
"""What the server imports: libraries that stages use; one that is not installed is left out."""
KEPT_BYTES = 1 << 30  # freed memory that a stage keeps

COMMAND = re.compile(r"python -m (pipeline(?:\.\w+)+)((?: [\w.+=/:@-]+)*)")
"""A command without anything that a shell would interpret."""

BEGINS = "pipeline.stage"
"""Audit event of a child (`sys.audit`) before it runs its module: the module, then the arguments."""

_lock = threading.Lock()
"""Starting a process looks after all earlier ones, which two threads must not do at once: a status is read once."""


def words(command: str, folder: Path, environment: Mapping[str, str]) -> list[str] | None:
    """The module and arguments of a command that a child of the server can run.

    Args:
        command: of a stage.
        folder: it runs in.
        environment: it runs with.

    Returns:
        the words after ``python -m``; None where the command has another form or another Python, runs elsewhere, or
        lifts the pins of torch.
    """
    match = COMMAND.fullmatch(command)
    python = shutil.which("python", path=environment.get("PATH"))
    if match is None or python is None or "forkserver" not in multiprocessing.get_all_start_methods():
        return None
    if Path(python).parent.resolve() != Path(sys.executable).parent.resolve() or folder.resolve() != Path.cwd():
        return None
    source = folder / f"{match[1].replace('.', '/')}.py"
    if not source.is_file() or "release_torch" in source.read_text(encoding="utf-8"):
        return None
    return [match[1], *match[2].split()]


def start(
    words: Sequence[str],
    environment: Mapping[str, str],
    cores: Collection[int] | None = None,
    output: Connection | None = None,
) -> ForkServerProcess:
    """Start a command in a child of the server, which is started with the first.

    Args:
        words: module and arguments, see `words`.
        environment: of the command; variables that libraries read when loaded must be those of this process.
        cores: numbers of the processor's cores that it may use; None for all.
        output: where its standard output and error go; None for those of this process.

    Returns:
        the started process; its ``exitcode`` is that of the command.
    """
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(list(LIBRARIES))
    # no daemon, as it may start processes
    process = context.Process(target=run, args=(list(words), dict(environment), cores, output), daemon=False)
    with _lock:
        process.start()
    return process


def exit_status(process: ForkServerProcess) -> int:
    """Wait for a started command; its exit status, negative where a signal ended it."""
    wait([process.sentinel])
    with _lock:
        process.join()
    assert process.exitcode is not None
    return process.exitcode


def run(
    words: list[str], environment: dict[str, str], cores: Collection[int] | None, output: Connection | None
) -> None:
    """Run a module as ``python -m`` does, in a process forked for it, which it leaves changed; see `start`."""
    import atexit
    import runpy

    if output is not None:
        os.dup2(output.fileno(), 1)
        os.dup2(output.fileno(), 2)
        output.close()
    if cores is not None:
        os.sched_setaffinity(0, cores)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    os.environ.clear()
    os.environ.update(environment)
    freed_memory.keep(os.environ, kept_bytes=KEPT_BYTES)
    multiprocessing.set_start_method(None, force=True)  # a command's process has no start method chosen
    module, *arguments = words
    sys.argv = [module, *arguments]
    sys.orig_argv = [sys.executable, "-m", *words]
    sys.audit(BEGINS, *words)
    try:
        runpy.run_module(module, run_name="__main__", alter_sys=True)
    finally:
        atexit._run_exitfuncs()  # a fork leaves without them


def _end_with_parent() -> None:
    """End this process once the one that asked for it is gone: killed, it could not end it by itself."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os.kill(os.getpid(), signal.SIGTERM)
