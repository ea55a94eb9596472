"""Descent: how far a weight moves at most, where it ends, and that the same call gives the same bytes."""

import pytest
import torch

from pipeline.learning.descent import descend


def test_it_ends_at_the_least_loss():
    """Least absolute error: the median of the samples, whatever their tail."""
    samples = torch.tensor([0.1, 0.2, 0.3, 0.4, 9.0])
    centre = torch.nn.Parameter(torch.zeros(()))
    descend([centre], lambda: (samples - centre).abs().mean(), steps=400, learning_rate=0.02)
    assert centre.item() == pytest.approx(0.3, abs=1e-3)


def test_the_rate_falls_evenly_to_zero():
    """Under a steady slope a step of Adam is the rate itself, so all steps together are rate (T + 1) / 2."""
    weight, passed = torch.nn.Parameter(torch.zeros(())), []
    steps, rate = 10, 0.1

    def loss():
        passed.append(weight.item())
        return -weight

    descend([weight], loss, steps=steps, learning_rate=rate)
    assert weight.item() == pytest.approx(rate * (steps + 1) / 2, rel=1e-4)
    assert passed[1] - passed[0] == pytest.approx(rate, rel=1e-4)
    assert weight.item() - passed[-1] == pytest.approx(rate / steps, rel=1e-3)


def test_decay_draws_weights_to_zero():
    weight = torch.nn.Parameter(torch.ones(()))
    descend([weight], lambda: 0 * weight, steps=5, learning_rate=0.1, weight_decay=0.5)
    expected = 1.0
    for step in range(5):
        expected *= 1 - 0.5 * 0.1 * (1 - step / 5)
    assert weight.item() == pytest.approx(expected, rel=1e-5)
