"""Frames estimated ahead of their analysis, one thread per processor core, in order and with flat memory."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TYPE_CHECKING

from pipeline.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pipeline.cli.analysis.frame import Estimated, FrameAnalysis
    from pipeline.datasets.decoding.video_coding import Coding

WAITING = 1
"""Frames decoded that no thread estimates yet."""

MOST_THREADS = 8
"""A frame takes about 100 MB while it is estimated."""


def estimated_ahead(
    analysis: FrameAnalysis,
    frames: Iterable[tuple[str, NDArray[np.float32] | None, str, Coding]],
    threads: int | None = None,
) -> Generator[tuple[str, NDArray[np.float32], Callable[[], Estimated]], None, None]:
    """Estimate frames in threads, as many at once as there are threads, with one more decoded and waiting.

    Without it a thread that is done waits until the next frame is decoded, which the caller's thread does.

    The libraries that estimate leave Python's lock while they compute, so that threads fill the cores; processes would
    each load torch and the weights anew.

    Args:
        analysis: whose `FrameAnalysis.estimate` is called.
        frames: name, (H, W) float32 in [0, 1] or None, the reason where it is None, and its coding
            (`pipeline.cli.frames.pictures.readable`).
        threads: how many; None for one per core, at most `MOST_THREADS`.

    Returns:
        in the frames' order: name, picture, and a function that waits for the estimates; it raises `InputError` where
        the frame is none.
    """
    from pipeline.executor import available_cores, one_thread

    threads = threads or min(available_cores(), MOST_THREADS)
    waiting: deque[tuple[str, NDArray[np.float32], Future[Estimated]]] = deque()
    pool = ThreadPoolExecutor(threads, "frame", initializer=one_thread)
    try:
        for name, image, problem, coding in frames:
            waiting.append((name, image, pool.submit(_estimate, analysis, image, problem, coding)))  # type: ignore[arg-type]
            if len(waiting) > threads + WAITING:
                yield _first(waiting)
        while waiting:
            yield _first(waiting)
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _estimate(analysis: FrameAnalysis, image: NDArray[np.float32] | None, problem: str, coding: Coding) -> Estimated:
    if image is None:
        raise InputError(problem)
    return analysis.estimate(image, coding)


def _first(
    waiting: deque[tuple[str, NDArray[np.float32], Future[Estimated]]],
) -> tuple[str, NDArray[np.float32], Callable[[], Estimated]]:
    name, image, future = waiting.popleft()
    return name, image, future.result
