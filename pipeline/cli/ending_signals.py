"""Signals that end a command, and how they wait until results that belong together are written."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Iterable, Iterator

from pipeline.signals import handled

ENDING_SIGNALS = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))
INTERRUPTS = (signal.SIGINT, *ENDING_SIGNALS)


def not_ignored(numbers: Iterable[signal.Signals]) -> list[signal.Signals]:
    """Signals without those that the program was started to ignore, as ``nohup`` has SIGHUP ignored."""
    return [number for number in numbers if signal.getsignal(number) is not signal.SIG_IGN]


@contextlib.contextmanager
def held() -> Iterator[None]:
    """Hold back the signals that end a command until the block is done, so that its results agree.

    Whatever came meanwhile takes effect at the end of the block, also where it raises. Outside the main thread, where
    no signal is handled, do nothing.
    """
    came: list[int] = []
    try:
        with handled(INTERRUPTS, lambda number, frame: came.append(number)):
            yield
    finally:
        if came:
            signal.raise_signal(came[0])
