"""Control a V4L2 camera, or follow a video.

    python examples/control_camera.py /dev/video0
    python examples/control_camera.py /dev/video0 --codec hevc
    python examples/control_camera.py drive.mp4 --exposure-ms 4 --iso 400 --policy mean_intensity

A video cannot be controlled: its frames were taken at the settings given, and the decisions are printed only. Policies
on performance curves need the surface that the stage ``control_surface`` writes. Codecs hide noise: that of a live
camera is the one that OpenCV states, or ``--codec`` where its frames were coded before. Ctrl-C ends it.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import cv2
import numpy as np

from pipeline import control
from pipeline.control.performance import Performance
from pipeline.control.policy import ControlledCamera
from pipeline.control.state import CameraState, DelayLine, Limits
from pipeline.datasets.decoding.video import read_video
from pipeline.datasets.decoding.video_coding import UNKNOWN, Coding
from pipeline.errors import InputError

SURFACE = Path("data/control_surface/all.npz")
EXPOSURE_UNIT_S = 1e-4
"""Of V4L2; a whole number of them is written, at least one."""

GAIN_UNIT_DB = 1.0
"""V4L2 takes whole numbers as gain, too; what one step is differs by camera (``v4l2-ctl -L`` lists the range)."""

DELAY_FRAMES = 2
"""Frames of a live camera that are still taken with the settings before, once others are written; measure yours."""

LIVE_LIMITS = Limits(exposure_min_s=EXPOSURE_UNIT_S, gain_step_db=GAIN_UNIT_DB, delay_frames=DELAY_FRAMES)


class OpenCvCamera:
    """A driver (`pipeline.control.driver.CodedDriver`) on OpenCV's capture.

    V4L2 takes exposure and gain in whole units. Videos are read as the monitor reads them.

    Args:
        source: ``/dev/video0`` or a video file.
        state: settings to begin with, or those of the video.
        codec: of the stream, for a video that does not state it; of a live camera it counts instead of the one that
            OpenCV states.

    Raises:
        OSError: the source cannot be opened.
    """

    def __init__(self, source: str, state: CameraState, codec: str = "") -> None:
        self.live = source.startswith("/dev/")
        self.codec, self.coding = codec, UNKNOWN
        self.state = self.written = state = as_written(state) if self.live else state
        self.on_their_way = DelayLine.filled(state, DELAY_FRAMES)
        if not self.live and not Path(source).is_file():
            raise OSError(f"{source}: expected a video file or a V4L2 camera")
        self.frames = () if self.live else read_video(Path(source))
        if self.live:
            self.capture_device = cv2.VideoCapture(source)
            if not self.capture_device.isOpened():
                raise OSError(f"{source}: expected a V4L2 camera that no other program uses")
            self.coding = Coding(codec or stated_codec(self.capture_device))
            self.capture_device.set(cv2.CAP_PROP_AUTO_EXPOSURE, 1)  # manual
            self.apply(state)

    def capture(self) -> np.ndarray:
        """The next frame as grey levels in [0, 1].

        Raises:
            EOFError: there is no further frame.
        """
        if not self.live:
            for _, picture, coding in self.frames:
                self.coding = coding.or_by(self.codec)
                return picture
            raise EOFError("no further frame")
        good, frame = self.capture_device.read()
        if not good:
            raise EOFError("no further frame")
        self.state = self.on_their_way.next(self.written)
        grey = cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY) if frame.ndim == 3 else frame
        return grey.astype(np.float32) / 255.0

    def settings(self) -> CameraState:
        """Settings that the last frame was taken with; those written since are on their way to the sensor."""
        return self.state

    def apply(self, state: CameraState) -> None:
        """Write settings to a live camera; `settings` states them as they were written."""
        if self.live:
            self.written = as_written(state)
            self.capture_device.set(cv2.CAP_PROP_EXPOSURE, round(self.written.exposure_s / EXPOSURE_UNIT_S))
            self.capture_device.set(cv2.CAP_PROP_GAIN, round(self.written.gain_db / GAIN_UNIT_DB))


def as_written(state: CameraState) -> CameraState:
    """Settings rounded to the units that a camera takes."""
    gain_db = round(state.gain_db / GAIN_UNIT_DB) * GAIN_UNIT_DB
    return CameraState(max(1, round(state.exposure_s / EXPOSURE_UNIT_S)) * EXPOSURE_UNIT_S, 10.0 ** (gain_db / 20.0))


def stated_codec(capture_device: cv2.VideoCapture) -> str:
    """Four-character code of a live stream, e.g. ``"MJPG"``; empty where OpenCV states none."""
    code = int(capture_device.get(cv2.CAP_PROP_FOURCC))
    return code.to_bytes(4, "little").decode("ascii", "ignore").strip(" \0") if 0 < code < 2**32 else ""


def main(arguments: list[str] | None = None) -> int:
    """Print one decision per frame; returns the number of frames."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("source")
    parser.add_argument("--exposure-ms", type=float, default=8.0)
    parser.add_argument("--iso", type=float, default=100.0)
    parser.add_argument("--policy", default="iopc_continuous")
    parser.add_argument("--codec", default="", help="of the stream: mjpeg, h264, hevc, vp8, vp9 or av1")
    options = parser.parse_args(arguments)
    try:
        driver = OpenCvCamera(options.source, CameraState.of(options.exposure_ms, options.iso), options.codec)
        camera = ControlledCamera(LIVE_LIMITS if driver.live else Limits())
        performance = Performance.load(SURFACE) if options.policy.startswith("iopc") else None
        policy = control.create(options.policy, camera=camera, performance=performance)
        controller = control.Controller(policy)
    except (OSError, InputError) as error:
        parser.error(str(error))
    frames = 0
    try:
        for decision in controller.run(driver, sys.maxsize):
            new = decision.state
            print(f"{frames:5d}  {new.exposure_ms:7.2f} ms  ISO {new.iso:5.0f}  {decision.action}: {decision.reason}")
            frames += 1
    except (EOFError, KeyboardInterrupt):
        pass
    except InputError as error:  # the video is none, or damaged behind these frames
        parser.error(str(error))
    return frames


if __name__ == "__main__":
    main()
