"""Checks numbers that users give as options: one line names the option, its value and what was expected."""

from __future__ import annotations

import numbers
from collections.abc import Callable

from pipeline.errors import InputError


def is_number(value: object) -> bool:
    """Whether a value is a real number; True and False are none."""
    return isinstance(value, numbers.Real) and not isinstance(value, bool)


def is_count(value: object) -> bool:
    """Whether a value is a whole number; True and False are none."""
    return isinstance(value, numbers.Integral) and not isinstance(value, bool)


def check_number(owner: str, name: str, value: object, expected: str, accepts: Callable[[float], bool]) -> None:
    """Refuses what is no number in a range.

    Args:
        owner: what takes the option, e.g. ``"policy shim"``.
        name: of the option.
        value: as given.
        expected: the range in words, e.g. ``"a number above 0"``.
        accepts: whether a number is in the range; False for NaN.

    Raises:
        InputError: it is none.
    """
    if not (is_number(value) and accepts(value)):  # type: ignore[arg-type]
        raise InputError(f"{owner}: {name} is {value!r}; expected {expected}")
