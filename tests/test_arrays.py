"""Arrays of what callers hand in."""

import numpy as np
import pytest
import torch

from pipeline.arrays import as_array


@pytest.mark.parametrize("kind", [torch.float16, torch.bfloat16, torch.float32])
def test_floats_of_a_tensor_are_at_least_of_single_precision(kind: torch.dtype) -> None:
    array = as_array(torch.tensor([0.25, 0.5], dtype=kind))
    assert array.dtype == np.float32
    assert array.tolist() == [0.25, 0.5]


def test_other_types_of_a_tensor_are_kept() -> None:
    assert as_array(torch.zeros(2, dtype=torch.float64)).dtype == np.float64
    assert as_array(torch.zeros(2, dtype=torch.uint8)).dtype == np.uint8


def test_a_tensor_with_a_gradient_shares_its_memory() -> None:
    tensor = torch.zeros(2, requires_grad=True)
    array = as_array(tensor)
    with torch.no_grad():
        tensor[0] = 1.0
    assert array.tolist() == [1.0, 0.0]


def test_anything_else_is_left_as_it_is() -> None:
    masked = np.ma.masked_array(np.zeros(2), mask=[True, False])
    assert as_array(masked) is masked
    assert as_array("frame") == "frame"
