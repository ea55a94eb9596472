"""What a policy sees of a frame: brightness of the picture inside its bars, tensors, and why estimates are missing."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from control_makers import CAMERA, Scene, performance

from pipeline import control
from pipeline.camera.exposure import Camera
from pipeline.cli.analysis.frame import FrameAnalysis, Thresholds
from pipeline.control.decision import Action
from pipeline.control.image.metering import Metering
from pipeline.control.observation import Estimate, Observation, abstention_reason, brightness, observe
from pipeline.control.simulation import loop
from pipeline.control.simulation.scenario import Scenario
from pipeline.control.state import CameraState
from pipeline.errors import InputError
from pipeline.streams import stream

GAMMA = CAMERA.formation.gamma


def scene(rows=400, columns=640, mean=0.5):
    """A textured picture of a mean grey level, on the 8-bit grid."""
    texture = stream(1, "observation").normal(mean, 0.1, (rows, columns))
    return (np.rint(np.clip(texture, 0, 1) * 255) / 255).astype(np.float32)


@pytest.mark.parametrize("level", [0.0, 16 / 255, 128 / 255])
def test_bars_beside_a_picture_do_not_change_the_exposure(level):
    picture = scene()
    frame = np.full((640, 640), level, np.float32)
    frame[120:520] = picture
    seen, alone = observe(frame), observe(picture)
    assert (seen.mean_level, seen.saturated_fraction) == (alone.mean_level, alone.saturated_fraction)
    assert Metering().factor(seen, GAMMA) == 1.0
    state = CameraState.of(8, 100)
    decisions = [
        control.Controller(control.create("mean_intensity", camera=CAMERA)).step(f, state) for f in (frame, picture)
    ]
    assert decisions[0] == decisions[1]


def test_white_sky_counts_as_picture():
    """A frame exposed too long: its sky is white over whole lines, which are bright, not missing."""
    frame = scene()
    frame[:150] = 1.0
    seen = observe(frame)
    assert seen.mean_level == pytest.approx(frame.mean()) and seen.saturated_fraction >= 150 / 400
    frame[-40:] = 1.0
    assert brightness(frame) == pytest.approx((frame.mean(), np.mean(frame >= 0.99)))


@pytest.mark.parametrize("white_dn", [235, 250, 253])
def test_a_uniform_sky_counts_as_picture_at_whatever_level_the_camera_clips(white_dn):
    """As a bar it would leave the road, and exposure would rise until half of the frame is white."""
    frame = scene(mean=0.35)
    frame[:200] = white_dn / 255
    assert brightness(frame).mean_level == pytest.approx(frame.mean())
    assert brightness(frame[::-1]).mean_level == pytest.approx(frame.mean())
    assert Metering().factor(observe(frame), GAMMA) < 0.7


@pytest.mark.parametrize("black_dn", [0, 16])
def test_a_dark_bar_at_one_border_is_left_out(black_dn):
    frame = scene()
    frame[:200] = black_dn / 255
    assert brightness(frame) == brightness(frame[200:])
    assert brightness(frame[::-1]) == brightness(frame[200:][::-1])


@pytest.mark.parametrize("reach", [0.5, 0.62])
@pytest.mark.parametrize("noise_dn", [0.0, 3.0])
def test_the_black_surround_of_a_fisheye_does_not_change_the_exposure(reach, noise_dn):
    """A whole circle, and one that the sensor cuts at top and bottom."""
    picture = scene(400, 480)
    y, x = np.mgrid[-200:200, -240:240] + 0.5
    inside = np.hypot(x, y) < reach * 400
    surround = np.abs(stream(1, "surround").normal(0, noise_dn, picture.shape)) / 255
    frame = np.where(inside, picture, surround).astype(np.float32)
    assert brightness(frame).mean_level == pytest.approx(picture[inside].mean(), rel=0.02)
    assert Metering().factor(observe(frame), GAMMA) == 1.0


def test_dark_corners_of_a_night_scene_count_as_picture():
    """A lit window, headlights' cone: dark all around, and no circle."""
    dark = np.abs(stream(1, "night").normal(0, 3, (400, 640))) / 255
    for lit in (np.s_[100:300, 150:500], np.s_[200:400, 100:300], np.s_[:, 200:400], np.s_[:0]):
        frame = dark.astype(np.float32)
        frame[lit] = scene()[lit]
        assert brightness(frame).mean_level == pytest.approx(frame.mean())


def test_the_precision_of_a_frame_with_bars_is_expected_at_the_brightness_of_its_picture(monkeypatch):
    """Beside a surface of darker frames, bars would make it a darker frame."""
    frame = np.zeros((640, 640), np.float32)
    frame[120:520] = scene()
    levels = []
    monkeypatch.setattr(
        "pipeline.control.precision.expected_precision.expected_precision",
        lambda surface, sigma, mtf, relative, level: levels.append(level) or SimpleNamespace(best_percent=1.0),
    )
    analysis = FrameAnalysis(SimpleNamespace(), Thresholds(), performance())
    monkeypatch.setattr("pipeline.cli.analysis.flag_words.left_out_words", lambda row: "rows")
    nothing = SimpleNamespace(value=np.full((2, 8), np.nan))
    analysis._precision({}, frame, SimpleNamespace(mtf=nothing), "frame.png")
    assert levels == [observe(frame[120:520]).mean_level]


@pytest.mark.parametrize(("kept", "expected"), [(True, 42.0), (False, 50.0)])
def test_settings_that_are_kept_promise_what_the_row_of_the_frame_states(monkeypatch, kept, expected):
    names = ("exposure_ms", "iso", "best_exposure_ms", "best_iso", "gain_percent")
    made = SimpleNamespace(
        **dict.fromkeys(names, 1.0), best_ap_percent=50.0, undecided=False, action="hold", keeps_settings=kept
    )
    monkeypatch.setattr("pipeline.control.advice.advise", lambda *_, **__: made)
    analysis = FrameAnalysis(SimpleNamespace(), Thresholds(), performance())
    for ap_percent, best in ((42.0, expected), (float("nan"), 50.0)):
        row = analysis._advice(scene(), SimpleNamespace(), (0.016, 100.0), ap_percent)
        assert row["best_ap_percent"] == best


@pytest.mark.parametrize("kind", [torch.float32, torch.float64, torch.bfloat16])
def test_a_controller_takes_tensors_as_the_monitor_does(kind):
    frame, state = torch.full((16, 16), 0.25, dtype=kind), CameraState.of(8, 100)
    policy = control.create("mean_intensity", camera=CAMERA)
    made = control.Controller(policy).step(frame, state)
    assert made == control.Controller(policy).step(frame.float().numpy(), state)


@pytest.mark.parametrize("frame", [torch.zeros((8, 8), dtype=torch.uint8), torch.zeros((8, 8, 3)), [[0.5]], None])
def test_what_is_no_grey_frame_is_refused_in_one_line(frame):
    with pytest.raises(InputError, match=r"frame: got .*; expected \(H, W\) floats in \[0, 1\], grey"):
        control.Controller(control.create("mean_intensity", camera=CAMERA)).step(frame, CameraState.of(8, 100))


def answered(blur, noise, reasons):
    return SimpleNamespace(abstained={"blur": not blur, "noise": not noise}, reasons=reasons)


@pytest.mark.parametrize(
    ("blur", "noise", "reasons", "words"),
    [
        (True, False, {"blur": {"flat": 2}, "noise": {"compressed": 9}}, "noise: compressed"),
        (True, False, {"blur": {}, "noise": {}}, "noise: no estimate"),
        (
            False,
            False,
            {"blur": {"flat": 2}, "noise": {"flat": 1, "saturated": 1}},
            "blur: flat; noise: flat, saturated",
        ),
        (True, True, {"blur": {"flat": 2}, "noise": {}}, ""),
    ],
)
def test_reasons_are_those_of_the_estimates_that_are_missing(blur, noise, reasons, words):
    assert abstention_reason(answered(blur, noise, reasons)) == words


def test_the_closed_loop_states_the_reasons_of_the_controller(monkeypatch):
    """Blur has an answer although some patches are flat, noise has none."""
    mtf = SimpleNamespace(value=np.ones((2, 8)), low=np.ones((2, 8)), high=np.ones((2, 8)))
    condition = answered(True, False, {"blur": {"flat": 2}, "noise": {}})
    condition.mtf, condition.sigma_dn = mtf, None
    stub = SimpleNamespace(frame=lambda image: condition)
    monkeypatch.setattr(loop, "monitor", lambda: stub)
    monkeypatch.setattr(loop.SimulatedScene, "key", lambda *_: [])
    state = CameraState.of(8, 100)
    drive = Scenario("test", 2, ((0.0, 1.0),), ((0.0, 0.0),), state)
    simulated = loop.SimulatedScene(loop.Rig(Camera(), CAMERA, "compact", "{}", seed=1), drive, [])
    formed = loop.FormedFrame(np.full((16, 16), 128, np.uint8), 0.0, 0.0, 0.0)
    *_, reason = simulated.estimates(None, 0, state, formed)
    assert reason == observe(formed.image, stub).reason == "noise: no estimate"


def test_a_frame_that_is_mostly_white_hides_how_bright_the_scene_is():
    """Its mean says at least so bright: exposure falls by a stop more."""
    white = Observation(np.ones((8, 8), np.float32), 0.98, 0.9)
    grey = Observation(np.ones((8, 8), np.float32), 0.98, 0.4)
    metering = Metering(largest_factor=32.0)
    assert metering.factor(grey, GAMMA) == pytest.approx((0.5 / 0.98) ** GAMMA)
    assert metering.factor(white, GAMMA) == pytest.approx((0.5 / 0.98) ** GAMMA / 2)


def test_the_mean_of_a_picture_does_not_excuse_a_frame_that_is_mostly_white():
    """Its white half may be many times brighter: factors go over smoothly from frames outside the tolerance."""
    factors = [
        Metering().factor(Observation(np.ones((8, 8), np.float32), mean, mean), GAMMA) for mean in (0.51, 0.54, 0.56)
    ]
    assert factors == pytest.approx([(0.5 / mean) ** GAMMA / 2 for mean in (0.51, 0.54, 0.56)])


@pytest.mark.parametrize("missing", ["sigma_dn", "mtf"])
@pytest.mark.parametrize("name", ["iopc_target", "iopc_optimal", "iopc_continuous"])
def test_an_estimate_that_is_no_number_counts_as_none(name, missing):
    """An MTF of NaN was taken for no motion: longer exposures in the frame after it."""
    moving, state, states = Scene(0.25, 1_500.0), CameraState.of(8, 200), []
    policy = control.create(name, camera=CAMERA, performance=performance())
    for step in range(6):
        seen = moving.observe(state)
        nothing = Estimate(*(part * np.nan for part in getattr(seen, missing)))
        decision = policy.decide(replace(seen, **{missing: nothing}) if step == 4 else seen, state)
        assert (decision.action is Action.ABSTAINED) is (step == 4)
        states.append(state := decision.state)
    assert states[3] == states[4] == states[5] and policy.speed_px_s == pytest.approx(1_500.0, rel=0.05)
