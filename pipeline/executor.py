"""Parallel map over frames or patches: local processes, or an existing Dask cluster by its address.

Work is split over items, one thread per worker process (two threads on busy cores cost more than they give).
Results come back in the order of the items, so the bytes written do not depend on the number of workers.
A worker that dies (out of memory, killed) takes nothing with it: finished items are kept and the others are
given to fresh workers. Where two pools in a row die without finishing an item, a single worker takes the rest in
order; if it dies at its first item, that item is named in the error.
"""

from __future__ import annotations

import copy
import multiprocessing
import os
import pickle
import platform
import re
import signal
import threading
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import connection
from multiprocessing.process import BaseProcess
from typing import Any, Generic, TypeVar

from pipeline import processor, weight_files
from pipeline.errors import InputError

Item = TypeVar("Item")
Result = TypeVar("Result")

_THREAD_VARIABLES = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMEXPR_NUM_THREADS")
ADDRESS_PATTERN = r"[a-z]+://[^\s/]+|[^\s/:]+:\d+"  # of a Dask scheduler
_SCHEDULER_TIMEOUT_S = 10
_PATIENCE = 3  # pools lost in a row without one finished item before giving up; the last has one worker


def available_cores() -> int:
    """Processor cores this process may use; every core where the system restricts none (macOS, Windows)."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def one_thread() -> None:
    """Keep this process to one computing thread in torch, OpenCV and every library that is loaded later.

    OpenBLAS, which NumPy loads, has one from the start (`pipeline.processor`).
    """
    import sys

    for name in _THREAD_VARIABLES:
        os.environ[name] = "1"
    if "cv2" in sys.modules:
        sys.modules["cv2"].setNumThreads(1)
    if "torch" in sys.modules:
        sys.modules["torch"].set_num_threads(1)


@contextmanager
def one_thread_meanwhile() -> Iterator[None]:
    """As `one_thread`, for a block: a program that calls this library has its threads back after it."""
    import sys

    cv2, torch = sys.modules.get("cv2"), sys.modules.get("torch")
    opencv_threads, torch_threads = cv2 and cv2.getNumThreads(), torch and torch.get_num_threads()
    with _one_thread_for_children():
        one_thread()
        try:
            yield
        finally:
            if cv2 is not None:
                cv2.setNumThreads(opencv_threads)
            if torch is not None:
                torch.set_num_threads(torch_threads)


def _progress(results: Iterable[Any], total: int, label: str) -> Iterable[Any]:
    """A progress bar on standard error, only for what takes longer than two seconds."""
    from tqdm import tqdm

    return tqdm(results, total=total, desc=label or None, delay=2, leave=False, dynamic_ncols=True)


def _call(function: Callable[[Item], Result], item: Item) -> Result:
    """Apply a function in a worker; one that can cross to its parent stands for an exception that cannot."""
    one_thread()
    try:
        return function(item)
    except BaseException as error:
        try:
            pickle.dumps(error)
            copy.copy(error)  # made from its arguments, as the parent makes it
        except Exception:  # noqa: BLE001  the parent would fail to read it, too, and take the worker for dead
            plain = RuntimeError(f"{type(error).__name__}: {error}")
            substitute = InputError(f"{error}") if isinstance(error, InputError) else plain
            raise substitute.with_traceback(error.__traceback__) from None
        raise


def _call_there(function: Callable[[Item], Result], item: Item, weights: str | None, pins: str, address: str) -> Result:
    """As `_call`, in a process that this one did not start: pinned alike, with this one's folder of weights."""
    if not processor.is_like(pins):  # it has joined since `_check_pins`
        raise _pinned_otherwise(f"on {platform.node()}", processor.status(), pins, address)
    weight_files.set_folder(weights)
    return _call(function, item)


def run_map(
    function: Callable[[Item], Result],
    items: Sequence[Item],
    *,
    workers: int = 1,
    backend: str = "processes",
    address: str | None = None,
    label: str = "",
    worker_timeout_s: float = 60.0,
) -> list[Result]:
    """Apply a function to every item.

    Args:
        function: picklable (module level, or a ``functools.partial`` of such) and without side effects.
        items: what to apply it to; each picklable.
        workers: processes for ``backend="processes"``; 1 runs in this process, whose threads are as before afterwards.
        backend: ``"processes"`` or ``"dask"``.
        address: scheduler address for Dask, e.g. ``"tcp://127.0.0.1:8786"``.
        label: title of the progress bar.
        worker_timeout_s: seconds to wait for a Dask worker while there is none.

    Returns:
        one result per item, in the items' order, whatever the number of workers.

    Raises:
        InputError: unknown backend, no scheduler at the address, no worker, or workers that keep dying.
        RuntimeError: an exception of the function that cannot be pickled, by its name and message (an `InputError` as
            such), from a worker.
        Exception: whatever else the function raised, from the first item in order that failed.
    """
    items = list(items)
    if not items:
        return []
    if backend == "dask":
        return _map_dask(function, items, address, label, worker_timeout_s)
    if backend != "processes":
        raise InputError(f"executor.backend={backend!r}: expected 'processes' or 'dask'")
    if workers < 1:
        raise InputError(f"executor.workers={workers}: expected at least 1")
    if workers == 1 or len(items) == 1:
        with one_thread_meanwhile():
            return [function(item) for item in _progress(items, len(items), label)]
    return _map_processes(function, items, min(workers, len(items)), label)


def _map_processes(function: Callable[[Item], Result], items: list[Item], workers: int, label: str) -> list[Result]:
    work = _Work(function, items, label)
    lost = 0
    with _one_thread_for_children():
        while waiting := work.waiting():
            before = len(work.done)
            try:
                # One worker takes the items in order, so that it is known at which of them it died.
                work.share(1 if lost == _PATIENCE - 1 else workers)
            except BrokenProcessPool as error:
                lost = 0 if len(work.done) > before else lost + 1
                if lost >= _PATIENCE:
                    raise InputError(
                        f"{label or 'parallel map'}: worker processes died {_PATIENCE} times without finishing an "
                        f"item, the last time a single one with item {items[waiting[0]]!r}; is memory short for it?"
                    ) from error
    return work.results()


def _begin_worker() -> None:
    """One thread; Ctrl-C ends a worker at once and silently, its parent reports it; a killed parent ends it, too."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    one_thread()


def _end_with_parent() -> None:
    """End this process once its parent is gone: killed, it could not, and this one would wait for an item for ever."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


@contextmanager
def _one_thread_for_children() -> Iterator[None]:
    """Have processes that are started meanwhile compute with one thread, which they read before they import."""
    kept = {name: os.environ.get(name) for name in _THREAD_VARIABLES}
    os.environ.update(dict.fromkeys(_THREAD_VARIABLES, "1"))
    try:
        yield
    finally:
        for name, value in kept.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


class _Work(Generic[Item, Result]):
    """Items shared among worker processes, and what they have finished.

    Attributes:
        done: number of an item -> its result.
    """

    def __init__(self, function: Callable[[Item], Result], items: list[Item], label: str) -> None:
        self.function, self.items = function, items
        self.done: dict[int, Result] = {}
        self._bar = iter(_progress(range(len(items)), len(items), label))

    def waiting(self) -> list[int]:
        """Numbers of the items without a result, in order."""
        return [index for index in range(len(self.items)) if index not in self.done]

    def share(self, workers: int) -> None:
        """Give what is waiting to so many fresh processes.

        Raises:
            BrokenProcessPool: one of them died; what was finished before is kept.
            Exception: that of the first item in order that failed.
        """
        with_spawn = multiprocessing.get_context("spawn")
        pool: Any = ProcessPoolExecutor(workers, mp_context=with_spawn, initializer=_begin_worker)
        futures: dict[Future[Result], int] = {}
        others = set(multiprocessing.active_children())
        try:
            with processor.for_children():  # the pool starts its processes with the first items
                for index in self.waiting():
                    futures[pool.submit(_call, self.function, self.items[index])] = index
            pool._result_queue._writer.close()  # of this process: open, what killed workers sent in part has no end
            with _ending_together(set(multiprocessing.active_children()) - others):
                self._collect(futures)
        except BrokenProcessPool:
            for future, index in futures.items():  # `as_completed` may yield lost items before finished ones
                if index not in self.done and future.done() and not future.cancelled() and not future.exception():
                    self._keep(index, future)
            raise
        finally:
            pool.shutdown(wait=True, cancel_futures=True)

    def _collect(self, futures: Mapping[Future[Result], int]) -> None:
        """Keep results as they come; see `share` for what it raises."""
        failed: dict[int, BaseException] = {}
        for future in as_completed(futures):
            index = futures[future]
            if future.cancelled():
                continue
            if (error := future.exception()) is None:
                self._keep(index, future)
            elif isinstance(error, BrokenProcessPool):
                raise error
            else:  # an earlier item may fail as well, and it is its error that one worker would meet
                failed[index] = error
                for other, later in futures.items():
                    if later > index:
                        other.cancel()
            if failed and all(other.done() for other, earlier in futures.items() if earlier < min(failed)):
                raise failed[min(failed)]

    def _keep(self, index: int, future: Future[Result]) -> None:
        self.done[index] = future.result()
        next(self._bar, None)

    def results(self) -> list[Result]:
        """One per item, in their order, when all are done; ends the progress bar."""
        next(self._bar, None)
        return [self.done[index] for index in range(len(self.items))]


@contextmanager
def _ending_together(workers: Collection[BaseProcess]) -> Iterator[None]:
    """Kill all workers of a pool as soon as one has died.

    The pool would do so itself, but waits for ever where a worker was killed, as for want of memory, while it sent a
    result: for the rest, as long as a process is there that could write it.
    """
    done, finish = multiprocessing.Pipe(duplex=False)

    def watch() -> None:
        if done not in connection.wait([done, *(worker.sentinel for worker in workers)]):
            for worker in workers:
                worker.kill()

    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield
    finally:
        finish.close()
        watcher.join()
        done.close()


def _check_pins(statuses: Mapping[str, str], address: str) -> None:
    """Refuse Dask workers whose libraries are pinned in another way than this process's (`pipeline.processor`)."""
    for worker, there in statuses.items():
        if not processor.is_like(there):
            raise _pinned_otherwise(worker, there, processor.status(), address)


def _pinned_otherwise(worker: str, there: str, here: str, address: str) -> InputError:
    return InputError(
        f"executor.address={address}: worker {worker} would compute other last digits ({there}; here: {here}); start "
        f"workers by 'python -m pipeline.dask_worker {address}', or set {processor.SWITCH}=off here and there"
    )


def _map_dask(
    function: Callable[[Item], Result],
    items: list[Item],
    address: str | None,
    label: str,
    worker_timeout_s: float,
) -> list[Result]:
    try:
        from distributed import Client, wait
    except ImportError:
        raise InputError("executor.backend=dask needs the package 'distributed': pip install '.[dask]'") from None
    if not address:
        raise InputError("executor.backend=dask needs executor.address, e.g. tcp://127.0.0.1:8786")
    if not re.fullmatch(ADDRESS_PATTERN, address):
        raise InputError(
            f"executor.address={address}: expected PROTOCOL://HOST:PORT or HOST:PORT, e.g. tcp://127.0.0.1:8786"
        )

    class ClosingClient(Client):
        """Closes itself if it fails to connect; collected later, it could wait for a lock that is held for ever."""

        def __init__(self) -> None:
            try:
                super().__init__(address, timeout=_SCHEDULER_TIMEOUT_S)
            except BaseException:
                self.close()
                raise

    try:
        client = ClosingClient()
    except (OSError, ValueError, TypeError, RuntimeError) as error:
        raise InputError(f"executor.address={address}: no Dask scheduler answers there ({error})") from None
    weights = os.environ.get(weight_files.VARIABLE)
    with client:
        _check_pins(client.run(processor.status), address)
        futures = [
            client.submit(_call_there, function, item, weights, processor.status(), address, pure=False)
            for item in items
        ]
        waiting = set(futures)
        bar = iter(_progress(range(len(items)), len(items), label))
        next(bar, None)
        while waiting:
            try:
                done, waiting = wait(waiting, timeout=worker_timeout_s, return_when="FIRST_COMPLETED")
            except TimeoutError:
                if client.scheduler_info()["workers"]:
                    continue  # long items
                client.cancel(list(waiting))
                raise InputError(
                    f"executor.address={address}: the Dask scheduler had no worker for {worker_timeout_s:g} s; start "
                    f"one by 'python -m pipeline.dask_worker {address}' in this folder"
                ) from None
            for _ in done:
                next(bar, None)
        return list(client.gather(futures))
