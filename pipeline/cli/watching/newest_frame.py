"""The newest frame of a camera or network stream, read all the time so that no buffer holds old frames."""

from __future__ import annotations

import threading
from collections import Counter
from functools import partial
from typing import TYPE_CHECKING, Any

from pipeline.cli.addresses import without_credentials
from pipeline.datasets.decoding.video_coding import UNKNOWN, Coding
from pipeline.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray

    Levels = Callable[[], NDArray[np.float32]]
    """Converts a frame to grey levels (H, W) in [0, 1]; only frames that are shown are converted."""

RECONNECT_S = 2.0
STREAM_TIMEOUT_S = 30.0


class NewestFrame(threading.Thread):
    """Reads a device and keeps its newest frame; where the signal is lost, the device is opened again.

    Args:
        device: index of a camera, or address of a stream; it is opened at once.
        name: of the device, for messages.
        stop: ends it when set.

    Attributes:
        lost: whether the device delivers nothing.
        problem: why the last frame must not be measured; empty where it may be.

    Raises:
        InputError: the device cannot be opened.
    """

    def __init__(self, device: int | str, name: str, stop: threading.Event) -> None:
        super().__init__(daemon=True)
        self._device, self._name, self._stop_event = device, name, stop
        self._lock = threading.Lock()
        self._count = 0
        self._levels: Levels | None = None
        self._coding = UNKNOWN
        self.lost, self.problem = False, ""
        self._stated: set[str] = set()
        self._capture = self._open()

    def newest(self, shown: int) -> tuple[int, NDArray[np.float32] | None, Coding]:
        """Number of the newest frame that may be measured, counted from 1, its grey levels, and how it was stored.

        Args:
            shown: number of the last frame taken; that one is not converted again, but None.
        """
        with self._lock:
            count, levels, coding = self._count, self._levels, self._coding
        if levels is None or count == shown:
            return count, None, coding
        try:
            return count, levels(), coding
        except InputError as error:
            self.problem = str(error)
            return shown, None, coding

    def run(self) -> None:
        try:
            while not self._stop_event.is_set():
                frame = self._capture.read()
                if frame is None:
                    self.lost = True
                    self._capture.close()
                    self._reopen()
                    continue
                levels, self.problem = frame
                if levels is not None:
                    with self._lock:
                        self._count, self._levels, self._coding = self._count + 1, levels, self._capture.coding
                self.lost = False
        finally:
            self.lost = True
            self._capture.close()

    def _reopen(self) -> None:
        """Open the device again, until that succeeds or the thread is stopped."""
        while not self._stop_event.wait(RECONNECT_S):
            try:
                self._capture = self._open()
            except InputError:
                continue
            return

    def _open(self) -> _Camera | _Stream:
        if isinstance(self._device, int):
            return _Camera(self._device, self._name)
        return _Stream(self._device, self._name, self._remark)

    def _remark(self, kind: str, words: str) -> None:
        """Warn of what is unusual about the stream, once of each kind."""
        from pipeline.cli.frames.remarks import video_remarks

        if kind not in self._stated:
            self._stated.add(kind)
            video_remarks(self._name, Counter())(kind, words)


class _Camera:
    """A camera of this computer. OpenCV reads."""

    coding = UNKNOWN

    def __init__(self, index: int, name: str) -> None:
        import cv2

        self._capture: Any = cv2.VideoCapture(index)
        if not self._capture.isOpened():
            raise InputError(f"{name}: cannot be opened; check the index, and that nothing else uses it")

    def read(self) -> tuple[Levels | None, str] | None:
        """The next frame and no problem; None where the camera delivers nothing."""
        from pipeline.datasets.decoding.video_decoder import grey_frame

        good, frame = self._capture.read()
        return (partial(grey_frame, frame), "") if good else None

    def close(self) -> None:
        self._capture.release()


class _Stream:
    """A network stream, or a file by its address."""

    def __init__(self, address: str, name: str, remark: Callable[[str, str], None]) -> None:
        from pipeline.datasets.decoding.video_decoder import BadVideo, Decoder

        try:
            self._decoder = Decoder(address, timeout_s=STREAM_TIMEOUT_S, threads=0)
        except BadVideo as error:
            reason = without_credentials(error.reason)  # of the parts of a stream, addresses are named
            raise InputError(f"{name}: cannot be opened: {reason}; check the address") from None
        self._remark = remark

    @property
    def coding(self) -> Coding:
        return self._decoder.coding

    def read(self) -> tuple[Levels | None, str] | None:
        """The next frame, or why it must not be measured; None where the stream delivers nothing."""
        from pipeline.datasets.decoding.video_decoder import defect, grey_levels, remarks

        frame = self._decoder.read()
        self._decoder.messages.clear()
        if frame is None:
            return None
        if problem := defect(frame):
            return None, problem
        for kind, words in remarks(frame).items():
            self._remark(kind, words)
        return partial(grey_levels, frame), ""

    def close(self) -> None:
        self._decoder.close()
