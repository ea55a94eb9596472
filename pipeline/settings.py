"""What the settings of every package are made of: strict, frozen models, and the ranges of numbers.

Each package declares its settings in its module ``settings``; ``pipeline.config`` puts them together, reads and checks
them. Settings that code makes too (`STRICT` dataclasses) are checked wherever they are made.
"""

from __future__ import annotations

from collections.abc import Hashable
from typing import Annotated, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

Item = TypeVar("Item", bound=Hashable)


def without_repeats(values: list[Item]) -> list[Item]:
    """The values, each of which may be given once: a condition given twice would be counted twice.

    Args:
        values: of a list in the settings.

    Returns:
        the same list.

    Raises:
        ValueError: a value is given more than once (5 and 5.0 are equal), with that value.
    """
    repeated = next((value for number, value in enumerate(values) if value in values[:number]), None)
    if repeated is not None:
        raise ValueError(f"{repeated!r} is given more than once; give every value once")
    return values


UNIQUE = AfterValidator(without_repeats)
"""Of a list whose values stand for conditions or members."""

Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
Fraction = Annotated[float, Field(ge=0, le=1)]
Count = Annotated[int, Field(ge=1, strict=True)]
Seed = Annotated[int, Field(ge=0, lt=2**63, strict=True)]
Draws = Annotated[int, Field(ge=1, le=100_000)]
"""Of a bootstrap."""
Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9_]+$")]
Level = Annotated[float, Field(ge=0, le=100)]
Frequency = Annotated[float, Field(gt=0, le=0.5)]
PatchPx = Annotated[int, Field(ge=32, le=1024)]
TilePx = Annotated[int, Field(ge=16, le=1024)]
BlurKind = Literal["defocus", "linear_motion", "nonlinear_motion"]
NoiseSource = Literal["photon", "dcsn", "readout", "combined", "sensor"]

STRICT = ConfigDict(extra="forbid", allow_inf_nan=False)
"""Of pydantic dataclasses: unknown keys are errors, and so is NaN."""


class Settings(BaseModel):
    """Strict settings: unknown keys and NaN are errors, values do not change after reading."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
