"""The closed loop on small made-up views: common random numbers, resumption, faults, delay, scores."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from control_makers import CAMERA, judged_with, make_views, performance, seen_mtf

from pipeline.camera.exposure import Camera
from pipeline.control.decision import Action, Decision
from pipeline.control.motion import motion_length
from pipeline.control.observation import Estimate
from pipeline.control.policy import Policy
from pipeline.control.simulation import evaluation
from pipeline.control.simulation.loop import Rig, SimulatedScene, _misjudged, make_policy, run
from pipeline.control.simulation.scenario import EstimatorFault, Flicker, Scenario
from pipeline.control.simulation.scoring import Score
from pipeline.control.simulation.views import View, folds, views, with_sun
from pipeline.control.state import CameraState
from pipeline.detection.base import Detections
from pipeline.errors import InputError


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    """Two viewpoints of two moments each: textured squares, one box of each class."""
    return views(make_views(tmp_path_factory.mktemp("sim")))


def scenario(**changes):
    start = {"name": "test", "steps": 3, "light": ((1.0, 1.0), (2.0, 0.25)), "speed_px_s": ((0.0, 500.0),)}
    return Scenario(**{**start, "start": CameraState.of(4, 100), **changes})


def rig(cache=None):
    return Rig(Camera(), CAMERA, "compact", "{}", seed=1, cache=cache)


def trace(records):
    return [
        (r.state, r.decision.state, r.decision.action, [d["score"].tobytes() for d in r.detections]) for r in records
    ]


def test_loop_of_equal_policies_is_the_same_and_a_killed_run_goes_on(seen, tmp_path):
    drives = [
        trace(run(make_policy("iopc_continuous", {}, CAMERA, performance()), rig(cache), scenario(), seen))
        for cache in (None, tmp_path / "kept", tmp_path / "kept")
    ]
    assert drives[0] == drives[1] == drives[2]
    files = sorted((tmp_path / "kept").rglob("*.npz"))
    assert files
    files[0].write_bytes(b"broken")
    files[-1].unlink()
    again = run(make_policy("iopc_continuous", {}, CAMERA, performance()), rig(tmp_path / "kept"), scenario(), seen)
    assert trace(again) == drives[0]


def test_loop_policies_share_their_random_numbers(seen):
    """At equal settings two policies see the same frames."""
    one, other = (
        run(make_policy(kind, options, CAMERA, performance()), rig(), scenario(steps=2), seen, pictures=(0,))
        for kind, options in (("fixed", {"exposure_ms": 4.0, "iso": 100.0}), ("mean_intensity", {}))
    )
    np.testing.assert_array_equal(one[0].picture, other[0].picture)
    assert trace(one)[0][3] == trace(other)[0][3]


def test_loop_delay_and_a_silent_estimator(seen):
    late = run(make_policy("mean_intensity", {}, CAMERA, None), rig(), scenario(steps=4, delay_frames=2), seen[:2])
    assert late[0].state == late[1].state == late[2].state != late[3].state
    silent = run(
        make_policy("iopc_optimal", {}, CAMERA, performance()),
        rig(),
        scenario(steps=2, fault=EstimatorFault(silent=(0, 5))),
        seen[:2],
    )
    assert {record.decision.action for record in silent} == {Action.ABSTAINED}
    assert all("silent" in record.decision.reason for record in silent)


class _Blind:
    """A detector that has failed: it finds nothing."""

    def detect(self, images):
        from pipeline.detection.base import Detections

        return [Detections.of(np.zeros((0, 4)), np.zeros(0), np.zeros(0, dtype=str)) for _ in images]


@pytest.mark.parametrize("name", ["mean_intensity", "iopc_optimal", "iopc_continuous", "shin2019"])
def test_loop_a_failed_detector_leaves_the_state_defined(seen, monkeypatch, name):
    """Policies do not depend on detections: the same settings follow, and average precision is 0, not missing."""
    drive, criteria = scenario(), judged_with(5)

    def states():
        return run(make_policy(name, {}, CAMERA, performance()), rig(), drive, seen)

    with_detections = states()
    monkeypatch.setattr("pipeline.control.simulation.loop.opened", lambda kind, options: _Blind())
    without = states()
    assert [record.decision.state for record in without] == [record.decision.state for record in with_detections]
    table = evaluation.steps_table(drive, name, 0, without, criteria, performance().reference, 1)
    assert (table["ap_percent"] == 0.0).all()


def test_loop_refuses_a_detection_that_is_none(seen, monkeypatch):
    wrong = Detections(np.ones((1, 4)), np.array([np.nan]), np.array(["car"]))
    detector = SimpleNamespace(detect=lambda images: [wrong])
    monkeypatch.setattr("pipeline.control.simulation.loop.opened", lambda kind, options: detector)
    with pytest.raises(InputError, match="detector 'compact': score of detection 0 is nan, expected 0 to 1"):
        run(make_policy("mean_intensity", {}, CAMERA, performance()), rig(), scenario(), seen)


def test_loop_frames_of_a_search_are_scored_like_all_others(seen, monkeypatch):
    """What Shin's simplex tries is what the robot sees."""
    monkeypatch.setattr("pipeline.control.simulation.loop.opened", lambda kind, options: _Blind())
    drive, criteria = scenario(steps=5), judged_with(5)
    records = run(make_policy("shin2019", {"probes": 20}, CAMERA, None), rig(), drive, seen)
    table = evaluation.steps_table(drive, "shin2019", 0, records, criteria, performance().reference, 1)
    summary, _ = evaluation.summary(drive, {"shin2019": table}, {"shin2019": records}, criteria, 1)
    assert (table["action"] == Action.PROBE).sum() >= 4 and len(table) == 5
    assert summary.loc[0, "frames"] == 5 * 2 and summary.loc[0, "objects"] == 5 * 2 * 2


def test_loop_policies_with_the_same_settings_form_a_leading_frame_once(seen, monkeypatch):
    """The picture is kept for the next policy, and holds the very values that the camera gave."""
    formed, drive, state = [], scenario(), CameraState.of(3.7, 130)
    whole = Camera.expose

    def expose(self, *args, **kwargs):
        formed.append(whole(self, *args, **kwargs))
        return formed[-1]

    monkeypatch.setattr(Camera, "expose", expose)
    frames = [SimulatedScene(rig(), drive, seen).expose(seen[0], 1, state, keep=True) for _ in range(2)]
    assert len(formed) == 1 and frames[0] is frames[1]
    np.testing.assert_array_equal(frames[0].image, formed[0].image)
    assert frames[0].image.dtype == formed[0].image.dtype
    SimulatedScene(rig(), drive, seen).expose(seen[0], 2, state, keep=True)  # other light
    SimulatedScene(rig(), drive, seen).expose(seen[1], 1, state, keep=True)
    assert len(formed) == 3


def test_views_of_the_first_moments_only(tmp_path):
    root = make_views(tmp_path, moments=3)
    assert [view.moment for view in views(root, moments=2)] == [0, 1, 0, 1]
    assert len(views(root)) == 6
    scene = SimulatedScene(rig(), scenario(), views(root, moments=2))
    assert [[view.moment for view in scene.at_step(step)] for step in range(3)] == [[0, 0], [1, 1], [0, 0]]


def test_loop_oracle_and_summary(seen):
    names = ("fixed", "oracle")
    drive = scenario()
    records = {name: run(make_policy(name, {}, CAMERA, performance()), rig(), drive, seen) for name in names}
    criteria = judged_with(20)
    tables = {
        name: evaluation.steps_table(drive, name, 0, item, criteria, performance().reference, 1)
        for name, item in records.items()
    }
    summary, pairs = evaluation.summary(drive, tables, records, criteria, 1)
    rows = summary.set_index("policy")
    assert rows.loc["oracle", "regret_percent"] == 0.0 and len(pairs) == 2
    assert rows.loc["fixed", "frames"] == 6 and rows.loc["fixed", "objects"] == 12
    assert pairs["difference_percent"].sum() == pytest.approx(0.0)
    metrics = evaluation.metrics(summary)
    assert metrics["oracle"]["regret_percent"] == 0.0
    assert metrics["fixed"]["regret_percent"] == rows.loc["fixed", "regret_percent"]
    level = tables["oracle"]["mean_level"].to_numpy()
    assert np.abs(level - 0.5).max() < 0.06


def test_metrics_without_the_oracle_have_no_regret(seen):
    """Unknown is not perfect: a regret of 0 would say that the policy equals the oracle."""
    drive, criteria = scenario(steps=2), judged_with(5)
    records = run(make_policy("fixed", {}, CAMERA, None), rig(), drive, seen)
    table = evaluation.steps_table(drive, "fixed", 0, records, criteria, performance().reference, 1)
    summary, _ = evaluation.summary(drive, {"fixed": table}, {"fixed": records}, criteria, 1)
    assert np.isnan(summary.loc[0, "regret_percent"])
    metrics = evaluation.metrics(summary)["fixed"]
    assert set(metrics) == {"ap_percent", "frames_lost_percent"}
    assert metrics["ap_percent"] == summary.loc[0, "ap_percent"]


def test_scenario_light_speed_flicker_and_disturbances():
    drive = scenario(steps=10, light=((3.0, 1.0), (4.0, 1 / 16)), speed_px_s=((0.0, 100.0), (9.0, 1000.0)))
    assert drive.light_at(0, 0.01) == drive.light_at(3, 0.01) == 1.0
    assert drive.light_at(4, 0.01) == pytest.approx(1 / 16) and drive.speed_at(9) == 1000.0
    assert drive.disturbances == [0, 4]
    lamp = Flicker(100.0, 0.8)
    assert lamp.factor(0.0123, 0.01) == pytest.approx(1.0) and lamp.factor(0.0, 0.002) > 1.2
    with pytest.raises(InputError, match="light is a list .* finite"):
        scenario(light=((0.0, float("inf")),))
    with pytest.raises(InputError, match="rising steps"):
        scenario(light=((3.0, 1.0), (2.0, 1.0)))


def test_scenario_light_falls_by_stops_and_a_lamp_turns_on_from_frame_to_frame():
    """Half way from 1 to a sixteenth is a quarter; 30 frames a second see a lamp of 10 Hz in three phases."""
    assert scenario(steps=10, light=((0.0, 1.0), (8.0, 1 / 16))).light_at(4, 0.01) == pytest.approx(1 / 4)
    lamp = Flicker(10.0, 0.8)
    steady = scenario(steps=10, light=((0.0, 1.0),), flicker=lamp)
    seen = [steady.light_at(step, 0.002) for step in range(6)]
    assert seen == pytest.approx([lamp.factor(number / 30, 0.002) for number in (0, 1, 2, 0, 1, 2)])
    assert np.ptp(seen[:3]) > 0.3


def test_views_are_dealt_to_folds_that_share_no_viewpoint(seen):
    parts = folds(seen, 2, 2)
    names = [{view.viewpoint for view in part} for part in parts]
    assert len(parts) == 2 and not names[0] & names[1]
    assert with_sun(seen[0].radiance(), 0.05).max() > 100 > seen[0].radiance().max()


@pytest.mark.parametrize(
    ("viewpoints", "count", "numbers"),
    [
        (8, 2, [[0, 1, 4, 5], [2, 3, 6, 7]]),  # pairs stay together
        (3, 2, [[0, 2], [1]]),
        (2, 3, [[0], [1]]),  # each viewpoint is a fold
        (1, 3, [[0]]),
    ],
)
def test_there_are_at_most_as_many_folds_as_viewpoints(viewpoints, count, numbers):
    every = [View(f"{name}-{moment}", name, moment, Path(name), ()) for name in "abcdefgh" for moment in (0, 1)]
    parts = folds(every, viewpoints, count)
    assert [["abcdefgh".index(view.viewpoint) for view in part if not view.moment] for part in parts] == numbers
    assert sum(map(len, parts)) == 2 * viewpoints


def drive_of(times_ms, isos, light):
    """The columns of one fold that transients are read from."""
    columns = {"exposure_ms": times_ms, "iso": isos, "light": light}
    return pd.DataFrame({"fold": 0, "step": range(len(light)), **columns})


def test_transients_are_those_of_the_brightness_not_of_the_settings():
    """Light falls to a quarter; the gain follows a frame late, overshoots by a stop, then holds."""
    light, drive = [1.0] * 5 + [0.25] * 7, scenario(steps=12, light=((5.0, 1.0), (6.0, 0.25)))
    assert drive.disturbances == [0, 6]
    drive = scenario(steps=12, light=((4.0, 1.0), (5.0, 0.25)))
    table = drive_of([8.0] * 12, [100.0] * 5 + [100.0, 800.0] + [400.0] * 5, light)
    numbers = evaluation.transients(drive, table)
    assert numbers == {"settling_frames": 2.0, "overshoot_stops": pytest.approx(1.0), "ripple_stops": 0.0}
    hunting = drive_of([8.0, 4.0] * 6, [100.0, 200.0] * 6, [1.0] * 12)
    numbers = evaluation.transients(scenario(steps=12, light=((0.0, 1.0),)), hunting)
    assert numbers["settling_frames"] == numbers["overshoot_stops"] == 0.0
    assert numbers["ripple_stops"] == pytest.approx(0.5)


@pytest.mark.parametrize(("delay_frames", "known"), [(0, True), (4, False)])
def test_transients_of_parts_too_short_to_measure_are_unknown(delay_frames, known):
    """Four frames before the light falls and six after it: with a delay of four none shows new settings twice."""
    light = ((3.0, 1.0), (4.0, 0.25))
    drive = scenario(steps=10, light=light, delay_frames=delay_frames)
    numbers = evaluation.transients(drive, drive_of([8.0] * 10, [100.0] * 10, [1.0] * 4 + [0.25] * 6))
    assert [np.isfinite(value) for value in numbers.values()] == [known] * 3


def test_a_ripple_is_unknown_where_nothing_settles_for_three_frames():
    """Brightness settles in the last two of five frames."""
    table = drive_of([8.0, 4.0, 2.0, 1.0, 1.0], [100.0] * 5, [1.0] * 5)
    numbers = evaluation.transients(scenario(steps=5, light=((0.0, 1.0),)), table)
    assert numbers["settling_frames"] == 3.0 and numbers["overshoot_stops"] == 0.0 and np.isnan(numbers["ripple_stops"])


def test_a_difference_is_of_the_policy_named_first_and_a_regret_is_what_the_oracle_has_more(seen, monkeypatch):
    percents = {"oracle": 70.0, "fixed": 60.0}

    def score(records, criteria, seed):
        percent = percents[records]
        return Score(percent, percent - 5, percent + 5, 9, percent + np.array([-1.0, 0.0, 1.0]), 5)

    drive, records = scenario(steps=2), run(make_policy("fixed", {}, CAMERA, None), rig(), scenario(steps=2), seen)
    table = evaluation.steps_table(drive, "any", 0, records, judged_with(5), np.ones((2, 8)), 1)
    monkeypatch.setattr(evaluation, "score", score)
    monkeypatch.setattr(evaluation, "sum", lambda parts: 0, raising=False)
    summary, pairs = evaluation.summary(
        drive, dict.fromkeys(percents, table), {name: name for name in percents}, judged_with(), 1
    )
    assert summary.set_index("policy")["regret_percent"].to_dict() == {"oracle": 0.0, "fixed": 10.0}
    rows = pairs.set_index(["policy", "other"])["difference_percent"].to_dict()
    assert rows == {("oracle", "fixed"): 10.0, ("fixed", "oracle"): -10.0}


def test_kept_detections_belong_to_all_that_a_frame_depends_on(seen):
    """Settings, light, motion, sun and the view: a frame of others is another frame."""
    drive, state = scenario(), CameraState.of(4, 100)
    changed = [scenario(direction_deg=90.0), scenario(sun_radius_fraction=0.1), scenario(speed_px_s=((0.0, 9.0),))]
    scenes = [SimulatedScene(rig(), each, seen) for each in (drive, *changed)]
    keys = [scene.key(seen[0], 0, state) for scene in scenes]
    keys += [scenes[0].key(seen[0], 0, other) for other in (CameraState.of(4, 200), CameraState.of(8, 100))]
    keys += [scenes[0].key(seen[0], 2, state), scenes[0].key(seen[1], 0, state)]
    assert len({str(key) for key in keys}) == len(keys) == 8


@pytest.mark.parametrize("factor", [0.7, 1.5])
def test_a_misjudged_motion_is_that_many_times_as_long(factor):
    exact = Estimate(*(part / seen_mtf(0.0).value for part in seen_mtf(10.0)))  # of a camera without blur of its own
    length = motion_length(_misjudged(exact, factor), np.ones((2, 8))).value_px
    assert length == pytest.approx(10 * factor, rel=0.1)


def test_loop_refuses_settings_that_the_camera_cannot_have(seen):
    class Long(Policy):
        def decide(self, observation, state):
            return Decision(CameraState.of(5000, 100), Action.MOVE, "")

    class LongByTruth(Long):
        sees_truth = True

    for policy in (Long(CAMERA), LongByTruth(CAMERA)):
        with pytest.raises(InputError, match=f"policy '{type(policy).__name__}': decided on 5000 ms"):
            run(policy, rig(), scenario(), seen)
