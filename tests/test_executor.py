"""Executor: the same answer for any number of workers and after a worker's death; errors are not swallowed."""

import functools
import gc
import multiprocessing
import os
import signal
import struct
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor, wait
from pathlib import Path

import pytest

from pipeline import executor
from pipeline.errors import InputError
from pipeline.executor import available_cores, run_map


def square(x):
    return x * x


def refuse_three(x):
    if x == 3:
        raise InputError("item 3 is bad")
    return x


class CodedError(Exception):
    """Pickles, but cannot be made again from the one argument that it keeps."""

    def __init__(self, code, message):
        super().__init__(f"{code}: {message}")


class CodedInputError(InputError):
    def __init__(self, code, message):
        super().__init__(f"{code}: {message}")


class HoldingError(Exception):
    """Does not pickle."""

    def __init__(self, message):
        super().__init__(message, lambda: None)

    def __str__(self):
        return self.args[0]


def refuse_one_by(error, arguments, x):
    if x == 1:
        raise error(*arguments)
    return x


def refuse_late_and_soon(x):
    """Items 0 and 1 fail, the first of them later."""
    if x == 0:
        time.sleep(1.0)
    if x < 2:
        raise InputError(f"item {x} is bad")
    return x


def die_once(folder, x):
    """Kill this process the first time item 2 comes by; every call leaves a mark."""
    mark = Path(folder) / f"died-{x}"
    if x == 2 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return square(x)


def die_while_sending(folder, x):
    """Kill this process the first time item 2 comes by, with its result sent in part."""
    mark = Path(folder) / f"died-{x}"
    if x == 2 and not mark.exists():
        mark.touch()
        results = multiprocessing.current_process()._args[1]
        os.write(results._writer.fileno(), struct.pack("!i", 1000) + b"the first of 1000 bytes")
        os.kill(os.getpid(), signal.SIGKILL)
    return square(x)


def always_die(x):
    os.kill(os.getpid(), signal.SIGKILL)


def wait_for_two_and_kill_parent(folder, x):
    """Every worker leaves a mark; with the second, item 0 kills their parent and goes on for ever."""
    Path(folder, f"{os.getpid()}").touch()
    while len(list(Path(folder).iterdir())) < 2:
        time.sleep(0.05)
    if x == 0:
        os.kill(os.getppid(), signal.SIGKILL)
        time.sleep(3600)


def kill_parent_of_two(folder):
    run_map(functools.partial(wait_for_two_and_kill_parent, folder), range(2), workers=2)


def runs(process):
    """Whether a process is there and has not ended."""
    try:
        return "Z" not in Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except OSError:
        return False


def die_at_five(folder, x):
    """Item 5 ends its process; beside another worker, item 0 does not finish before that."""
    if x == 5:
        os._exit(1)
    if x == 0 and Path(folder, "workers").read_text() != "1":
        time.sleep(300)
    return square(x)


def die_once_and_mark(folder, x):
    """Item 3, the last, ends its process the first time; every call leaves a mark."""
    marks = [path.name.split("-")[0] for path in Path(folder).glob("*-*")]
    Path(folder, f"{x}-{os.getpid()}").touch()
    if x == 3 and "3" not in marks:
        os._exit(1)
    return square(x)


def threads(_):
    import torch

    return torch.get_num_threads(), os.environ["OMP_NUM_THREADS"]


@pytest.mark.parametrize("workers", [1, 2])
def test_order_is_kept(workers):
    assert run_map(square, range(7), workers=workers) == [x * x for x in range(7)]
    assert run_map(square, [], workers=workers) == []


@pytest.mark.parametrize("workers", [1, 2])
def test_errors_come_through(workers):
    with pytest.raises(InputError, match="item 3"):
        run_map(refuse_three, range(5), workers=workers)


@pytest.mark.parametrize(
    ("error", "arguments", "raised", "message"),
    [
        (CodedError, (7, "wrong layout"), RuntimeError, "CodedError: 7: wrong layout"),
        (HoldingError, ("still open",), RuntimeError, "HoldingError: still open"),
        (CodedInputError, (7, "wrong layout"), InputError, "7: wrong layout"),
    ],
)
def test_an_exception_that_cannot_be_pickled_is_told_by_its_message(error, arguments, raised, message):
    """It was taken for a worker that had died, as for want of memory."""
    with pytest.raises(raised) as caught:
        run_map(functools.partial(refuse_one_by, error, arguments), range(4), workers=2)
    assert type(caught.value) is raised and str(caught.value) == message
    assert "in refuse_one_by" in str(caught.value.__cause__)  # the worker's traceback


def test_a_killed_worker_loses_nothing(tmp_path):
    assert run_map(functools.partial(die_once, str(tmp_path)), range(6), workers=2) == [x * x for x in range(6)]
    assert (tmp_path / "died-2").exists()


def test_a_worker_killed_while_it_sends_a_result_loses_nothing(tmp_path):
    """The map waited for the rest of the result for ever."""
    ran = run_map(functools.partial(die_while_sending, str(tmp_path)), range(6), workers=2)
    assert ran == [x * x for x in range(6)] and (tmp_path / "died-2").exists()


def test_workers_end_with_a_killed_parent(tmp_path):
    """They were left, one with an item and one waiting for its next."""
    root = Path(__file__).resolve().parents[1]
    code = f"import sys; sys.path.insert(0, {str(root / 'tests')!r}); from test_executor import kill_parent_of_two; "
    code += f"kill_parent_of_two({str(tmp_path)!r})"
    ended = subprocess.run([sys.executable, "-c", code], cwd=root, stderr=subprocess.DEVNULL)
    assert ended.returncode == -signal.SIGKILL
    workers = [int(mark.name) for mark in tmp_path.iterdir()]
    assert len(workers) == 2
    deadline = time.monotonic() + 120
    while (left := [worker for worker in workers if runs(worker)]) and time.monotonic() < deadline:
        time.sleep(0.2)
    for worker in left:
        os.kill(worker, signal.SIGKILL)
    assert not left


def test_an_item_that_always_kills_is_named():
    with pytest.raises(InputError, match=r"poison: .* died 3 times .* a single one with item 1;"):
        run_map(always_die, [1, 2], workers=2, label="poison")


def test_the_item_that_kills_is_named_and_no_other(tmp_path, monkeypatch):
    """Item 0 is killed beside it, time and again, and is the first of those that are not finished."""

    class Noted(ProcessPoolExecutor):
        def __init__(self, max_workers, **options):
            (tmp_path / "workers").write_text(f"{max_workers}")
            super().__init__(max_workers, **options)

    monkeypatch.setattr(executor, "ProcessPoolExecutor", Noted)
    with pytest.raises(InputError, match=r"died 3 times .* with item 5;"):
        run_map(functools.partial(die_at_five, str(tmp_path)), range(8), workers=2)


def test_items_that_finished_before_a_death_are_kept_whatever_is_seen_first(tmp_path, monkeypatch):
    """`as_completed` yields items in no particular order if several are done when it looks."""

    def lost_first(futures):
        wait(futures)
        return sorted(futures, key=lambda future: future.exception() is None)

    monkeypatch.setattr(executor, "as_completed", lost_first)
    assert run_map(functools.partial(die_once_and_mark, str(tmp_path)), range(4), workers=2) == [0, 1, 4, 9]
    marks = [path.name.split("-")[0] for path in tmp_path.glob("*-*")]
    assert marks.count("3") == 2 and len(marks) <= 2 + 4  # of the others, one at most was with the other worker


def test_cores_are_counted_on_every_system(monkeypatch):
    """Systems such as macOS and Windows have no `os.sched_getaffinity`."""
    monkeypatch.setattr("os.sched_getaffinity", lambda _: {1, 4, 5}, raising=False)
    assert available_cores() == 3
    monkeypatch.delattr("os.sched_getaffinity")
    monkeypatch.setattr("os.cpu_count", lambda: 7)
    assert available_cores() == 7
    monkeypatch.setattr("os.cpu_count", lambda: None)
    assert available_cores() == 1


def test_workers_use_one_thread():
    assert run_map(threads, range(2), workers=2) == [(1, "1")] * 2


@pytest.mark.parametrize("fails", [False, True])
def test_a_callers_threads_are_as_before_after_a_map_in_its_process(monkeypatch, fails):
    import cv2
    import torch

    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    monkeypatch.delenv("MKL_NUM_THREADS", raising=False)
    before = torch.get_num_threads(), cv2.getNumThreads()
    torch.set_num_threads(2)
    cv2.setNumThreads(2)
    try:
        if fails:
            with pytest.raises(InputError, match="item 3"):
                run_map(refuse_three, [3])
        else:
            assert run_map(threads, [0]) == [(1, "1")]
        assert (torch.get_num_threads(), cv2.getNumThreads()) == (2, 2)
        assert os.environ["OMP_NUM_THREADS"] == "3" and "MKL_NUM_THREADS" not in os.environ
    finally:
        torch.set_num_threads(before[0])
        cv2.setNumThreads(before[1])


@pytest.mark.parametrize(
    ("options", "word"),
    [({"backend": "cloud"}, "backend"), ({"workers": 0}, "workers"), ({"backend": "dask"}, "address")],
)
def test_bad_settings_are_named(options, word):
    with pytest.raises(InputError, match=word):
        run_map(square, [1, 2], **options)


@pytest.mark.parametrize(
    "address", ["foo", "tcp://", "http://127.0.0.1:9", "tcp://127.0.0.1:port", "tls://127.0.0.1:9"]
)
def test_a_wrong_scheduler_address_is_one_line(address):
    pytest.importorskip("distributed", reason="the dask extra is not installed")
    with pytest.raises(InputError, match=f"executor.address={address}: (expected|no Dask scheduler)"):
        run_map(square, [1, 2], backend="dask", address=address)


@pytest.mark.parametrize(
    "address",
    ["http://127.0.0.1:9", pytest.param("tcp://127.0.0.1:9", marks=pytest.mark.full("until it gives up takes 10 s"))],
)
def test_a_dask_client_that_fails_to_connect_is_closed(address):
    """Collected while a cluster starts, an open one would wait for the lock that the cluster holds."""
    distributed = pytest.importorskip("distributed", reason="the dask extra is not installed")
    with pytest.raises(InputError, match="no Dask scheduler"):
        run_map(square, [1], backend="dask", address=address)
    # by type: `isinstance` asks each object for its class, and dead weak references of other tests refuse
    clients = [each for each in gc.get_objects() if issubclass(type(each), distributed.Client)]
    assert {client.status for client in clients} <= {"closed", "newly-created"}


@pytest.mark.slow
def test_a_dask_scheduler_without_workers_is_not_waited_for_for_ever():
    distributed = pytest.importorskip("distributed", reason="the dask extra is not installed")
    with distributed.LocalCluster(n_workers=0, dashboard_address=None) as cluster:
        address = cluster.scheduler_address
        with pytest.raises(InputError, match=r"had no worker for 1 s; start one by 'python -m pipeline.dask_worker"):
            run_map(square, [1, 2], backend="dask", address=address, worker_timeout_s=1)


@pytest.mark.slow
@pytest.mark.full("a cluster that loses two workers takes 7 s")
def test_dask_gives_the_same(tmp_path):
    distributed = pytest.importorskip("distributed", reason="the dask extra is not installed")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        address = cluster.scheduler_address
        function = functools.partial(die_once, str(tmp_path))
        assert run_map(function, range(6), backend="dask", address=address) == [x * x for x in range(6)]
        assert (tmp_path / "died-2").exists()
    with pytest.raises(InputError, match="no Dask scheduler"):
        run_map(square, [1], backend="dask", address="tcp://127.0.0.1:9")


@pytest.mark.parametrize("workers", [1, 2])
def test_of_several_errors_the_first_in_order_is_raised(workers):
    with pytest.raises(InputError, match="item 0"):
        run_map(refuse_late_and_soon, range(4), workers=workers)
