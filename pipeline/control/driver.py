"""What a camera must offer to be controlled: three methods, for simulated and real cameras alike.

A camera whose stream is coded (Motion JPEG, H.264, HEVC) may offer `CodedDriver.coding` beside them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.control.state import CameraState

if TYPE_CHECKING:
    from pipeline.datasets.decoding.video_coding import Coding


class Driver(Protocol):
    """A camera whose exposure time and gain can be set."""

    def capture(self) -> NDArray[np.floating]:
        """Take a frame: (H, W) float in [0, 1], grey, encoded as the camera delivers it."""
        ...

    def settings(self) -> CameraState:
        """Settings that the last captured frame was taken with."""
        ...

    def apply(self, state: CameraState) -> None:
        """Write settings; they reach the sensor after the camera's delay."""
        ...


class CodedDriver(Driver, Protocol):
    """A driver that knows how the frames of its stream were coded."""

    @property
    def coding(self) -> Coding:
        """Codec and quantiser of the last captured frame; empty and None where unknown."""
        ...
