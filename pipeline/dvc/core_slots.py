"""Which cores each of several commands that run at once has to itself.

A command takes the first slot that is free; with n slots its cores are every n-th of the machine's, from the slot's
number on. One that runs alone has all of them, also from when the others have ended and none can join it.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator


class CoreSlots:
    """Slots of named commands."""

    def __init__(self) -> None:
        self.count = 1
        """Slots there are."""
        self._slots: dict[str, int] = {}
        self._processes: dict[str, int] = {}
        self._cores = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else []

    def __contains__(self, name: str) -> bool:
        return name in self._slots

    def take(self, name: str) -> None:
        """Give a command the first free slot."""
        self._slots[name] = min(set(range(self.count)) - set(self._slots.values()))

    def leave(self, name: str) -> None:
        """The command has ended."""
        del self._slots[name]

    def cores_of(self, name: str) -> set[int] | None:
        """Cores of a command: all where it runs alone, else those of its slot; None where they cannot be chosen."""
        if not self._cores:
            return None
        if len(self._slots) < 2:
            return set(self._cores)
        return set(self._cores[self._slots[name] :: self.count]) or set(self._cores)

    @contextlib.contextmanager
    def running(self, name: str, process: int) -> Iterator[None]:
        """While the command runs as this process, its cores may be widened."""
        self._processes[name] = process
        try:
            yield
        finally:
            del self._processes[name]

    def give_all_cores_to_the_last(self) -> None:
        """Nothing can join a command that is left alone before it ends."""
        if len(self._slots) == 1:
            for name, process in list(self._processes.items()):
                with contextlib.suppress(OSError):
                    os.sched_setaffinity(process, self.cores_of(name) or set())


@contextlib.contextmanager
def affinity(cores: set[int] | None) -> Iterator[None]:
    """The cores of this thread, and of what it starts meanwhile.

    Args:
        cores: their numbers; None leaves them as they are.
    """
    if cores is None:
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, cores)
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)
