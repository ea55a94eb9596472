"""Feeding a trainer: chunks made ahead by worker processes, in order, each used more than once.

Step t takes chunks tF .. tF + F - 1 fresh, and for each of them R - 1 others picked evenly from the W before; so every
chunk serves about R times, far enough apart. Which ones is a pure function of (seed, t): a run that is resumed at step
t sees what the uninterrupted run would have seen. Making samples costs about as much as a training step, and without
repetition the trainer would wait half the time.
"""

from __future__ import annotations

import multiprocessing
import queue
import traceback
from collections.abc import Callable
from types import TracebackType
from typing import Any, Self

import numpy as np

from pipeline import processor
from pipeline.streams import stream

Arrays = dict[str, np.ndarray]
Maker = Callable[[int], Arrays]

WAIT_S = 5.0


class ProducerDied(RuntimeError):
    """A process that made chunks has gone; its last words, if any, are in the message."""


class ChunkLoader:
    """Batches by step.

    Args:
        make: chunk number -> arrays of equal first length; picklable, a pure function of the number.
        seed: of the choice of repeated chunks.
        new_chunks_per_step: F, fresh chunks in a batch.
        replays: R, how often a chunk is used, on average.
        replay_window: W, chunks kept for repetition.
        producers: worker processes that make chunks ahead; 0 makes them here.
        ahead: chunks a producer may be ahead.
    """

    def __init__(
        self,
        make: Maker,
        seed: int,
        *,
        new_chunks_per_step: int = 1,
        replays: int = 2,
        replay_window: int = 256,
        producers: int = 1,
        ahead: int = 16,
    ) -> None:
        self.make, self.seed, self.new_chunks_per_step, self.replays, self.replay_window = (
            make,
            seed,
            new_chunks_per_step,
            replays,
            replay_window,
        )
        self.producers, self.ahead = producers, ahead
        self._kept: dict[int, Arrays] = {}
        self._next: int | None = None
        self._workers: list[tuple[Any, Any]] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def numbers(self, step: int) -> list[int]:
        """The chunks of one step: fresh ones first."""
        first = step * self.new_chunks_per_step
        chosen = list(range(first, first + self.new_chunks_per_step))
        generator = stream(self.seed, "repeated chunks", step)
        repeats = self.new_chunks_per_step * (self.replays - 1)
        oldest = max(first - self.replay_window, 0)
        # At the very beginning there is nothing before: the fresh ones are repeated.
        span = (oldest, first) if first > 0 else (0, self.new_chunks_per_step)
        return chosen + [int(generator.integers(*span)) for _ in range(repeats)]

    def batch(self, step: int) -> Arrays:
        """The batch of a step; steps must not decrease.

        Raises:
            ProducerDied: a worker process ended or failed.
        """
        wanted = self.numbers(step)
        first = step * self.new_chunks_per_step
        if self._next is None:
            self._next = max(first - self.replay_window, 0) if self.replays > 1 else first
            self._start(self._next)
        while self._next < first + self.new_chunks_per_step:
            self._kept[self._next] = self._receive(self._next)
            self._next += 1
        for old in [number for number in self._kept if number < first - self.replay_window]:
            del self._kept[old]
        chunks = [self._kept[number] for number in wanted]
        return {name: np.concatenate([chunk[name] for chunk in chunks]) for name in chunks[0]}

    def close(self) -> None:
        """Stop the workers."""
        for process, _ in self._workers:
            process.terminate()
            process.join()
        self._workers = []

    def _start(self, first: int) -> None:
        context = multiprocessing.get_context("spawn")
        for worker in range(self.producers):
            out: Any = context.Queue(self.ahead)
            begin = first + (worker - first) % self.producers  # worker w makes the numbers equal to w, modulo
            process = context.Process(target=_produce, args=(self.make, begin, self.producers, out), daemon=True)
            with processor.for_children():
                process.start()
            out._writer.close()  # of this process: were it open, what a killed worker sent in part would have no end
            self._workers.append((process, out))

    def _receive(self, number: int) -> Arrays:
        if not self._workers:
            return self.make(number)
        process, out = self._workers[number % self.producers]
        try:
            made = out.get()
        except (EOFError, OSError):
            process.join()
            raise ProducerDied(
                f"the process that makes training samples ended ({process.exitcode}; is memory short?); start the "
                "training again, it goes on from its last checkpoint"
            ) from None
        if isinstance(made, str):
            raise ProducerDied(f"making training samples failed:\n{made}")
        return made


def _produce(make: Maker, first: int, step: int, out: Any) -> None:
    """What a worker process does: numbers first, first + step, ... until it is stopped."""
    from pipeline.executor import one_thread

    one_thread()
    number = first
    while True:
        try:
            made: Arrays | str = make(number)
        except Exception:
            out.put(traceback.format_exc())
            raise
        while True:
            try:
                out.put(made, timeout=WAIT_S)
                break
            except queue.Full:
                trainer = multiprocessing.parent_process()
                if trainer is None or not trainer.is_alive():  # killed: nobody would ever stop this process
                    out.cancel_join_thread()
                    return
        number += step
