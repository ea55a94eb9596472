"""Control a V4L2 camera, or follow a video: ``python examples/control_camera.py /dev/video0`` (or ``drive.mp4``).

A video cannot be controlled: its frames are taken at the settings given, and the decisions are printed only.
"""

from __future__ import annotations

import sys

import cv2
import numpy as np

from pipeline import control
from pipeline.control.performance import Performance
from pipeline.control.policy import ControlledCamera
from pipeline.control.state import CameraState, Limits


class OpenCvCamera:
    """A driver (`pipeline.control.driver.Driver`) on OpenCV's capture; V4L2 takes exposure in units of 100 us."""

    def __init__(self, source: str, state: CameraState) -> None:
        self.capture_device = cv2.VideoCapture(source)
        self.state, self.live = state, source.startswith("/dev/")
        if self.live:
            self.capture_device.set(cv2.CAP_PROP_AUTO_EXPOSURE, 1)  # manual
            self.apply(state)

    def capture(self) -> np.ndarray:
        """The next frame as grey levels in [0, 1]."""
        good, frame = self.capture_device.read()
        if not good:
            raise SystemExit("no further frame")
        grey = cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY) if frame.ndim == 3 else frame
        return grey.astype(np.float32) / 255.0

    def settings(self) -> CameraState:
        """Settings of the last frame."""
        return self.state

    def apply(self, state: CameraState) -> None:
        """Write settings to a live camera."""
        if self.live:
            self.capture_device.set(cv2.CAP_PROP_EXPOSURE, round(state.exposure_s * 1e4))
            self.capture_device.set(cv2.CAP_PROP_GAIN, state.gain_db)
            self.state = state


if __name__ == "__main__":
    camera = ControlledCamera(Limits(delay_frames=2))
    performance = Performance.load("data/control_surface/all.npz")
    policy = control.create("iopc_continuous", camera=camera, performance=performance)
    driver = OpenCvCamera(sys.argv[1], CameraState.of(exposure_ms=8, iso=100))
    for number, decision in enumerate(control.Controller(policy).run(driver, 10_000)):
        new = decision.state
        print(f"{number:5d}  {new.exposure_ms:7.2f} ms  ISO {new.iso:5.0f}  {decision.action}: {decision.reason}")
