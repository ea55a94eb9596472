"""Checks of what experiments are given in Python: estimators, frames with patches, quantities."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from pipeline.errors import InputError
from pipeline.experiments.frames import TestFrame, check_quantity

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.experiments.condition import Quantity
    from pipeline.experiments.run import Method


def check_estimators(estimators: object) -> None:
    """Check that estimators have names.

    Args:
        estimators: expected as name -> estimator.

    Raises:
        InputError: they are no mapping, or there is none.
    """
    if not isinstance(estimators, Mapping) or not estimators:
        held = "none" if isinstance(estimators, Mapping) else type(estimators).__name__
        raise InputError(f"estimators: expected at least one, as name -> estimator, not {held}")


def check_measured(measurements: pd.DataFrame, quantity: Quantity) -> None:
    """Check that there is an estimate.

    Args:
        measurements: from `pipeline.experiments.run.run`.
        quantity: that was to be estimated.

    Raises:
        InputError: there is none, for want of frames or of patches.
    """
    if measurements.empty:
        raise InputError(
            f"frames: none has a patch for {quantity!r}; pipeline.experiments.frames.of_dataset(dataset, {quantity!r})"
            " gives such"
        )


def check_arguments(frames: Sequence[TestFrame], methods: Sequence[Method]) -> None:
    """Check the types of what `pipeline.experiments.run.run` is given.

    Args:
        frames: with their patches.
        methods: estimators and their parts of the experiment.

    Raises:
        InputError: no `TestFrame`, an unknown quantity, an object that is no estimator, or two methods of one name and
            quantity.
    """
    for item in frames:
        if not isinstance(item, TestFrame):
            expected = "pipeline.experiments.frames.TestFrame, as of_dataset(...) gives them"
            raise InputError(f"frames: expected {expected}, not {type(item).__name__}")
    for method in methods:
        check_quantity(method.quantity)
        for estimator in (method.estimator, *method.of_folds):
            made = not isinstance(estimator, type) and any(hasattr(estimator, name) for name in ("estimate", "open"))
            if not made:
                create = "pipeline.blur.create" if method.quantity == "mtf" else "pipeline.noise.create"
                raise InputError(
                    f"estimator '{method.name}': expected an object with estimate(patches), as {create}(...) makes it, "
                    f"not {estimator!r}"
                )
    twice = [key for key, count in Counter(method.key for method in methods).items() if count > 1]
    if twice:
        raise InputError(f"two estimators of {twice[0][0]} are called '{twice[0][1]}'; rename one")
