"""Signals that end a command wait until results that belong together are written."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Iterator

from pipeline.cli import ENDING_SIGNALS
from pipeline.signals import handled

INTERRUPTS = (signal.SIGINT, *ENDING_SIGNALS)


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
