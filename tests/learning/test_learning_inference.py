"""Estimators answer alike whatever the program that calls them has set in torch."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from pipeline import blur, noise
from pipeline.streams import stream


def of_blur() -> np.ndarray:
    return stream(4, "inference").random((1, 1, 192, 192)).astype(np.float32)


def of_noise() -> np.ndarray:
    levels = np.rint(128 + 5 * stream(3, "inference").standard_normal((1, 1, 128, 128)))
    return (np.clip(levels, 0, 255) / 255).astype(np.float32)


ESTIMATORS = [
    *((blur.create, name, of_blur, "mtf") for name in ("spectral", "cnn", "fused")),
    *((noise.create, name, of_noise, "sigma_dn") for name in ("adaptive", "cellwise", "cnn", "correlated")),
]


@contextmanager
def half_precision() -> Iterator[None]:
    import torch

    with torch.autocast("cpu", torch.bfloat16):
        yield


@contextmanager
def new_tensors_in_double_precision() -> Iterator[None]:
    import torch

    torch.set_default_dtype(torch.float64)
    try:
        yield
        assert torch.get_default_dtype() == torch.float64  # the caller's setting stays
    finally:
        torch.set_default_dtype(torch.float32)


@pytest.mark.parametrize("setting", [half_precision, new_tensors_in_double_precision])
@pytest.mark.parametrize(("create", "name", "patches", "answer"), ESTIMATORS)
def test_a_callers_precision_changes_nothing(
    setting: Callable, create: Callable, name: str, patches: Callable, answer: str
) -> None:
    opened, given = create(name), patches()
    expected = getattr(opened.estimate(given), answer)
    assert np.isfinite(expected).all()
    with setting():
        np.testing.assert_array_equal(getattr(opened.estimate(given), answer), expected)
        np.testing.assert_array_equal(getattr(create(name).estimate(given), answer), expected)
