"""Controller and driver protocol: the loop around a camera, and the example on a video."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from control_makers import CAMERA, Scene, performance

from pipeline import control
from pipeline.condition import ConditionMonitor
from pipeline.control.decision import Action, Decision
from pipeline.control.policy import ControlledCamera, Policy
from pipeline.control.state import CameraState, DelayLine, Limits
from pipeline.datasets.decoding.video_coding import Coding
from pipeline.errors import InputError
from pipeline.streams import stream

EXAMPLE = Path(__file__).resolve().parents[2] / "examples/control_camera.py"


class SceneCamera:
    """The three methods of a driver on a grey scene."""

    def __init__(self, scene, state):
        self.scene, self.state, self.applied = scene, state, []

    def capture(self):
        return self.scene.observe(self.state).image

    def settings(self):
        return self.state

    def apply(self, state):
        self.state = state
        self.applied.append(state)


def example():
    spec = importlib.util.spec_from_file_location("control_camera", EXAMPLE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_controller_drives_a_camera_of_three_methods_to_its_target():
    driver = SceneCamera(Scene(light=0.2), CameraState.of(1.0, 100))
    decisions = list(control.Controller(control.create("mean_intensity", camera=CAMERA)).run(driver, 20))
    assert [decision.state for decision in decisions] == driver.applied
    assert driver.capture().mean() == pytest.approx(0.5, rel=0.12)


def test_controller_estimates_the_condition_where_the_policy_uses_it():
    """Flat noise: the monitor estimates noise, the policy answers with settings inside the limits and a reason."""
    noise = stream(1, "controller").normal(0.5, 4 / 255, (256, 256))
    frame = (np.rint(np.clip(noise, 0, 1) * 255) / 255).astype(np.float32)
    policy = control.create("iopc_continuous", camera=CAMERA, performance=performance())
    controller = control.Controller(policy)
    assert isinstance(controller.monitor, ConditionMonitor)
    decision = controller.step(frame, CameraState.of(8, 200))
    limits = CAMERA.limits
    assert limits.exposure_min_s <= decision.state.exposure_s <= limits.exposure_max_s and decision.reason
    assert control.Controller(control.create("shim", camera=CAMERA)).monitor is None


@pytest.mark.parametrize("frame", [np.zeros((8, 8), np.uint8), np.zeros((8, 8, 3), np.float32), [[0.5]]])
def test_controller_refuses_what_is_no_grey_frame(frame):
    controller = control.Controller(control.create("mean_intensity", camera=CAMERA))
    with pytest.raises(InputError, match="divide 8-bit frames by 255"):
        controller.step(frame, CameraState.of(8, 100))


def test_example_follows_a_video_to_its_end(tmp_path, capsys):
    """Dark frames: settings of a video stay as given, and every decision asks for more light."""
    path = tmp_path / "drive.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 10, (64, 48))
    for _ in range(3):
        writer.write(np.full((48, 64, 3), 40, np.uint8))
    writer.release()
    assert example().main([str(path), "--exposure-ms", "4", "--iso", "200", "--policy", "mean_intensity"]) == 3
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 3 and all(" move: " in line and float(line.split()[1]) > 8.0 for line in lines)
    assert len({line[5:] for line in lines}) == 1


def test_example_names_a_source_that_cannot_be_opened(tmp_path):
    with pytest.raises(OSError, match="no-such"):
        example().OpenCvCamera(str(tmp_path / "no-such.avi"), CameraState.of(8, 100))


@pytest.mark.parametrize(
    ("frame", "words"),
    [
        (np.full((8, 8), 128.0, np.float32), r"frame: spans 128 .. 128; expected numbers in \[0, 1\]"),
        (np.full((8, 8), -0.1), "frame: spans -0.1"),
        (np.full((8, 8), np.nan), "frame: spans nan"),
        (np.zeros((0, 8)), "frame: got float64 .0, 8."),
    ],
)
def test_a_frame_outside_its_range_moves_no_camera(frame, words):
    for name in ("mean_intensity", "shim"):
        with pytest.raises(InputError, match=words):
            control.Controller(control.create(name, camera=CAMERA)).step(frame, CameraState.of(8, 100))


@pytest.mark.parametrize(
    ("exposure_ms", "iso", "name"), [("8", 100, "exposure_ms"), (8, "100", "iso"), (None, 100, "exposure_ms")]
)
def test_settings_that_are_no_numbers_are_named(exposure_ms, iso, name):
    with pytest.raises(InputError, match=f"camera state: {name} is .*; expected a finite number above 0"):
        CameraState.of(exposure_ms, iso)
    with pytest.raises(InputError, match="camera state: exposure_s is '8'"):
        CameraState("8", 1.0)


@pytest.mark.parametrize("exposure_ms", [0.05, 0.06, 0.1, 0.149, 0.15, 0.24, 0.25, 1.26, 33.0])
def test_example_states_the_exposure_and_gain_that_were_written(monkeypatch, exposure_ms):
    """V4L2 takes whole units of 100 us; 0 of them would be another mode or an error. So is the gain a whole number."""
    module, written, gains_db = example(), [], []

    class Capture:
        def __init__(self, _):
            pass

        def isOpened(self):
            return True

        def set(self, key, value):
            if key == cv2.CAP_PROP_EXPOSURE:
                written.append(value)
            if key == cv2.CAP_PROP_GAIN:
                gains_db.append(value)

        def get(self, _):
            return 0.0

        def read(self):
            return True, np.full((12, 16, 3), 128, np.uint8)

    monkeypatch.setattr(module.cv2, "VideoCapture", Capture)
    driver = module.OpenCvCamera("/dev/video0", CameraState.of(exposure_ms, 140))
    driver.capture()
    assert gains_db[-1] == 3 and driver.settings().gain_db == pytest.approx(3.0)
    assert written[-1] >= 1 and driver.settings().exposure_ms == pytest.approx(written[-1] / 10)
    assert driver.settings().exposure_ms == pytest.approx(max(exposure_ms, 0.1), abs=0.0501)
    driver.apply(CameraState.of(0.03, 200))
    for _ in range(module.DELAY_FRAMES + 1):
        driver.capture()
    assert written[-1] == 1 and driver.settings().is_nearly(CameraState(1e-4, 2.0))
    assert module.LIVE_LIMITS.accepts(driver.settings())


@pytest.mark.parametrize("name", ["mean_intensity", "iopc_optimal"])
def test_example_states_the_settings_of_each_frame_of_a_camera_that_follows_late(monkeypatch, name):
    """If it stated those written, brightness would be corrected again before it shows, and swing to white and back."""
    module, scene, start = example(), Scene(light=0.2, size_px=128), CameraState.of(1.0, 100)

    class Capture:
        """A V4L2 camera that takes further frames with the settings before."""

        def __init__(self, _):
            self.exposure_s, self.gain, self.late = start.exposure_s, 1.0, DelayLine.filled(start, module.DELAY_FRAMES)

        def isOpened(self):
            return True

        def set(self, key, value):
            if key == cv2.CAP_PROP_EXPOSURE:
                self.exposure_s = value / 1e4
            if key == cv2.CAP_PROP_GAIN:
                self.gain = 10 ** (round(value) / 20)

        def get(self, _):
            return 0.0

        def read(self):
            self.taken = self.late.next(CameraState(self.exposure_s, self.gain))
            return True, np.rint(scene.observe(self.taken).image * 255).astype(np.uint8)

    monkeypatch.setattr(module.cv2, "VideoCapture", Capture)
    driver = module.OpenCvCamera("/dev/video0", start)
    camera = ControlledCamera(module.LIVE_LIMITS, CAMERA.formation)
    policy = control.create(name, camera=camera, performance=performance())
    levels = []
    for step in range(25):
        frame = driver.capture()
        taken = driver.capture_device.taken
        assert driver.settings().exposure_s == pytest.approx(taken.exposure_s), step
        assert driver.settings().gain == pytest.approx(taken.gain), step
        driver.apply(policy.decide(scene.observe(driver.capture_device.taken), driver.settings()).state)
        levels.append(float(frame.mean()))
    assert max(levels) < 0.65 and levels[-1] == pytest.approx(0.5, abs=0.1)


def test_example_tells_the_monitor_how_a_video_is_coded(monkeypatch, tmp_path):
    """Of Motion JPEG here; HEVC, VP8, VP9 and AV1 hide noise, which the monitor knows by their names only."""
    module, path, codecs = example(), tmp_path / "drive.avi", []
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 10, (64, 48))
    writer.write(np.full((48, 64, 3), 40, np.uint8))
    writer.release()
    whole = ConditionMonitor.frame

    def frame(self, image, codec="", quantiser=None):
        codecs.append(codec)
        return whole(self, image, codec, quantiser)

    monkeypatch.setattr(ConditionMonitor, "frame", frame)
    monkeypatch.setattr(module.Performance, "load", lambda path: performance())
    assert module.main([str(path)]) == 1 and codecs == ["mjpeg"]


@pytest.mark.parametrize(
    ("code", "option", "codec"),
    [
        (cv2.VideoWriter_fourcc(*"MJPG"), "", "MJPG"),
        (cv2.VideoWriter_fourcc(*"YUYV"), "hevc", "hevc"),  # decoded before, as by a loopback device
        (0, "", ""),
        (-1, "", ""),
        (0, "h264", "h264"),
    ],
)
def test_example_names_the_codec_of_a_live_stream(monkeypatch, code, option, codec):
    module = example()
    capture = SimpleNamespace(isOpened=lambda: True, set=lambda *_: True, get=lambda _: float(code))
    monkeypatch.setattr(module.cv2, "VideoCapture", lambda _: capture)
    assert module.OpenCvCamera("/dev/video0", CameraState.of(8, 100), option).coding == Coding(codec)


class Codecs:
    """A monitor that notes the coding of each frame and abstains."""

    def __init__(self):
        self.codings = []

    def frame(self, image, codec="", quantiser=None):
        self.codings.append((codec, quantiser))
        return SimpleNamespace(
            sigma_dn=None, mtf=None, reasons={"noise": {"compressed": 1}}, abstained={"noise": True, "blur": True}
        )


def test_controller_passes_the_coding_of_its_stream_to_the_monitor():
    """That of a frame counts before that of the stream; without an estimate the split is kept."""
    policy, monitor = control.create("iopc_optimal", camera=CAMERA, performance=performance()), Codecs()
    state = CameraState.of(8, 100)
    controller = control.Controller(policy, monitor, codec="hevc")
    decision = controller.step(FRAME, state)
    controller.step(FRAME, state, quantiser=20)
    controller.step(FRAME, state, "h264", 46)
    assert monitor.codings == [("hevc", None), ("hevc", 20), ("h264", 46)]
    assert decision.action is Action.ABSTAINED and decision.state == state and "compressed" in decision.reason
    control.Controller(policy, monitor).step(FRAME, state)
    control.Controller(control.create("mean_intensity", camera=CAMERA), monitor, codec="hevc").step(FRAME, state)
    assert monitor.codings[3:] == [("", None)]


def test_controller_takes_the_coding_of_each_frame_from_a_driver_that_states_it():
    class Stream(SceneCamera):
        coding = None

        def capture(self):
            self.coding = next(codings)
            return super().capture()

    codings, monitor = iter([Coding("hevc", 30), Coding(), Coding("h264"), None, "mjpeg"]), Codecs()
    driver = Stream(Scene(light=0.5), CameraState.of(8, 100))
    policy = control.create("iopc_target", camera=CAMERA, performance=performance())
    decisions = control.Controller(policy, monitor, codec="vp9").run(driver, 5)
    for _ in range(4):
        next(decisions)
    assert monitor.codings == [("hevc", 30), ("vp9", None), ("h264", None), ("vp9", None)]
    with pytest.raises(InputError, match="driver: coding is 'mjpeg'; expected .*video_coding.Coding"):
        next(decisions)


def test_controller_refuses_a_codec_that_is_no_name():
    policy = control.create("iopc_optimal", camera=CAMERA, performance=performance())
    with pytest.raises(InputError, match="codec=264"):
        control.Controller(policy, codec=264).step(FRAME, CameraState.of(8, 100))


class Given(Policy):
    """Answers with what it was given."""

    def __init__(self, answer, camera=CAMERA):
        super().__init__(camera)
        self.answer = answer

    def decide(self, observation, state):
        return self.answer


FRAME = np.full((64, 64), 0.5, np.float32)
STEPPED = Limits(exposure_steps_per_stop=6, gain_step_db=1.0)


def decision(exposure_ms, iso):
    return Decision(CameraState.of(exposure_ms, iso), Action.MOVE, "")


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (None, "policy 'Given': decide returned NoneType, expected pipeline.control.decision.Decision"),
        ((0.008, 1.0), "decide returned tuple"),
        (Decision((0.008, 1.0), Action.MOVE, ""), "with a CameraState"),
        (decision(5000, 100), "decided on 5000 ms at ISO 100, .*here 33 ms at ISO 100; self.limits.nearest"),
        (decision(0.01, 100), "here 0.05 ms at ISO 100"),
        (decision(8, 50), "here 8 ms at ISO 100"),
        (decision(8, 6400), "here 8 ms at ISO 3200"),
    ],
)
def test_a_decision_that_the_camera_cannot_carry_out_is_refused(answer, words):
    driver = SceneCamera(Scene(), CameraState.of(8, 100))
    with pytest.raises(InputError, match=words):
        next(control.Controller(Given(answer)).run(driver, 1))
    assert not driver.applied


def test_a_decision_between_the_steps_of_a_camera_is_refused():
    camera = ControlledCamera(STEPPED)
    on = Decision(STEPPED.nearest(0.01, 2.0), Action.MOVE, "")
    assert control.Controller(Given(on, camera)).step(FRAME, CameraState.of(8, 100)) is on
    between = Decision(CameraState(on.state.exposure_s * 2 ** (1 / 12), on.state.gain), Action.MOVE, "")
    with pytest.raises(InputError, match="on its steps"):
        control.Controller(Given(between, camera)).step(FRAME, CameraState.of(8, 100))


def test_settings_of_a_frame_outside_the_limits_may_be_kept_and_not_exceeded():
    """A driver may report settings that the limits given do not have, rounded from frame to frame."""
    outside = CameraState.of(40, 100)
    for kept in (outside, CameraState.of(39.99, 100)):
        assert control.Controller(Given(Decision(kept, Action.HOLD, ""))).step(FRAME, outside).state == kept
    with pytest.raises(InputError, match="cannot have"):
        control.Controller(Given(decision(41, 100))).step(FRAME, outside)
