"""Numbers on the command line: finite and within stated bounds."""

from __future__ import annotations

import math
from typing import Any

import click


class FiniteRange(click.FloatRange):
    """A number between two bounds, both included; ``nan`` and ``inf`` are refused.

    Args:
        low, high: the bounds.
    """

    def __init__(self, low: float, high: float) -> None:
        super().__init__(min=low, max=high)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """The number, or a usage error that names the bounds."""
        number = click.FLOAT.convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value} is not a number in {self.min:g} .. {self.max:g}.", param, ctx)
        return float(super().convert(number, param, ctx))
