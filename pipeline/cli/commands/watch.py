"""``camera-monitor watch``: the condition of a camera that is running, as JSON lines."""

from __future__ import annotations

import signal
import threading
from pathlib import Path
from types import FrameType

import click

from pipeline.cli.ending_signals import ENDING_SIGNALS, not_ignored
from pipeline.cli.exit_codes import ALARM
from pipeline.cli.options.frame_samples import patches_option, tiles_option
from pipeline.cli.options.given_paths import GivenPath
from pipeline.cli.options.numbers import FiniteRange, Mtf50Limit
from pipeline.cli.options.video_codec import codec_option
from pipeline.signals import handled


@click.command("watch")
@click.argument("source")
@click.option("--blur", "blur_name", default="spectral", show_default=True, help="blur estimator")
@click.option("--noise", "noise_name", default="adaptive", show_default=True, help="noise estimator")
@click.option("--camera", "camera_name", help="blur relative to this camera, as camera-monitor calibrate stored it")
@codec_option
@tiles_option
@patches_option
@click.option("--rate", default=10.0, show_default=True, type=FiniteRange(0.01, 1000), help="most frames per second")
@click.option("--no-wait", is_flag=True, help="of a video file every frame, as fast as possible, not at its own speed")
@click.option("--frames", type=click.IntRange(min=1), help="stop after so many frames")
@click.option("--idle-stop", type=FiniteRange(0.1, 1e7), help="stop when nothing has come for so many seconds")
@click.option("--window", default=30, show_default=True, type=click.IntRange(1, 10_000), help="frames of the state")
@click.option("--alarm-sigma-dn", type=FiniteRange(0, 255), help="alarm when noise exceeds this, grey levels")
@click.option("--alarm-mtf50", type=Mtf50Limit(), help="alarm when MTF50 falls below this, fraction of Nyquist")
@click.option(
    "--alarm-flags", is_flag=True,
    help="alarm on flags too: black, dark, over-exposed, obstructed, banded, dead lines, impulses, frozen",
)  # fmt: skip
@click.option(
    "--reference-frames", default=300, show_default=True, type=click.IntRange(100, 100_000),
    help="first frames that the trend is compared with",
)  # fmt: skip
@click.option("--surface", type=GivenPath(), help="measured average precision, as for health")
def command(
    source: str, blur_name: str, noise_name: str, camera_name: str | None, codec: str | None,
    most_tiles: int, most_patches: int, rate: float, no_wait: bool, frames: int | None,
    idle_stop: float | None, window: int, alarm_sigma_dn: float | None, alarm_mtf50: float | None, alarm_flags: bool,
    reference_frames: int, surface: Path | None,
) -> None:  # fmt: skip
    """Watch SOURCE: a camera index, an address (rtsp://...), a video file played as a stream, or a folder that fills.

    Prints JSON lines, each with an "event": start; frame (estimates, flags, and under "state" the medians of the last
    frames in numbers and words); alarm (a threshold that begins to be violated, or a trend: noise or blur that has
    grown since the first frames); cleared (three frames are known to keep the threshold, with none between them that
    violates it; undecided frames between them do not count); undecided (for a whole window of frames a quantity was
    unknown, so that the alarm of its threshold could not be raised); warning (a frame of another size than the camera's
    sharp pictures; sharp pictures that do not look sharp; noise or blur that changed within the reference frames, so
    that its trend is compared with later ones once it is steady); set_aside (a file that cannot be used; in a folder
    also a video, or a HEIC or raw file; of a stream, once, that its frames are interlaced or damaged) and no_signal;
    stop. Of a live source, frames that come while one is analysed are dropped.

    SIGINT, SIGTERM and SIGHUP stop it after the frame at hand; one that is ignored at its start, as SIGHUP by nohup,
    stays so. Exit codes: 0 no alarm; 3 alarms; else 2 for no such source or a video file that is cut short or damaged.
    """
    from pipeline import freed_memory
    from pipeline.cli.addresses import without_credentials
    from pipeline.cli.analysis.frame import FrameAnalysis, Thresholds
    from pipeline.cli.analysis.surface import find_surface
    from pipeline.cli.calibration import camera_store
    from pipeline.cli.frames.pictures import least_side_px
    from pipeline.cli.package_version import version
    from pipeline.cli.watching.loop import Watch
    from pipeline.cli.watching.sources import open_source
    from pipeline.condition import ConditionMonitor
    from pipeline.errors import InputError
    from pipeline.executor import one_thread
    from pipeline.recording.provenance import monitor_weights

    one_thread()
    freed_memory.keep()
    camera = camera_store.load(camera_name) if camera_name is not None else None
    stop = threading.Event()
    with handled((signal.SIGINT, *not_ignored(ENDING_SIGNALS)), _Stop(stop)):
        performance, _ = find_surface(surface)
        came = open_source(source, rate, wait=not no_wait, stop=stop)
        monitor = ConditionMonitor(blur_name, noise_name, most_tiles=most_tiles, most_patches=most_patches)
        thresholds = Thresholds(alarm_sigma_dn, alarm_mtf50, alarm_flags)
        hashes = monitor_weights(monitor)
        if camera is not None:
            camera_store.apply(camera, monitor)
        analysis = FrameAnalysis(
            monitor, thresholds, performance, relative=camera is not None, reference_frames=reference_frames,
            codec=codec or "",
        )  # fmt: skip
        sharp_px = None if camera is None else camera.size_px
        watch = Watch(source, analysis, window, sharp_px, least_side_px(monitor.noise_estimator))
        watch.emit(
            "start", source=without_credentials(source), version=version(), blur_estimator=blur_name,
            noise_estimator=noise_name, weights_released=monitor.weights_released, weights_sha256=hashes,
            camera=camera_name,
        )  # fmt: skip
        if camera is not None and (doubt := camera.doubt()):
            watch.emit("warning", reason=doubt)
        reason = watch.run(came, frames, idle_stop) if not stop.is_set() else "signal"
        reason = "signal" if stop.is_set() else reason
        stop.set()
        watch.emit("stop", reason=reason, frames=watch.frames, alarms=watch.alarms, set_aside=watch.set_aside)
    if watch.alarms:
        raise SystemExit(ALARM)
    if watch.problem and Path(source).is_file():  # a live source or a folder goes on in spite of a bad frame
        raise InputError(watch.problem)


class _Stop:
    """Sets an event at the first signal; a second one interrupts at once."""

    def __init__(self, stop: threading.Event) -> None:
        self.stop = stop

    def __call__(self, number: int, frame: FrameType | None) -> None:
        if self.stop.is_set():
            raise KeyboardInterrupt
        self.stop.set()
