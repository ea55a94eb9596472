"""Numbers on the command line: finite and within stated bounds."""

from __future__ import annotations

import math
from typing import Any

import click

LARGEST_MTF50 = 0.59
"""Fraction of Nyquist up to which MTF50 is measured: the last of `pipeline.camera.mtf.FREQUENCIES`, rounded down."""


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


class Mtf50Limit(FiniteRange):
    """A limit that an MTF50 is compared with: at most `LARGEST_MTF50`, above which nobody knows whether it is kept."""

    def __init__(self) -> None:
        super().__init__(0, LARGEST_MTF50)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """The number, or a usage error that states up to which frequency MTF50 is measured."""
        if click.FLOAT.convert(value, param, ctx) > LARGEST_MTF50:
            self.fail(f"{value}: MTF50 is measured up to {LARGEST_MTF50:g} of Nyquist; give at most that.", param, ctx)
        return super().convert(value, param, ctx)
