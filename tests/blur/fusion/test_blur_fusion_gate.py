"""The gate: a weighted mean of logits whose weights are learned."""

import numpy as np
import pytest
import torch

from pipeline.blur.fusion import gate as fusion_gate
from pipeline.blur.fusion.gate import FusionGate, logit
from pipeline.learning.initial import initialise
from pipeline.streams import stream

COUNT = 5


@pytest.fixture
def arguments():
    generator = stream(1, "test gate")
    members = torch.from_numpy(generator.uniform(0.05, 0.95, (COUNT, 3, 2, 8)).astype(np.float32))
    scale = torch.from_numpy(generator.uniform(0.01, 0.1, (COUNT, 2, 8)).astype(np.float32))
    return members, scale, torch.full((COUNT,), 3.0)


def gate(begin):
    made = FusionGate()
    initialise(made, 3, "test gate")
    if begin:
        made.begin()
    return made.eval()


def test_inputs_have_the_declared_number_and_are_finite_at_the_ends(arguments):
    members, scale, sigma = arguments
    members[0], members[1] = 0.0, 1.0
    seen = fusion_gate.inputs(members, 0 * scale, sigma)
    assert seen.shape == (COUNT, 2, 8, fusion_gate.INPUTS)
    assert torch.isfinite(seen).all()


def test_it_begins_as_a_fixed_mean_of_logits(arguments):
    members = arguments[0]
    weights = torch.softmax(torch.tensor([fusion_gate.SPECTRAL_START, 0.0, 0.0]), 0)
    expected = torch.sigmoid((weights.view(1, 3, 1, 1) * logit(members)).sum(1))
    with torch.inference_mode():
        mtf, scale = gate(begin=True)(*arguments)
    assert torch.allclose(mtf, expected, atol=1e-6)
    assert torch.allclose(scale, arguments[1] + fusion_gate.SMALLEST_SCALE, atol=1e-4)


def test_members_that_agree_are_believed(arguments):
    members = arguments[0]
    same = members[:, :1].expand(-1, 3, -1, -1)
    with torch.inference_mode():
        mtf, _ = gate(begin=True)(same, *arguments[1:])
    assert torch.allclose(mtf, members[:, 0], atol=1e-5)


def test_directions_are_treated_alike(arguments):
    members, scale, sigma = arguments
    trained = gate(begin=False)
    with torch.inference_mode():
        mtf, wide = trained(*arguments)
        turned, turned_wide = trained(members.flip(2), scale.flip(1), sigma)
    assert torch.allclose(turned.flip(1), mtf, atol=1e-6)
    assert torch.allclose(turned_wide.flip(1), wide, atol=1e-6)


def test_patches_do_not_depend_on_each_other(arguments):
    trained = gate(begin=False)
    with torch.inference_mode():
        mtf, _ = trained(*arguments)
        alone, _ = trained(*(part[2:3] for part in arguments))
    assert torch.allclose(alone, mtf[2:3], atol=1e-6)
