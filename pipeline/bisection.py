"""Where a condition that holds from some number on begins, by halving an interval a fixed number of times.

`scipy.optimize.bisect` needs values with signs and stops by a tolerance; here the condition may be any comparison, and
the same halvings give the same bytes however steep the function is.
"""

from __future__ import annotations

from collections.abc import Callable


def bisected(holds: Callable[[float], bool], low: float, high: float, halvings: int) -> float:
    """The number from which on a condition holds.

    Args:
        holds: false below that number, true above.
        low: where it does not hold; not checked.
        high: where it holds; not checked.
        halvings: how often the interval is halved; the answer is exact to (high - low) / 2^(halvings + 1).

    Returns:
        the middle of the last interval.
    """
    for _ in range(halvings):
        middle = (low + high) / 2
        low, high = (low, middle) if holds(middle) else (middle, high)
    return (low + high) / 2
