"""Feeding: the same batches whoever makes the chunks and wherever a run begins; dead workers are reported."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from pipeline.learning.chunk_loader import ChunkLoader, ProducerDied


def numbered(number):
    """A chunk that says its number."""
    return {"x": np.full((2, 3), number, np.float32), "y": np.array([number, number])}


def failing(number):
    """Works twice."""
    if number == 2:
        raise ValueError("no more")
    return numbered(number)


def test_every_chunk_is_used_about_as_often_as_said():
    loader = ChunkLoader(numbered, 1, new_chunks_per_step=2, replays=3, replay_window=20, producers=0)
    used = np.concatenate([loader.numbers(step) for step in range(400)])
    counts = np.bincount(used, minlength=800)[40:740]
    assert counts.min() >= 1 and counts.mean() == pytest.approx(3, abs=0.1)
    for step in (50, 399):
        numbers = loader.numbers(step)
        assert numbers[:2] == [2 * step, 2 * step + 1]
        assert all(2 * step - 20 <= number < 2 * step for number in numbers[2:])


def test_batches_hold_their_chunks_in_order():
    loader = ChunkLoader(numbered, 1, replays=2, replay_window=5, producers=0)
    for step in range(8):
        batch = loader.batch(step)
        assert batch["x"].shape == (4, 3)
        assert batch["y"].tolist() == np.repeat(loader.numbers(step), 2).tolist()


@pytest.mark.parametrize("producers", [1, 2])
def test_producers_change_nothing(producers):
    here = ChunkLoader(numbered, 1, new_chunks_per_step=1, replays=2, replay_window=6, producers=0)
    with ChunkLoader(
        numbered, 1, new_chunks_per_step=1, replays=2, replay_window=6, producers=producers, ahead=2
    ) as there:
        for step in range(3, 9):
            one, two = here.batch(step), there.batch(step)
            assert all(np.array_equal(one[name], two[name]) for name in ("x", "y"))


def test_beginning_later_sees_the_same():
    first = ChunkLoader(numbered, 1, replays=3, replay_window=4, producers=0)
    whole = [first.batch(step)["y"].tolist() for step in range(12)]
    later = ChunkLoader(numbered, 1, replays=3, replay_window=4, producers=0)
    assert [later.batch(step)["y"].tolist() for step in range(7, 12)] == whole[7:]


def test_a_failing_producer_is_reported():
    with ChunkLoader(failing, 1, replays=1, producers=1) as loader, pytest.raises(ProducerDied, match="no more"):
        for step in range(4):
            loader.batch(step)


def large(number):
    """More than a pipe takes at once."""
    return {"x": np.full(2_000_000, number, np.float32)}


def test_a_producer_that_is_killed_while_it_sends_is_reported():
    """The system kills one where memory is short; the trainer waited for the rest of its chunk for ever."""

    def too_late(number, frame):
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, too_late)
    try:
        with ChunkLoader(large, 1, replays=1, producers=1) as loader:
            loader.batch(0)
            os.kill(loader._workers[0][0].pid, signal.SIGKILL)
            signal.alarm(30)
            with pytest.raises(ProducerDied, match=r"ended \(-9; is memory short\?\); start the training again"):
                for step in range(1, 100):
                    loader.batch(step)
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def test_producers_end_with_a_killed_trainer():
    code = (
        "import os, signal, time\n"
        "from pipeline.learning.chunk_loader import ChunkLoader\n"
        "if __name__ == '__main__':\n"
        "    feed = ChunkLoader(time.gmtime, 1, replays=1, producers=1, ahead=2)\n"
        "    feed._start(0)\n"
        "    print(feed._workers[0][0].pid, flush=True)\n"
        "    time.sleep(1.0)\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    root = Path(__file__).resolve().parents[2]
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=root)
    assert ended.returncode == -9
    worker = int(ended.stdout)
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        try:
            os.kill(worker, 0)
        except ProcessLookupError:
            return
        time.sleep(0.5)
    os.kill(worker, 9)
    pytest.fail("the producer outlived its trainer")
