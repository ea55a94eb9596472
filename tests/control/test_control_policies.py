"""Policies: convergence for every delay, limits, defined actions on bad frames, what each one reacts to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from control_makers import (
    CAMERA,
    Scene,
    darker_performance,
    performance,
    performance_of_three_levels,
    scalar,
    seen_mtf,
)
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pipeline import control
from pipeline.control.decision import Action
from pipeline.control.observation import Observation
from pipeline.control.policy import ControlledCamera
from pipeline.control.precision.prediction import predict
from pipeline.control.state import CameraState, DelayLine, Limits
from pipeline.errors import InputError

BLIND = ("mean_intensity", "prosilica")
AWARE = ("iopc_target", "iopc_optimal", "iopc_continuous")
EVERY = ("fixed", *BLIND, "shim", "shin2019", *AWARE)
SURFACE = performance()


def make(name, **options):
    return control.create(name, camera=CAMERA, performance=SURFACE, **options)


def drive(policy, scene, start, frames=25, delay=0, silent=()):
    """States of each frame, and decisions."""
    state, line = start, DelayLine.filled(start, delay)
    states, decisions = [], []
    for step in range(frames):
        decision = policy.decide(scene.observe(state, step in silent), state)
        states.append(state)
        decisions.append(decision)
        state = line.next(decision.state)
    return states, decisions


@pytest.mark.parametrize("name", [*BLIND, *AWARE])
@pytest.mark.parametrize("delay", [0, 1, 2, 3])
@pytest.mark.parametrize("start_ms", [1.0, 30.0])
def test_policies_settle_on_a_constant_scene_and_do_not_oscillate(name, delay, start_ms):
    scene = Scene(light=0.5, speed_px_s=300.0)
    states, _ = drive(make(name), scene, CameraState.of(start_ms, 100), frames=60 * (delay + 1), delay=delay)
    totals = np.log2([state.total_exposure_s for state in states])
    times = np.log2([state.exposure_s for state in states])
    level = scene.truth(states[-1]).mean_level
    assert level == pytest.approx(0.5, rel=0.12)
    tail = slice(-6 * (delay + 1), None)
    assert np.ptp(totals[tail]) < 0.05 and np.ptp(times[tail]) < 0.35


@pytest.mark.parametrize("name", ["iopc_optimal", "iopc_continuous"])
@pytest.mark.parametrize("light", [0.00929, 0.02, 0.15, 1.1])
def test_policies_settle_in_steady_light_on_a_camera_with_steps(name, light):
    limits = Limits(exposure_steps_per_stop=3, gain_step_db=1.0)
    policy = control.create(name, camera=ControlledCamera(limits, CAMERA.formation), performance=SURFACE)
    states, decisions = drive(policy, Scene(light, speed_px_s=400.0), limits.nearest(8e-3, 1.0), frames=50)
    assert len(set(states[-15:])) == 1
    assert {decision.action for decision in decisions[-15:]} <= {Action.HOLD, Action.REFUSED}


@given(
    name=st.sampled_from(EVERY),
    light=st.floats(1e-4, 200.0),
    speed=st.floats(0.0, 4_000.0),
    time_ms=st.floats(0.05, 33.0),
    iso=st.floats(100, 3_200),
    silent=st.booleans(),
)
@settings(max_examples=120, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_policies_never_leave_the_limits(name, light, speed, time_ms, iso, silent):
    limits = CAMERA.limits
    policy, scene = make(name), Scene(light, speed)
    state = limits.nearest(time_ms / 1e3, iso / 100)
    for _ in range(4):
        state = policy.decide(scene.observe(state, silent), state).state
        assert limits.exposure_min_s * (1 - 1e-9) <= state.exposure_s <= limits.exposure_max_s * (1 + 1e-9)
        assert limits.gain_min * (1 - 1e-9) <= state.gain <= limits.gain_max * (1 + 1e-9)


@pytest.mark.parametrize("name", EVERY)
@pytest.mark.parametrize("level", [0.0, 1.0, 0.48])
def test_policies_answer_black_white_and_featureless_frames(name, level):
    """The estimator is silent in all of them; brightness still moves the right way."""
    image = np.full((64, 64), level, np.float32)
    seen = Observation(image, level, float(level >= 0.99), reason="flat")
    state = CameraState.of(4, 400)
    policy = make(name)
    decisions = [policy.decide(seen, state)]
    for _ in range(30):
        decisions.append(policy.decide(seen, decisions[-1].state))
    for decision in decisions:
        assert np.isfinite([decision.state.exposure_s, decision.state.gain]).all() and decision.reason
    if name in AWARE:
        assert {decision.action for decision in decisions} == {Action.ABSTAINED}
    if name not in ("fixed", "shin2019"):
        brighter = decisions[-1].state.total_exposure_s / state.total_exposure_s
        assert (brighter > 2) if level == 0.0 else (brighter < 0.5) if level == 1.0 else (0.9 < brighter < 1.1)


@pytest.mark.parametrize("name", AWARE)
def test_policies_hold_while_the_estimator_is_silent_and_go_on_after(name):
    scene, policy = Scene(light=0.5, speed_px_s=900.0), make(name)
    states, decisions = drive(policy, scene, CameraState.of(8, 200), frames=20, silent=range(8, 13))
    assert all(decision.action is Action.ABSTAINED for decision in decisions[8:13])
    assert len(set(states[9:14])) == 1
    assert decisions[14].action is not Action.ABSTAINED


def test_policies_only_task_aware_ones_react_to_speed():
    """Light is constant, the image moves faster: time goes down where the surface says so, nowhere else."""
    for name in (*BLIND, *AWARE):
        times = []
        for speed in (50.0, 2_000.0):
            states, _ = drive(make(name), Scene(0.5, speed), CameraState.of(8, 200), frames=30)
            times.append(states[-1].exposure_s)
        assert (times[1] < 0.7 * times[0]) if name in AWARE else times[1] == pytest.approx(times[0]), name


@pytest.mark.parametrize("name", ["iopc_optimal", "iopc_continuous"])
@pytest.mark.parametrize(("light", "speed"), [(1.0, 300.0), (0.25, 760.0), (0.25, 150.0), (0.1, 1_500.0)])
def test_policies_find_the_best_split_of_the_surface(name, light, speed):
    scene = Scene(light, speed)
    states, _ = drive(make(name), scene, CameraState.of(8, 100), frames=30)
    here = scene.truth(states[-1])
    result = float(SURFACE.expected(here.sigma_dn, here.motion_px).ap_percent)
    total, limits = states[-1].total_exposure_s, CAMERA.limits
    others = [scene.truth(limits.at_time(total, time)) for time in np.geomspace(50e-6, 33e-3, 60)]
    best = np.nanmax([float(SURFACE.expected(one.sigma_dn, one.motion_px).ap_percent) for one in others])
    assert result > best - 3.2


def test_policies_after_a_step_of_light_the_continuous_one_settles_within_five_frames():
    for first, second in ((1.0, 1 / 16), (1 / 16, 1.0)):
        policy, scene = make("iopc_continuous"), Scene(first, 300.0)
        states, _ = drive(policy, scene, CameraState.of(4, 200), frames=20)
        scene = replace_light(scene, second)
        after, _ = drive(policy, scene, states[-1], frames=15)
        stops = np.log2([state.total_exposure_s for state in after])
        assert np.abs(stops[5:] - stops[-1]).max() < 0.25
        assert scene.truth(after[5]).mean_level == pytest.approx(0.5, rel=0.15)


def replace_light(scene, light):
    return Scene(light, scene.speed_px_s, scene.camera, scene.size_px)


def test_policies_cap_rate_limit_and_lamp_periods():
    scene = Scene(light=0.5, speed_px_s=1_000.0)
    states, _ = drive(make("iopc_continuous", max_motion_px=4.0), scene, CameraState.of(4, 200))
    assert all(state.exposure_s * 1_000 <= 4.0 * 1.001 for state in states[3:])
    limited = make("iopc_continuous", stops_per_frame=0.5, max_motion_px=100.0)
    states, _ = drive(limited, Scene(0.5, 3_000.0), CameraState.of(13.9, 100))
    stops = np.abs(np.diff(np.log2([state.exposure_s for state in states])))
    assert stops.max() <= 0.5 + 1e-6 and stops.sum() > 1.0
    states, _ = drive(make("iopc_continuous", lamp_hz=100.0), Scene(0.2, 100.0), CameraState.of(4, 200))
    periods = states[-1].exposure_s * 100
    assert round(periods) >= 1 and abs(periods - round(periods)) < 0.07


def known_speed(speed_px_s, **options):
    """The continuous policy with the speed from odometry."""
    policy = make("iopc_continuous", **options)
    policy.known_speed_px_s = speed_px_s
    return policy


@pytest.mark.parametrize("stops_per_frame", [0.25, 2.0])
@pytest.mark.parametrize("steps_per_stop", [0, 6])
def test_policies_the_cap_comes_before_the_rate_limit(stops_per_frame, steps_per_stop):
    """From 14 px of motion, the very next exposure is within the cap of 4 px, as near to it as candidates are."""
    policy = known_speed(1_000.0, max_motion_px=4.0, stops_per_frame=stops_per_frame)
    policy.limits = replace(policy.limits, exposure_steps_per_stop=steps_per_stop)
    scene = Scene(light=0.5, speed_px_s=1_000.0)
    states, decisions = drive(policy, scene, CameraState.of(13.9, 100))
    assert all(scene.truth(state).motion_px <= 4.0 * (1 + 1e-9) for state in states[1:])
    assert scene.truth(states[1]).motion_px > 4.0 * 2.0**-0.5  # no farther than it has to be
    assert all(scene.truth(state).mean_level == pytest.approx(0.5, rel=0.12) for state in states[1:])
    assert all("motion" in decision.reason for decision in decisions)


def test_policies_brightness_comes_before_the_cap():
    """In the dark, with the highest gain: the shortest exposure that keeps brightness, though its motion is longer."""
    scene, policy = Scene(light=0.02, speed_px_s=1_000.0), known_speed(1_000.0, max_motion_px=4.0)
    states, _ = drive(policy, scene, CameraState.of(20, 1_600))
    assert scene.truth(states[-1]).motion_px > 8.0
    assert states[-1].gain == pytest.approx(CAMERA.limits.gain_max, rel=0.01)
    assert scene.truth(states[-1]).mean_level == pytest.approx(0.5, rel=0.12)


@pytest.mark.parametrize(("start_ms", "iso", "speed"), [(10.0, 1_600, 0.0), (30.0, 540, 700.0)])
def test_policies_lamp_periods_come_before_the_rate_limit(start_ms, iso, speed):
    """From one or three whole periods to others: half a stop would end between them."""
    policy = known_speed(speed, lamp_hz=100.0, stops_per_frame=0.5)
    states, _ = drive(policy, Scene(light=0.05, speed_px_s=speed), CameraState.of(start_ms, iso))
    periods = np.array([state.exposure_s * 100 for state in states])
    assert (np.abs(periods - np.round(periods)) < 0.06).all() and (np.round(periods) >= 1).all()
    assert abs(np.log2(periods[-1] / periods[0])) > 0.5


def test_policies_the_rate_limit_holds_where_a_lamp_period_is_within_it():
    policy = known_speed(0.0, lamp_hz=100.0, stops_per_frame=1.5)
    states, _ = drive(policy, Scene(light=0.05), CameraState.of(4.0, 3_200))
    stops = np.diff(np.log2([state.exposure_s for state in states]))
    assert states[1].exposure_s * 100 == pytest.approx(1.0, abs=0.06)
    assert states[-1].exposure_s * 100 > 1.9 and stops.max() <= 1.5 + 1e-6


def test_policies_less_than_a_lamp_period_is_no_whole_one():
    """Motion wants 8 ms or less, the brightness allows 10 ms: flicker is averaged over the whole period."""
    policy = known_speed(1_000.0, lamp_hz=100.0)
    states, _ = drive(policy, Scene(light=0.2, speed_px_s=1_000.0), CameraState.of(8.0, 500))
    periods = np.array([state.exposure_s * 100 for state in states[1:]])
    assert (np.abs(periods - 1.0) < 0.06).all()


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("iopc_target", {}),
        ("iopc_optimal", {}),
        ("iopc_continuous", {}),
        ("iopc_continuous", {"stops_per_frame": 0.5, "max_motion_px": 100.0}),
        ("iopc_continuous", {"stops_per_frame": 0.5, "max_motion_px": 6.0}),
    ],
)
def test_policies_the_expected_precision_is_that_of_the_settings_decided(name, options):
    """The surface at the true condition with these settings; also on the way, while the rate limit is active."""
    scene, policy = Scene(light=0.5, speed_px_s=1_400.0), make(name, **options)
    policy.known_speed_px_s = scene.speed_px_s
    _, decisions = drive(policy, scene, CameraState.of(13.9, 100), frames=12)
    expected = [decision.ap_percent for decision in decisions]
    conditions = [scene.truth(decision.state) for decision in decisions]
    truth = [float(SURFACE.expected(each.sigma_dn, each.motion_px).ap_percent) for each in conditions]
    np.testing.assert_allclose(expected, truth, atol=2.0)


def test_policies_a_limited_step_through_what_was_not_measured_is_refused():
    policy = known_speed(3_000.0, stops_per_frame=0.25, max_motion_px=100.0)
    scene, state = Scene(light=0.5, speed_px_s=3_000.0), CameraState.of(13.9, 100)
    first = policy.decide(scene.observe(state), state)
    assert scene.truth(first.state).motion_px > SURFACE.longest_px
    assert first.action is Action.REFUSED and np.isnan(first.ap_percent) and first.state.exposure_s < state.exposure_s
    _, decisions = drive(policy, scene, first.state, frames=12)
    assert decisions[-1].action is Action.HOLD and np.isfinite(decisions[-1].ap_percent)


@pytest.mark.parametrize("name", ["iopc_optimal", "iopc_continuous", "oracle"])
def test_policies_frames_are_darker_where_the_detector_bears_that_better(name):
    for bonus, level in ((15.0, 0.25), (-30.0, 0.5)):
        policy = control.create(name, camera=CAMERA, performance=darker_performance(bonus))
        scene = Scene(light=0.1, speed_px_s=500.0)
        states, _ = drive(policy, scene, CameraState.of(8, 400), frames=30)
        assert scene.truth(states[-1]).mean_level == pytest.approx(level, rel=0.22)
        assert np.ptp(np.log2([state.total_exposure_s for state in states[-10:]])) < 0.1


@pytest.mark.parametrize("name", ["iopc_optimal", "iopc_continuous"])
def test_policies_a_chosen_dark_frame_is_kept_while_the_estimator_is_silent(name):
    policy = control.create(name, camera=CAMERA, performance=darker_performance(15.0))
    scene = Scene(light=0.1, speed_px_s=500.0)
    states, decisions = drive(policy, scene, CameraState.of(8, 400), frames=24, silent=range(15, 20))
    assert all(decision.action is Action.ABSTAINED for decision in decisions[15:20])
    assert len(set(states[15:21])) == 1


def test_policies_a_clipped_frame_teaches_nothing_but_its_brightness():
    """Most of the frame is white: noise and motion estimated on it are not used, exposure goes down."""
    policy, scene = make("iopc_continuous"), Scene(light=0.5, speed_px_s=700.0)
    drive(policy, scene, CameraState.of(8, 200), frames=6)
    before = policy.speed_px_s
    state = CameraState.of(8, 3200)
    seen = Observation(np.ones((16, 16), np.float32), 0.98, 0.9, scalar(0.2), seen_mtf(0.0))
    decision = policy.decide(seen, state)
    assert policy.speed_px_s == before and decision.state.total_exposure_s < 0.3 * state.total_exposure_s


@pytest.mark.parametrize("white", [0.3, 0.45, 0.54])
@pytest.mark.parametrize("name", ["iopc_target", "iopc_optimal", "iopc_continuous"])
def test_policies_a_clipped_frame_is_not_kept_for_its_mean_while_nothing_is_known(name, white):
    """The next frame would be the same: bright upper half, dark road, and no estimate for ever."""
    state = CameraState.of(8, 400)
    seen = Observation(np.ones((16, 16), np.float32), max(0.5, white), white, scalar(3.0), seen_mtf(4.0))
    for surface in (SURFACE, darker_performance(15.0)):
        policy = control.create(name, camera=CAMERA, performance=surface)
        decision = policy.decide(seen, state)
        assert decision.action is Action.ABSTAINED and decision.state.exposure_s <= state.exposure_s
        assert decision.state.total_exposure_s <= 0.51 * state.total_exposure_s


@pytest.mark.parametrize("mean", [0.0, 0.005, 0.02, 0.05, 0.5])
def test_policies_dark_frames_are_predicted_from_the_level_they_have(mean):
    state = CameraState.of(8, 400)
    at = predict(CAMERA.formation, 2.0, 8.0, mean**CAMERA.formation.gamma, state, [state.traded(4.0), state])
    assert at.level == pytest.approx(max(mean, 1e-3)) and np.isfinite(at.sigma_dn).all()
    brighter = predict(
        CAMERA.formation, 2.0, 8.0, mean**CAMERA.formation.gamma, state, [CameraState(16e-3, state.gain)]
    )
    assert brighter.level == pytest.approx(min(max(mean, 1e-3) * 2 ** (1 / CAMERA.formation.gamma), 1.0))


def test_policies_refused_queries_lead_towards_the_measured_region():
    seen = Observation(np.full((8, 8), 0.5, np.float32), 0.5, 0.0, scalar(3.0), seen_mtf(40.0))
    state = CameraState.of(33, 100)
    for name in ("iopc_optimal", "iopc_continuous"):
        assert not np.isfinite(SURFACE.expected(3.0, 40.0).ap_percent)
        decision = make(name).decide(seen, state)
        assert decision.state.exposure_s < 0.9 * state.exposure_s and decision.action is Action.MOVE
        slow = ControlledCamera(Limits(exposure_min_s=0.03))
        decision = control.create(name, camera=slow, performance=SURFACE).decide(seen, state)
        assert decision.action is Action.REFUSED and decision.state.exposure_s == pytest.approx(0.03)


def test_policies_the_printed_sign_is_wrong_and_ours_moves_noise_against_blur():
    policy, state = make("iopc_optimal"), CameraState.of(8, 400)
    seen = Scene(0.25, 700.0).observe(state)
    policy.decide(seen, state)
    there = policy.candidates(policy.frame(seen, state, state.total_exposure_s))
    assert (np.diff(there.motion_px) >= 0).all() and (np.diff(there.sigma_dn) <= 1e-9).all()


def test_policies_linear_noise_gain_is_the_papers_alpha_sigma():
    from pipeline.camera.exposure import Camera

    state = CameraState.of(8, 400)
    for kind, low, high in (("linear", 3.97, 4.03), ("physical", 2.0, 3.9)):
        at = predict(Camera(noise_gain=kind), 2.0, 8.0, 0.4, state, [state.traded(4.0)])
        assert low <= at.sigma_dn[0] / 2.0 <= high and at.motion_px[0] == pytest.approx(2.0)


def test_policies_oracle_sees_the_truth_and_nobody_else_may():
    scene, policy = Scene(0.25, 900.0), make("oracle")
    decision = policy.decide(scene.observe(CameraState.of(8, 100)), CameraState.of(8, 100))
    assert scene.truth(decision.state).mean_level == pytest.approx(0.5, rel=0.02)
    with pytest.raises(InputError, match="truth"):
        policy.decide(Observation(np.zeros((4, 4), np.float32), 0.0, 0.0), CameraState.of(8, 100))
    for name in EVERY:
        assert not make(name).sees_truth
    with pytest.raises(InputError, match="simulated"):
        control.Controller(policy)


def test_policies_wrong_names_and_options_are_named():
    with pytest.raises(InputError, match="did you mean 'iopc_optimal'"):
        control.create("iopc_optimum")
    with pytest.raises(InputError, match="surface"):
        control.create("iopc_optimal")
    with pytest.raises(InputError, match="targett"):
        control.create("mean_intensity", targett=1)
    with pytest.raises(InputError, match="target_px"):
        make("iopc_target", target_px=0.0)


def test_policies_a_third_partys_policy_is_a_registered_class(monkeypatch):
    """One file and five lines of configuration, as the README shows."""
    from importlib.metadata import EntryPoint

    import pipeline.registry as registry

    point = EntryPoint("half_speed", "control_own_policy:HalfSpeed", "pipeline.control")
    monkeypatch.setattr(registry, "entry_points", lambda group: [point] if group == "pipeline.control" else [])
    policy = control.create("half_speed", camera=CAMERA, factor=0.5)
    state = CameraState.of(8, 100)
    decision = control.Controller(policy).step(np.full((32, 32), 0.5, np.float32), state)
    assert decision.state.exposure_ms == pytest.approx(4.0) and decision.state.iso == pytest.approx(200.0)
    assert replace(CAMERA, limits=CAMERA.limits) == CAMERA


def test_policies_a_frame_from_before_the_settings_written_does_not_move_them_again():
    """One frame of delay: the second dark frame was taken before the first decision took effect."""
    late = replace(CAMERA, limits=replace(CAMERA.limits, delay_frames=1))
    policy, state = control.create("iopc_optimal", camera=late, performance=SURFACE), CameraState.of(4, 100)

    def seen(level):
        return Observation(np.full((8, 8), level, np.float32), level, 0.0, scalar(2.0), seen_mtf(1.0))

    first, second = (policy.decide(seen(level), state).state for level in (0.27, 0.275))
    assert first.total_exposure_s > 3 * state.total_exposure_s
    assert second.total_exposure_s == pytest.approx(first.total_exposure_s, rel=1e-12)


@pytest.mark.parametrize("delay", [0, 1, 2])
def test_policies_the_margin_grows_with_the_frames_that_settings_take(delay):
    late = replace(CAMERA, limits=replace(CAMERA.limits, delay_frames=delay))
    assert control.create("iopc_optimal", camera=late, performance=SURFACE, margin=0.2).margin == pytest.approx(
        0.2 * (1 + delay)
    )


def test_policies_where_no_lamp_period_fits_shorter_exposures_are_free():
    """At most 8 ms under a lamp of 100 Hz: none averages it, and a still scene keeps long exposures."""
    short = replace(CAMERA, limits=replace(CAMERA.limits, exposure_max_s=0.008))
    policy = control.create("iopc_continuous", camera=short, performance=SURFACE, lamp_hz=100.0)
    states, _ = drive(policy, Scene(light=0.2, speed_px_s=50.0), CameraState.of(4, 800), frames=12)
    assert states[-1].exposure_ms > 4.0


def test_policies_the_cap_holds_for_the_highest_speed_that_is_likely():
    """After one frame the speed is known to a fifth: the motion may be longer than expected, but not than the cap."""
    policy, state = make("iopc_continuous", max_motion_px=3.0), CameraState.of(8, 200)
    policy.decide(Scene(0.5, 1_000.0).observe(state), state)
    decision = policy.decide(Scene(0.5, 1_000.0).observe(state), state)
    assert policy.speed_high_px_s > 1.1 * policy.speed_px_s
    assert policy.speed_high_px_s * decision.state.exposure_s <= 3.0 * (1 + 1e-6)


@pytest.mark.parametrize("name", ["iopc_optimal", "iopc_continuous"])
def test_policies_where_all_is_refused_do_not_stay_dark_and_noisy(name):
    """Too little light for the noise measured: standing, nothing is to be said against the longest exposure."""
    limits = Limits(50e-6, 33e-3, 1, 32, 6, 1.0)
    for light, speed_px_s in ((1 / 256, 0.0), (1 / 1024, 300.0)):
        scene = Scene(light, speed_px_s)
        for start in (CameraState.of(0.5, 100), CameraState.of(33, 3200), CameraState.of(4, 800)):
            camera = ControlledCamera(limits, CAMERA.formation)
            policy = control.create(name, camera=camera, performance=performance_of_three_levels())
            states, _ = drive(policy, scene, start, frames=30)
            assert states[-1].exposure_s > 0.02 and scene.truth(states[-1]).mean_level > 0.14, (start, states[-1])


@pytest.mark.parametrize("name", AWARE)
@pytest.mark.parametrize("speed_px_s", [2_000.0, 0.0])
def test_policies_a_known_speed_counts_in_either_direction(name, speed_px_s):
    scene, chosen = Scene(light=0.25, speed_px_s=speed_px_s), []
    for known in (speed_px_s, -speed_px_s):
        policy = make(name)
        policy.known_speed_px_s = known
        assert policy.speed_px_s == policy.speed_high_px_s == speed_px_s
        states, _ = drive(policy, scene, CameraState.of(8.0, 100), frames=12)
        chosen.append(states)
    assert chosen[0] == chosen[1]


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf"), "fast"])
def test_policies_a_known_speed_that_is_no_finite_number_is_refused(value):
    policy = make("iopc_continuous")
    policy.known_speed_px_s = 300.0
    with pytest.raises(InputError, match="known_speed_px_s is .*finite number of px/s, or None"):
        policy.known_speed_px_s = value
    assert policy.known_speed_px_s == 300.0
    policy.known_speed_px_s = None
    assert np.isnan(policy.speed_px_s)
