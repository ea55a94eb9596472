"""Square root and logarithm: NumPy's where networks answer and where they are trained."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import torch

from pipeline.learning import elementwise
from pipeline.streams import stream

FUNCTIONS = [(elementwise.square_root, torch.sqrt, np.sqrt), (elementwise.logarithm, torch.log, np.log)]


def values() -> torch.Tensor:
    return torch.from_numpy(np.exp(stream(1, "elementwise").normal(0, 5, (50, 403))).astype(np.float32))


@pytest.mark.parametrize("mode", [torch.inference_mode, torch.no_grad, torch.enable_grad])
@pytest.mark.parametrize(("function", "of_torch", "of_numpy"), FUNCTIONS)
def test_numpy_computes_them(function, of_torch, of_numpy, mode):
    x = values()
    with mode():
        for part in (x, x[:, ::2], x[0], x[0, 0], x.double()):
            result = function(part)
            assert result.dtype == part.dtype and result.shape == part.shape
            np.testing.assert_array_equal(result.numpy(), of_numpy(part.numpy()))


@pytest.mark.parametrize(("function", "of_torch", "of_numpy"), FUNCTIONS)
def test_a_training_has_their_derivatives(function, of_torch, of_numpy):
    x = values().requires_grad_()
    result = function(x)
    np.testing.assert_array_equal(result.detach().numpy(), of_numpy(x.detach().numpy()))
    (result * torch.arange(403)).sum().backward()
    again = x.detach().clone().requires_grad_()
    (of_torch(again) * torch.arange(403)).sum().backward()
    torch.testing.assert_close(x.grad, again.grad, rtol=1e-6, atol=0)
    few = x.detach()[0, :20].double().requires_grad_()
    assert torch.autograd.gradcheck(function, few, atol=1e-4, rtol=1e-3)


@pytest.mark.parametrize(("function", "of_torch", "of_numpy"), FUNCTIONS)
def test_half_precision_and_exported_networks_keep_those_of_torch(function, of_torch, of_numpy):
    x = values()
    assert torch.equal(function(x.bfloat16()), of_torch(x.bfloat16()))
    traced = torch.jit.trace(function, x)
    assert "PythonOp" not in str(traced.graph)
    assert torch.equal(traced(2 * x), of_torch(2 * x))


def test_a_square_root_is_rounded_correctly():
    x = values()
    np.testing.assert_array_equal(
        elementwise.square_root(x).numpy(), np.sqrt(x.double().numpy()).astype(np.float32)
    )  # fmt: skip


def test_no_module_takes_square_roots_from_torch():
    """MKL's differ between processors; the pixel network's, of each patch's contrast, once moved whole calibrations."""
    of_torch = re.compile(r"torch\.r?sqrt\(|\.r?sqrt_?\(\)")
    package = Path(elementwise.__file__).parents[1]
    files = {
        str(file.relative_to(package)) for file in package.rglob("*.py") if of_torch.search(file.read_text("utf-8"))
    }
    assert files == {"learning/elementwise.py"}
