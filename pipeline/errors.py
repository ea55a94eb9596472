"""The one exception that means "your input is wrong", shown to people as a single line."""

from __future__ import annotations

import difflib
import math
import struct
import zlib
from collections.abc import Iterable

DECODER_ERRORS = (
    OSError, SyntaxError, ValueError, EOFError, TypeError, AttributeError, LookupError, ArithmeticError, MemoryError,
    RuntimeError, struct.error, zlib.error,
)  # fmt: skip
"""What Pillow raises for a damaged file, whose tags it takes as they are."""


class InputError(Exception):
    """Wrong configuration, data or argument: names the file or key, what was expected, and how to mend it.

    Stages and the command line print its message without a traceback and exit with status 2.
    """


def finite_at_least_0(name: str, value: float) -> None:
    """Check a setting that is a finite number of at least 0.

    Args:
        name: of the setting, as the message shall name it.
        value: it.

    Raises:
        InputError: it is no such number.
    """
    if not 0 <= value < math.inf:
        raise InputError(f"{name}={value!r}, expected a finite number, 0 or more")


def printable(text: object) -> str:
    """Text for a message of one line: control characters, line feeds among them, become escapes."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in str(text))


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """A hint naming the nearest known word, or listing all of them.

    Args:
        name: the word that was not recognised.
        known: every word that would have been.

    Returns:
        ``"did you mean 'x'?"`` or ``"known: a, b, c"``.
    """
    words = sorted(set(known))
    near = difflib.get_close_matches(name, words, n=1, cutoff=0.6)
    return f"did you mean '{near[0]}'?" if near else f"known: {', '.join(words) or 'none'}"
