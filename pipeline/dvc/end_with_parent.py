"""Starts a command that the kernel ends once the process that asked for it is gone, on Linux.

``dvc repro`` hands the signals that it receives to its running commands, but not if it is killed, for instance because
memory is short: a training would go on for hours, and write its results over those of a later run. Run as a program,
by path and without `pipeline`, this becomes the command. Of a command in a shell it is the shell that ends, unless the
command takes its place (``exec``).
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from collections.abc import Sequence

SET_PARENT_DEATH_SIGNAL = 1
"""``PR_SET_PDEATHSIG`` of prctl(2): kept when another program takes the place of this one."""


def command(words: Sequence[str]) -> list[str]:
    """What to run in the place of a command, from the thread that waits for it.

    Args:
        words: program and arguments.
    """
    if sys.platform != "linux":
        return list(words)
    return [sys.executable, "-P", "-S", __file__, str(os.getpid()), *words]


def main() -> None:
    """Run the command; returns never."""
    parent, *words = sys.argv[1:]
    ctypes.CDLL(None).prctl(SET_PARENT_DEATH_SIGNAL, signal.SIGTERM)
    if os.getppid() != int(parent):  # it went before the kernel knew
        raise SystemExit(128 + signal.SIGTERM)
    os.execvp(words[0], words)


if __name__ == "__main__":
    main()
