"""Where a calibrated answer follows the network that knows halos."""

import numpy as np

from pipeline.blur.calibration import halo


def mixed(joint, alone):
    """Of one patch, directions and frequencies apart: (2, 8)."""
    return halo.mixed(joint.reshape(1, 16), alone.reshape(1, 16)).reshape(2, 8)


def falling(top, bottom):
    """The same MTF in both directions."""
    return np.tile(np.linspace(top, bottom, 8), (2, 1))


def test_a_drop_from_the_lowest_frequencies_on_in_both_directions_is_a_halo():
    joint, alone = falling(0.98, 0.6), falling(0.85, 0.4)
    assert np.allclose(mixed(joint, alone), alone, atol=1e-9)


def test_a_drop_at_high_frequencies_alone_is_none():
    joint = falling(0.98, 0.8)
    alone = joint.copy()
    alone[:, 4:] -= 0.3
    assert np.array_equal(mixed(joint, alone), joint)


def test_a_drop_in_one_direction_alone_is_none():
    joint = falling(0.98, 0.8)
    for direction in range(2):
        alone = joint.copy()
        alone[direction] -= 0.3
        assert np.array_equal(mixed(joint, alone), joint)


def test_a_network_that_reads_more_is_not_followed():
    joint = falling(0.85, 0.4)
    assert np.array_equal(mixed(joint, falling(0.98, 0.6)), joint)


def test_between_the_two_thresholds_the_answer_moves_steadily():
    joint = falling(0.9, 0.5)
    drops = np.linspace(0, 1.5 * halo.FULLY_FROM, 40)
    answers = np.array([mixed(joint, joint - drop).mean() for drop in drops])
    below = drops <= halo.FROM
    assert np.array_equal(answers[below], np.full(below.sum(), joint.mean()))
    assert (np.diff(answers[~below]) < 0).all()
    assert np.abs(np.diff(answers)).max() < 0.005
    assert np.isclose(answers[-1], joint.mean() - drops[-1])


def test_under_strong_noise_no_halo_is_seen():
    joint, alone = falling(0.98, 0.6).reshape(1, 16), falling(0.85, 0.4).reshape(1, 16)
    low, high = halo.NOISE_DN
    answers = [halo.mixed(joint, alone, np.array([sigma])) for sigma in (0.0, low, (low + high) / 2, high, 40.0)]
    assert np.array_equal(answers[0], halo.mixed(joint, alone)) and np.array_equal(answers[1], answers[0])
    assert (alone < answers[2]).all() and (answers[2] < joint).all()
    assert np.array_equal(answers[3], joint) and np.array_equal(answers[4], joint)
