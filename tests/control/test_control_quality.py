"""Measures of image quality that published controllers maximise, and their searches."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from control_makers import CAMERA

from pipeline import control
from pipeline.control.image.gradient import information, sobel_magnitude
from pipeline.control.image.image_quality import quality
from pipeline.control.observation import Observation
from pipeline.control.state import CameraState, DelayLine
from pipeline.control.temporal.nelder_mead import search
from pipeline.streams import stream


@pytest.mark.parametrize("sigma", [1.0, 2.0, 5.0, 10.0, 20.0])
def test_quality_noise_of_flat_frames(sigma):
    flat = 0.5 + sigma / 255 * stream(1, "flat", sigma).standard_normal((400, 500))
    assert quality(flat.astype(np.float32)).noise_dn == pytest.approx(
        np.hypot(sigma, 12**-0.5), abs=0.1 * max(1, sigma / 5)
    )


def test_quality_noise_at_five_dn_is_five():
    flat = 0.5 + 5 / 255 * stream(2, "flat").standard_normal((768, 896))
    assert quality(flat.astype(np.float32)).noise_dn == pytest.approx(5.0, abs=0.1)


def test_quality_gradient_is_the_mean_of_the_cells_over_their_scatter():
    """Of ten by ten cells, whose deviation is that of a sample."""
    image = np.rint(255 * stream(1, "cells").random((100, 120)) ** 4).astype(np.float32) / 255
    cells = information(sobel_magnitude(image)).reshape(10, 10, 10, 12).mean(axis=(1, 3))
    assert quality(image).gradient == pytest.approx(cells.mean() / cells.std(ddof=1), rel=1e-5)


@pytest.mark.parametrize("level", [0.0, 1.0])
def test_quality_of_black_and_white_frames_is_defined(level):
    result = quality(np.full((123, 207), level, np.float32))  # sides that ten does not divide
    assert np.isfinite(result).all() and result.gradient == 0.0 and result.noise_dn == pytest.approx(0.0, abs=4)


def test_quality_prefers_a_well_exposed_scene():
    y, x = np.mgrid[:200, :300]
    scene = (0.5 + 0.3 * np.sign(np.sin(x / 7.0) * np.sin(y / 9.0))).astype(np.float32)
    values = [quality(np.clip(scene * gain, 0, 1)).value for gain in (0.1, 1.0, 6.0)]
    assert values[1] > values[0] and values[1] > values[2]


def minimise(function, simplex, **options):
    steps = search(np.asarray(simplex), **options)
    point, used = next(steps), 0
    while True:
        used += 1
        try:
            point = steps.send(float(function(point)))
        except StopIteration as end:
            return *end.value, used


def test_simplex_search_finds_a_minimum_and_keeps_its_budget():
    best, value, used = minimise(
        lambda p: (p[0] - 0.3) ** 2 + 2 * (p[1] - 0.6) ** 2,
        [[0.8, 0.1], [0.9, 0.1], [0.8, 0.3]],
        evaluations=80,
        tolerance=1e-9,
    )
    np.testing.assert_allclose(best, [0.3, 0.6], atol=5e-3)
    assert value < 1e-4 and used <= 80
    _, _, few = minimise(
        lambda p: float(np.sin(37 * p[0]) + p[1]), [[0.5, 0.5], [0.6, 0.5], [0.5, 0.6]], evaluations=50
    )
    assert few <= 50


def test_shin_simplex_at_base_gain_is_not_degenerate_and_probes_are_counted():
    policy = control.create("shin2019", camera=CAMERA, probes=12)
    state, probes = CameraState.of(2, 100), []
    for _ in range(30):
        image = np.clip(0.02 + 0.1 * state.exposure_ms * state.gain / 10 * np.linspace(0, 1, 80)[None], 0, 1)
        seen = Observation((image * np.ones((60, 1))).astype(np.float32), float(image.mean()), 0.0)
        decision = policy.decide(seen, state)
        if decision.action.value == "probe":
            probes.append(decision.state)
        state = decision.state
    first = probes[:3]
    assert len({p.exposure_s for p in first}) >= 2 and len({p.gain for p in first}) >= 2
    assert 3 <= len(probes) <= 12 * 3


def test_shin_waits_for_a_probe_that_is_on_its_way():
    policy = control.create("shin2019", camera=CAMERA)
    state = CameraState.of(2, 100)
    seen = Observation(np.full((60, 60), 0.2, np.float32), 0.2, 0.0)
    policy.decide(seen, state)
    probe = policy.decide(seen, state).state
    assert probe != state
    assert policy.decide(seen, state).state == probe


@pytest.mark.parametrize(("delay", "rounding_s"), [(0, 0.0), (1, 0.0), (2, 0.0), (0, 1e-6), (2, 2e-5)])
def test_shin_settles_on_the_best_settings_whatever_the_delay_and_the_drivers_rounding(delay, rounding_s):
    limits = replace(CAMERA.limits, delay_frames=delay)
    policy = control.create("shin2019", camera=replace(CAMERA, limits=limits), probes=9)
    y, x = np.mgrid[:90, :120]
    scene = 0.5 + 0.3 * np.sin(x / 7.0) * np.sin(y / 9.0)

    def seen(state):
        grain = 0.01 * np.sqrt(state.gain) * stream(3, "grain").standard_normal(scene.shape)
        image = np.clip((scene * state.total_exposure_s / 0.008).clip(0, 1) ** (1 / 2.2) + grain, 0, 1)
        return Observation(image.astype(np.float32), float(image.mean()), 0.0)

    state = limits.nearest(0.004, 2.0)
    line, decisions, taken = DelayLine.filled(state, delay), [], []
    for _ in range(100):
        decisions.append(policy.decide(seen(state), state))
        taken.append(state)
        written = decisions[-1].state
        if rounding_s:
            written = CameraState(round(written.exposure_s / rounding_s) * rounding_s, written.gain)
        state = line.next(written)
    ended = next(number for number, one in enumerate(decisions) if one.reason.startswith("search ended"))
    assert [one.action.value for one in decisions[-40:]] == ["hold"] * 40
    assert {one.state for one in decisions[ended:]} == {decisions[ended].state}
    assert len(set(taken[-40:])) == 1


@pytest.mark.parametrize(("level", "brighter"), [(0.2, True), (0.8, False)])
def test_shin_begins_towards_the_middle_of_the_range(level, brighter):
    """Of a dark frame with longer times and higher gains, of a bright one with shorter and lower."""
    policy, state = control.create("shin2019", camera=CAMERA), CameraState.of(4, 400)
    seen, asked = Observation(np.full((60, 60), level, np.float32), level, 0.0), []
    for _ in range(3):
        asked.append(policy.decide(seen, asked[-1] if asked else state).state)
    assert asked[0].exposure_s == pytest.approx(state.exposure_s) and asked[0].gain == pytest.approx(state.gain)
    longer, higher = np.log2([asked[1].exposure_s / state.exposure_s, asked[2].gain / state.gain])
    assert (longer > 0.3 and higher > 0.3) if brighter else (longer < -0.3 and higher < -0.3)


def test_shin_searches_anew_only_where_a_change_stays():
    """A frame or two of a passing lorry do not begin a search, three in a row do."""
    policy, state = control.create("shin2019", camera=CAMERA, probes=4), CameraState.of(4, 200)
    texture = stream(1, "lorry").uniform(-0.1, 0.1, (60, 60))

    def decide(level):
        image = np.clip(level + texture, 0, 1).astype(np.float32)
        return policy.decide(Observation(image, float(image.mean()), 0.0), state)

    decision = decide(0.5)
    while not decision.reason.startswith("search ended"):
        state = decision.state
        decision = decide(0.5)
    state = decision.state
    assert [decide(level).action.value for level in (0.5, 0.2, 0.2, 0.5, 0.2, 0.2)] == ["hold"] * 6
    assert decide(0.2).reason == "new search"


def test_shim_fixed_point_direction_and_step_bounds():
    policy = control.create("shim", camera=CAMERA)
    assert policy.factor(1.0) == 1.0 and policy.factor(0.1) == pytest.approx(1.155, abs=0.005)
    assert policy.factor(1.9) == pytest.approx(0.923, abs=0.003)
    y, x = np.mgrid[:120, :160]
    texture = 0.5 + 0.5 * np.sin(x / 4.0) * np.cos(y / 5.0)
    for brightness, sign in ((0.15, 1), (1.0, -1)):
        image = np.clip(texture * brightness + (0.62 if sign < 0 else 0.0), 0, 1).astype(np.float32)
        factor = policy.factor(policy.best_gamma(Observation(image, float(image.mean()), 0.0)))
        assert np.sign(factor - 1) == sign
