"""One answer of both networks: how their answers and intervals are joined, moved and widened."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from test_noise_adaptive import ADAPTIVE, stack
from test_noise_correlated import flat

from pipeline.noise.adaptive import OFFSET, REAL_CAMERAS, SLOPE, Adaptive
from pipeline.noise.joint_answer import MOST_HIDDEN, MOST_MOVED, WHITE_PART, Levels, Second, joined, widened
from pipeline.noise.traces.codec import codec_traces
from pipeline.streams import stream

FLAT_DN = 1.38  # white noise with which the flattest windows of flat(2, 0.8) would vary as they do


@pytest.mark.parametrize(("possible_dn", "high_dn"), [(3, 3), (9, MOST_HIDDEN * FLAT_DN)])
def test_the_second_network_sets_the_upper_end_where_the_first_cannot_know(monkeypatch, possible_dn, high_dn):
    """In correlated areas, as far as these vary; white noise that was detected keeps the interval of `cellwise`."""
    patches, estimator = stack(flat(2, 0.8), flat(10)), Adaptive()
    before, predict = estimator.estimate(patches), estimator.correlated.predict

    def blind(*arguments):
        """Nothing seen, and so much possible."""
        answer = predict(*arguments)
        nothing = np.zeros_like(answer.sigma_dn)
        return replace(answer, sigma_dn=nothing, reach=np.full_like(nothing, np.log1p(possible_dn) / REAL_CAMERAS))

    monkeypatch.setattr(estimator.correlated, "predict", blind)
    monkeypatch.setattr("pipeline.noise.adaptive.decided", lambda correlation, coded: np.zeros_like(coded))
    estimate = estimator.estimate(patches)
    assert estimate.sigma_dn[0] < 0.5 and estimate.high_dn[0] == pytest.approx(high_dn, rel=0.02)
    assert estimate.high_dn[1] == before.high_dn[1] < 11.5


def test_an_interval_holds_both_answers_where_they_differ(monkeypatch):
    """Where the two networks weigh alike, the interval of their mean is as wide as they are apart."""
    patches, estimator = stack(flat(10, 0.45)), Adaptive()
    answer = estimator.correlated.predict(patches[:, 0])
    white_dn = estimator.white.estimate(patches).sigma_dn
    level = np.log1p(white_dn) - OFFSET / SLOPE  # a weight of one half
    given = replace(answer, sigma_dn=np.expm1(level), reach=np.full(1, 0.05), correlation=np.full(1, 0.05))
    monkeypatch.setattr(estimator.correlated, "predict", lambda *_: given)
    estimate = estimator.estimate(patches)
    assert np.log1p(estimate.sigma_dn) == pytest.approx((level + np.log1p(white_dn)) / 2)
    assert estimate.low_dn <= white_dn and estimate.high_dn >= given.sigma_dn


def test_a_wider_interval_does_not_reach_below_no_noise():
    levels = Levels.zero(2, (1, 1))
    levels.sigma_dn[:], levels.low_dn[:], levels.high_dn[:] = (0.05, 5.0), (0.02, 4.5), (0.4, 5.5)
    wide = widened(levels, np.arange(2))
    assert wide.low_dn[0] == 0 and 4.0 < wide.low_dn[1] < 4.5
    assert (wide.high_dn > levels.high_dn).all()


def test_of_two_sure_answers_that_differ_the_interval_reaches_both():
    """Each is sure to 2 %; the one that is believed as much as the other may be right."""
    answer = ADAPTIVE.correlated.predict(stack(flat(9))[:, 0])
    answer = replace(answer, sigma_dn=np.array([12.0]), reach=np.array([0.02]), correlation=np.array([0.2]))
    white = replace(Levels.zero(1, (16, 16)), sigma_dn=np.array([6.0]), low_dn=np.array([5.9]), high_dn=np.array([6.1]))
    second = Second(np.array([0]), answer, codec_traces(answer.statistics, 128**2), np.array([0.5]), np.zeros(1))
    joint = joined(white, second)
    assert joint.sigma_dn == pytest.approx(np.sqrt(7 * 13) - 1)
    assert joint.low_dn < 6.0 and joint.high_dn > 12.0


def by_line(answer):
    """By how much an answer to noise as correlated as behind a camera is to move."""
    white = np.log((1 + answer.white_sigma_dn) / (1 + answer.sigma_dn))
    return np.clip(WHITE_PART[0] + WHITE_PART[1] * white, *MOST_MOVED)


def test_processed_noise_is_moved_by_its_white_part():
    patches = stack(flat(6, 0.9))
    alone, estimate = ADAPTIVE.correlated.predict(patches[:, 0]), ADAPTIVE.estimate(patches)
    assert alone.correlation[0] > 0.5
    assert np.log1p(estimate.sigma_dn) == pytest.approx(np.log1p(alone.sigma_dn) + by_line(alone))


@pytest.mark.parametrize(
    ("white_dn", "correlation", "least", "most"),
    [(4.0, 0.6, 8.9, 9.2), (0.5, 0.6, 7.4, 7.7), (4.0, 0.4, 8.0, 8.0), (0.5, 0.2, 8.0, 8.0)],
    ids=["much of it white", "hardly any white", "not so correlated", "as good as white"],
)
def test_noise_of_8_dn_counts_as_more_with_much_white_noise_in_it_and_as_less_with_hardly_any(
    white_dn, correlation, least, most
):
    answer = ADAPTIVE.correlated.predict(stack(flat(9))[:, 0])
    given = {"sigma_dn": 8.0, "white_sigma_dn": white_dn, "correlation": correlation, "reach": 0.1}
    answer = replace(answer, **{name: np.array([value]) for name, value in given.items()})
    second = Second(np.array([0]), answer, codec_traces(answer.statistics, 128**2), np.array([1.0]), np.zeros(1))
    joint = joined(Levels.zero(1, (16, 16)), second)
    assert least - 1e-9 <= joint.sigma_dn[0] <= most + 1e-9
    assert joint.low_dn[0] < joint.sigma_dn[0] < joint.high_dn[0]  # the interval moves along


@pytest.mark.parametrize(("demosaiced", "moved"), [(0.0, 1.0), (0.5, 0.5), (1.0, 0.0)])
def test_noise_that_was_surely_only_demosaiced_is_not_moved_as_processed_noise_is(demosaiced, moved):
    answer = ADAPTIVE.correlated.predict(stack(flat(9))[:, 0])
    given = {"sigma_dn": 8.0, "white_sigma_dn": 4.0, "correlation": 0.6, "reach": 0.1}
    answer = replace(answer, **{name: np.array([value]) for name, value in given.items()})
    traces = codec_traces(answer.statistics, 128**2)
    joint = joined(Levels.zero(1, (16, 16)), Second(np.array([0]), answer, traces, np.ones(1), np.array([demosaiced])))
    assert np.log1p(joint.sigma_dn) == pytest.approx(np.log(9) + moved * by_line(answer))


@pytest.mark.parametrize("weight", [0.5, 1.0])
def test_uneven_cells_have_the_noise_of_their_patch_as_their_root_mean_square(weight):
    answer = ADAPTIVE.correlated.predict(stack(flat(9))[:, 0])
    uneven = np.where(np.arange(16) < 8, 2.0, 10.0).astype(np.float32) * np.ones((1, 16, 1), np.float32)
    answer = replace(answer, cells_dn=uneven)
    white = replace(Levels.zero(1, (16, 16)), sigma_dn=np.array([6.0]))
    second = Second(np.array([0]), answer, codec_traces(answer.statistics, 128**2), np.array([weight]), np.zeros(1))
    joint = joined(white, second)
    assert np.sqrt((joint.cells_dn**2).mean()) == pytest.approx(joint.sigma_dn[0], rel=1e-5)
    assert joint.cells_dn[0, 0, -1] == pytest.approx(5 * joint.cells_dn[0, 0, 0])


def test_noise_that_may_be_none_moves_towards_zero_in_its_map_and_its_white_part_too(monkeypatch):
    """The interval of the second network reaches below zero; the answer so falls from 6 DN to 3."""
    patches, estimator = stack(flat(6, 0.9)), Adaptive(widest_reach=9.0)
    answer = estimator.correlated.predict(patches[:, 0])
    given = replace(answer, sigma_dn=np.array([6.0]), white_sigma_dn=np.array([5.4]))
    given = replace(given, reach=(2 * (np.log1p(6.0) + by_line(given)) - np.log1p(3.0)) / REAL_CAMERAS)
    monkeypatch.setattr(estimator.correlated, "predict", lambda *_: given)
    estimate, cells = estimator.estimate_cells(patches)
    assert estimate.sigma_dn == pytest.approx(3.0) and estimate.low_dn == 0
    assert estimate.white_sigma_dn <= estimate.sigma_dn
    assert np.sqrt((cells**2).mean()) == pytest.approx(3.0, rel=1e-3)


def test_noise_smoothed_along_rows_is_within_the_interval_though_neither_network_reads_it():
    field = stream(1, "band-limited").standard_normal((160, 160))
    smooth = cv2.GaussianBlur(field, (0, 0), sigmaX=1.5, sigmaY=1e-3)[16:-16, 16:-16]
    shown = np.rint(120 + 8 * smooth / smooth.std()).astype(np.float32)
    estimate = ADAPTIVE.estimate(stack(shown))
    assert not estimate.abstained[0]
    assert estimate.low_dn <= 8 <= estimate.high_dn
