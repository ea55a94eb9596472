"""Affine maps of logits: a known map is recovered, strong draws keep the start, slopes are right."""

import numpy as np
import pytest

from pipeline.blur.calibration import affine_logits
from pipeline.blur.calibration.affine_logits import logit, sigmoid
from pipeline.streams import stream

VALUES = 16


@pytest.fixture(scope="module")
def samples():
    """Logits of two networks and the MTFs that a map of them gives: (400, 32), (400, 16), A, b."""
    generator = stream(3, "test affine logits")
    read = generator.normal(0, 1.5, (400, 2 * VALUES))
    start = np.tile(np.eye(VALUES), 2) / 2
    matrix = start + generator.normal(0, 0.1, start.shape)
    offset = generator.normal(0, 0.3, VALUES)
    return read, sigmoid(read @ matrix.T + offset), matrix, offset


def test_logit_and_sigmoid_are_inverse_away_from_the_ends():
    inside = np.linspace(0.01, 0.99, 50)
    assert sigmoid(logit(inside)) == pytest.approx(inside)
    assert logit(np.array([0.0, 1.0])) == pytest.approx([-5.5175, 5.5175], abs=1e-3)


def test_a_weak_draw_recovers_the_map(samples):
    read, truth, matrix, offset = samples
    ((result, shift),) = affine_logits.fit(read, truth, [1e-6])
    assert np.abs(sigmoid(read @ result.T + shift) - truth).mean() < 0.005
    assert np.abs(result - matrix).mean() < 0.02
    assert np.abs(shift - offset).max() < 0.15


def test_the_stronger_the_draw_the_nearer_the_start_and_the_greater_the_error(samples):
    read, truth, _, _ = samples
    start = np.tile(np.eye(VALUES), 2) / 2
    maps = affine_logits.fit(read, truth, [100.0, 1.0, 0.1, 0.001])
    distance = [np.abs(matrix - start).mean() for matrix, _ in maps]
    error = [np.abs(sigmoid(read @ matrix.T + offset) - truth).mean() for matrix, offset in maps]
    assert distance == sorted(distance) and distance[0] < 0.002
    assert error == sorted(error, reverse=True)


def test_an_offset_is_hardly_drawn_however_strong_the_draw_of_the_matrix(samples):
    """A camera that is softer all over moves all logits alike, which few samples tell."""
    read = samples[0]
    truth = sigmoid((read[:, :VALUES] + read[:, VALUES:]) / 2 - 0.5)
    ((_, offset),) = affine_logits.fit(read, truth, [100.0])
    assert offset == pytest.approx(np.full(VALUES, -0.5), abs=0.05)


def test_a_map_is_the_least_of_its_loss(samples):
    """No small step in any of many random directions lowers what is minimised."""
    read, truth, _, _ = samples
    strength = 0.1
    ((matrix, offset),) = affine_logits.fit(read, truth, [strength])
    start = np.tile(np.eye(VALUES), 2) / 2

    def loss(at, shift):
        error = sigmoid(read @ at.T + shift) - truth
        draw = strength * np.square(at - start).sum() + affine_logits.OFFSET_STRENGTH * np.square(shift).sum()
        return np.sqrt(error**2 + affine_logits.ROUNDING**2).mean() + draw / VALUES

    generator, least = stream(4, "test affine logits"), loss(matrix, offset)
    for _ in range(50):
        step = 0.02 * generator.normal(size=matrix.shape), 0.02 * generator.normal(size=offset.shape)
        assert loss(matrix + step[0], offset + step[1]) > least


def test_the_order_of_samples_changes_nothing_that_matters(samples):
    read, truth, _, _ = samples
    ((one, shift_one),) = affine_logits.fit(read, truth, [0.1])
    ((other, shift_other),) = affine_logits.fit(read[::-1], truth[::-1], [0.1])
    assert np.abs(one - other).max() < 0.01 and np.abs(shift_one - shift_other).max() < 0.02
