"""How estimators are asked: each gets pixels of its own, and what it answers is checked before it becomes a number.

Estimators of third parties stand beside built-in ones. One that works in place must not spoil the pixels of the next,
and an answer for fewer patches, outside its range or outside its own interval is no answer.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar, TypeVar

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError

Answered = TypeVar("Answered")

ROUNDING = 1e-6
"""By which a number may leave its range or its interval, times 1 + the number: that of float32 arithmetic."""

ANSWERS = {"mtf": "pipeline.blur.base.BlurEstimate", "sigma_dn": "pipeline.noise.base.NoiseEstimate"}
"""Quantity -> class of an estimator's answer."""


class WrongAnswer(InputError):
    """An estimator's answer is none; `asked` adds which estimator it is."""


class Answer(ABC):
    """Base class of estimators' answers.

    Attributes:
        quantity: that it holds: ``"mtf"`` or ``"sigma_dn"``.
    """

    quantity: ClassVar[str]

    @abstractmethod
    def check(self, count: int) -> None:
        """Check shapes, ranges and intervals.

        Args:
            count: of the patches that the estimator was given.

        Raises:
            WrongAnswer: with what was expected.
        """


def asked(
    name: str,
    estimate: Callable[[NDArray[Any]], Answered],
    patches: NDArray[Any],
    quantity: str,
    answer_of: Callable[[Answered], object] = lambda answered: answered,
) -> Answered:
    """Ask an estimator for patches; it gets pixels of its own, and its answer is checked.

    Args:
        name: of the estimator in messages, as ``"noise estimator 'mine'"``.
        estimate: its method.
        patches: (N, ...) pixels; they stay as they are.
        quantity: expected: a key of `ANSWERS`.
        answer_of: takes the answer out of what the method returns.

    Returns:
        what the method returns.

    Raises:
        InputError: it is no answer for N patches; see `Answer.check`.
    """
    try:
        result = estimate(patches.copy())
        check_answer(answer_of(result), quantity, len(patches))
    except WrongAnswer as error:
        raise InputError(f"{name}: {error}") from error
    return result


def check_answer(answer: object, quantity: str, count: int) -> None:
    """Check the type of an answer, and what it holds.

    Args:
        answer: of an estimator.
        quantity: a key of `ANSWERS`.
        count: of the patches.

    Raises:
        WrongAnswer: see `Answer.check`.
    """
    if not (isinstance(answer, Answer) and answer.quantity == quantity):
        raise WrongAnswer(f"returned {type(answer).__name__}, expected {ANSWERS[quantity]}")
    answer.check(count)


def check_count(answered: int, count: int) -> None:
    """Check that an answer is for all patches.

    Raises:
        WrongAnswer: it is not.
    """
    if answered != count:
        raise WrongAnswer(f"answered for {answered} of {count} patches; expected all of them")


def check_array(name: str, value: object, shape: tuple[int, ...], kinds: str = "fiu") -> None:
    """Check one array of an answer.

    Args:
        name: of the array.
        value: it.
        shape: expected.
        kinds: of its data type (`numpy.dtype.kind`); numbers by default.

    Raises:
        WrongAnswer: no array of these kinds, or another shape.
    """
    if not isinstance(value, np.ndarray):
        raise WrongAnswer(f"{name} is of type {type(value).__name__}, expected a NumPy array of shape {shape}")
    if value.dtype.kind not in kinds:
        expected = {"fiu": "numbers", "b": "bool"}.get(kinds, "text")
        raise WrongAnswer(f"{name} has the data type {value.dtype}, expected {expected}")
    if value.shape != shape:
        raise WrongAnswer(f"{name} has shape {value.shape}, expected {shape}")


def check_range(name: str, value: NDArray[Any], most: float) -> None:
    """Check that numbers are finite and lie in 0 to ``most``, but for rounding; NaN, which is none, passes.

    Raises:
        WrongAnswer: one does not.
    """
    inside = np.isnan(value) | (np.isfinite(value) & (value >= -ROUNDING) & (value <= most + ROUNDING))
    if not inside.all():
        first = tuple(np.argwhere(~inside)[0])
        expected = f"0 to {most:g}" if np.isfinite(most) else "a finite number, 0 or more"
        raise WrongAnswer(f"{name} of patch {first[0]} is {value[first]:g}, expected {expected}")


def check_interval(name: str, value: NDArray[Any], low: NDArray[Any] | None, high: NDArray[Any] | None) -> None:
    """Check that numbers lie in their intervals, but for rounding; an end that is NaN, or None, is none.

    Raises:
        WrongAnswer: an end is infinite, or on the wrong side.
    """
    for word, end, sign in (("low", low, 1.0), ("high", high, -1.0)):
        if end is None:
            continue
        wrong = np.isinf(end) | (sign * (end - value) > ROUNDING * (1.0 + np.abs(value)))
        if wrong.any():
            first = tuple(np.argwhere(wrong)[0])
            raise WrongAnswer(
                f"{name} of patch {first[0]} is {value[first]:g} with {word} end {end[first]:g}; "
                "expected finite low <= value <= high, NaN where there is no interval"
            )


def check_abstained(name: str, missing: NDArray[np.bool_], abstained: NDArray[np.bool_]) -> None:
    """Check that there is no number exactly where an estimator abstained.

    Args:
        name: of the number.
        missing: (N,) patches without any.
        abstained: (N,).

    Raises:
        WrongAnswer: a number where it abstained, or none where it did not.
    """
    if not np.array_equal(missing, abstained):
        first = int(np.argmax(missing != abstained))
        words = "NaN without an abstention" if missing[first] else "a number in spite of an abstention"
        raise WrongAnswer(f"{name} of patch {first} is {words}; expected NaN exactly where abstained")
