"""Stages that do not depend on each other run at once, where the machine has cores to spare.

DVC runs one stage after another. Here its own code is as serial as it was, checks, hashes, ``dvc.lock`` and all: one
thread at a time has the *turn*, and hands it over only while the command of its stage runs. Of the stages whose
dependencies are up to date the first ones in DVC's order are taken; a stage without outputs, which nothing can depend
on, ends before later ones begin (the check of ``params.yaml``). When one fails, those that run end, no other begins,
and DVC's message follows. Ctrl-C does the same; the running commands receive it from the terminal as this process does.
SIGTERM is handed to them, and this process ends after them; killed, it takes them with it (`end_with_parent`).
"""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from pathlib import Path
from types import FrameType
from typing import Any

from pipeline import yaml_text
from pipeline.dvc import end_with_parent, preloaded
from pipeline.dvc.core_slots import CoreSlots, affinity
from pipeline.dvc.lock_file import LockFileWriter
from pipeline.executor import available_cores

SWITCH = "STAGES_AT_ONCE"
"""Environment variable: how many stages may run at once; 1 for one after another."""
MOST = 4
"""Stages at once where the variable is not set: more would rarely be ready, and each holds its data in memory."""

THREADS = "OMP_NUM_THREADS"
"""Environment variable: threads of a stage's libraries; of OpenBLAS and MKL too, where they are not pinned to one."""


def stages_at_once(cores: int, workers: int, chosen: str | None) -> int:
    """How many stages may run at once.

    Args:
        cores: of the machine that this process may use.
        workers: processes of one stage, ``executor.workers``; 0 where a stage takes as many as it has cores.
        chosen: the value of `SWITCH`.
    """
    if chosen:
        return max(1, int(chosen)) if chosen.isdecimal() else 1
    return max(1, min(MOST, cores // max(workers, 1)))


def workers(params: Path) -> int:
    """Processes of one stage, ``executor.workers`` of a ``params.yaml``; 0 (one per core) where it is not given."""
    import yaml

    try:
        content = yaml_text.parse(params.read_text(encoding="utf-8"))
        return int(content["executor"]["workers"])
    except (OSError, ValueError, TypeError, LookupError, yaml.YAMLError):
        return 0


def startable(
    waiting: Sequence[Any], running: Sequence[Any], ended: set[Any], upstream: Mapping[Any, set[Any]]
) -> list[Any]:
    """Of the waiting stages, in DVC's order, those that may begin now."""
    if any(not stage.outs for stage in running):
        return []
    ready = []
    for stage in waiting:
        if upstream[stage] <= ended:
            ready.append(stage)
        if not stage.outs:
            break
    return ready


class Stages:
    """Runs the stages of one ``dvc repro``.

    Args:
        writer: of ``dvc.lock``; is given DVC's order.
        params: ``params.yaml``, read when the stages begin: an experiment writes it before.
    """

    def __init__(self, writer: LockFileWriter, params: Path) -> None:
        self._writer, self._params = writer, params
        self._turn = threading.Lock()
        self._slots = CoreSlots()
        self._commands: list[Any] = []

    def end(self, number: int, frame: FrameType | None) -> None:
        """Handle a signal that ends this process: the running commands get it too, and are waited for (`_wait`)."""
        import psutil  # type: ignore[import-untyped]

        for command in list(self._commands):
            with contextlib.suppress(psutil.NoSuchProcess):  # it has just ended
                process = psutil.Process(command.pid)
                in_shell = process.children() if isinstance(command, subprocess.Popen) else []
                for each in (*in_shell, process):  # a shell that is ended first leaves its command behind
                    each.send_signal(number)
        raise SystemExit(128 + number)

    @contextlib.contextmanager
    def _noted(self, command: Any) -> Iterator[Any]:
        """While it runs, a command that a signal ends too."""
        self._commands.append(command)
        try:
            yield command
        finally:
            self._commands.remove(command)

    def reproduce(self, original: Callable[..., list[Any]]) -> Callable[..., list[Any]]:
        """`dvc.repo.reproduce._reproduce`; the original for options under which the order matters."""
        from dvc.repo.reproduce import _raise_error, _reproduce_stage

        def reproduce(stages: list[Any], graph: Any = None, **options: Any) -> list[Any]:
            self._writer.order = [stage.addressing for stage in stages]
            self._choose()
            plain = options.get("on_error", "fail") == "fail" and not any(
                options.get(name) for name in ("dry", "interactive", "force_downstream", "pull")
            )
            if self._slots.count == 1 or len(stages) < 2 or graph is None or not plain:
                return original(stages, graph=graph, **options)
            options = {name: value for name, value in options.items() if name not in ("on_error", "force_downstream")}
            reproduce_stage = options.pop("repro_fn", _reproduce_stage)

            def run(stage: Any) -> Any:
                with self._turn, stage.repo.lock:
                    return reproduce_stage(stage, upstream=list(graph.successors(stage)), **options)

            upstream = {stage: set(graph.successors(stage)) & set(stages) for stage in stages}
            lock = stages[0].repo.lock
            lock.unlock()
            try:
                results, failed = self._run_all(stages, upstream, run)
            finally:
                lock.lock()
            if failed is not None:
                _raise_error(*failed)
            return [results[stage] for stage in stages if results[stage]]

        return reproduce

    def _run_all(
        self, stages: Sequence[Any], upstream: Mapping[Any, set[Any]], run: Callable[[Any], Any]
    ) -> tuple[dict[Any, Any], tuple[Exception, Any] | None]:
        """Run every stage once those it depends on have ended; after a failure no other begins.

        Args:
            stages: in DVC's order.
            upstream: those of them that each depends on.
            run: one stage.

        Returns:
            what each gave, and the first failure with its stage, or None.
        """
        results: dict[Any, Any] = {}
        failed: tuple[Exception, Any] | None = None
        waiting, running = list(stages), dict[Future[Any], Any]()
        with ThreadPoolExecutor(self._slots.count) as pool:
            while True:
                free = self._slots.count - len(running) if failed is None else 0
                for stage in startable(waiting, list(running.values()), set(results), upstream)[:free]:
                    waiting.remove(stage)
                    self._slots.take(stage.addressing)
                    running[pool.submit(run, stage)] = stage
                if not running:
                    return results, failed
                self._slots.give_all_cores_to_the_last()
                done = wait(running, return_when=FIRST_COMPLETED).done
                for future in [each for each in running if each in done]:  # in the order they began, not that of a set
                    stage = running.pop(future)
                    self._slots.leave(stage.addressing)
                    error = future.exception()
                    if error is None:
                        results[stage] = future.result()
                    elif not isinstance(error, Exception):
                        raise error
                    elif failed is None:
                        failed = error, stage

    def _choose(self) -> None:
        """Set how many stages run at once, and give their libraries as many threads as their share of the cores."""
        cores = available_cores()
        self._slots.count = stages_at_once(cores, workers(self._params), os.environ.get(SWITCH))
        if self._slots.count > 1:
            os.environ.setdefault(THREADS, str(max(1, cores // self._slots.count)))

    def run(self) -> Callable[..., None]:
        """In the place of `dvc.stage.run._run`: one command of a stage, with its turn handed over meanwhile."""
        from dvc.stage.exceptions import StageCmdFailedError
        from dvc.stage.run import _make_cmd

        def run(executable: str | None, command: str, **options: Any) -> None:
            environment = options["env"]
            words = preloaded.words(command, Path(options["cwd"]), environment)
            in_shell: Any = command
            if executable is not None:  # as it is but on Windows; a plain command takes the place of its shell
                plain = preloaded.COMMAND.fullmatch(command)
                in_shell = end_with_parent.command(_make_cmd(executable, f"exec {command}" if plain else command))
            name = environment.get("DVC_STAGE", "")
            if name not in self._slots:
                code = self._run_alone(words, in_shell, options)
            else:
                self._turn.release()
                try:
                    code = self._run_beside(name, words, in_shell, options)
                finally:
                    self._turn.acquire()
            if code:
                raise StageCmdFailedError(command, code)

        return run

    def _run_alone(self, words: list[str] | None, command: Any, options: dict[str, Any]) -> int:
        """Run a command while no other runs, its output where that of this process goes."""
        if words is not None:
            process: Any = preloaded.start(words, options["env"])
        else:
            process = subprocess.Popen(command, **options)
        with self._noted(process):
            return _wait(process)

    def _run_beside(self, name: str, words: list[str] | None, command: Any, options: dict[str, Any]) -> int:
        """Run a command beside others, each line of its output after the name of its stage."""
        import multiprocessing

        cores = self._slots.cores_of(name)
        reading, writing = multiprocessing.Pipe(duplex=False)
        if words is not None:
            process: Any = preloaded.start(words, options["env"], cores, writing)
        else:
            with affinity(cores):  # of this thread; its child inherits it
                process = subprocess.Popen(command, stdout=writing.fileno(), stderr=subprocess.STDOUT, **options)
        writing.close()
        with self._slots.running(name, process.pid), self._noted(process):
            with os.fdopen(os.dup(reading.fileno()), encoding="utf-8", errors="replace", newline="\n") as lines:
                reading.close()
                for line in lines:
                    shown = line.rstrip().rpartition("\r")[2]  # of a progress bar, what it ends with
                    if shown:
                        sys.stdout.write(f"{name} | {shown}\n")
                        sys.stdout.flush()
            return _wait(process)


def _wait(process: Any) -> int:
    """Wait for a command and return its exit status; Ctrl-C is for the command to answer, as it is in DVC."""
    alone = threading.current_thread() is threading.main_thread()
    before = signal.signal(signal.SIGINT, signal.SIG_IGN) if alone else None
    try:
        return _exit_status(process)
    except SystemExit:  # of `Stages.end`: the command is ending
        _exit_status(process)
        raise
    finally:
        if alone:
            signal.signal(signal.SIGINT, before)


def _exit_status(process: Any) -> int:
    return int(process.wait()) if isinstance(process, subprocess.Popen) else preloaded.exit_status(process)


def install(writer: LockFileWriter) -> Stages:
    """Let DVC in this process run stages at once; returns what runs them, whose `Stages.end` handles SIGTERM."""
    from dvc.repo import reproduce
    from dvc.stage import run

    stages = Stages(writer, Path("params.yaml"))
    reproduce._reproduce = stages.reproduce(reproduce._reproduce)
    run._run = stages.run()
    return stages
