"""Square root and logarithm: NumPy's where networks answer, torch's where they are trained."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from pipeline.learning import elementwise
from pipeline.streams import stream

FUNCTIONS = [(elementwise.square_root, torch.sqrt, np.sqrt), (elementwise.logarithm, torch.log, np.log)]


def values() -> torch.Tensor:
    return torch.from_numpy(np.exp(stream(1, "elementwise").normal(0, 5, (50, 403))).astype(np.float32))


@pytest.mark.parametrize(("function", "of_torch", "of_numpy"), FUNCTIONS)
def test_answers_are_of_numpy(function, of_torch, of_numpy):
    x = values()
    with torch.inference_mode():
        for part in (x, x[:, ::2], x[0], x[0, 0]):
            result = function(part)
            assert result.dtype == torch.float32 and result.shape == part.shape
            np.testing.assert_array_equal(result.numpy(), of_numpy(part.numpy()))


@pytest.mark.parametrize(("function", "of_torch", "of_numpy"), FUNCTIONS)
def test_trainings_keep_those_of_torch(function, of_torch, of_numpy):
    x = values().requires_grad_()
    result = function(x)
    result.sum().backward()
    again = x.detach().clone().requires_grad_()
    of_torch(again).sum().backward()
    assert torch.equal(result, of_torch(x)) and torch.equal(x.grad, again.grad)
    with torch.no_grad():
        assert torch.equal(function(x), of_torch(x))


def test_a_square_root_is_rounded_correctly():
    x = values()
    with torch.inference_mode():
        result = elementwise.square_root(x)
    np.testing.assert_array_equal(result.numpy(), np.sqrt(x.double().numpy()).astype(np.float32))
