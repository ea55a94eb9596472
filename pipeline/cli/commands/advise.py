"""``camera-monitor advise``: the best exposure and gain for one's own pictures, and why."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from pipeline.cli.options.given_paths import GivenPath
from pipeline.cli.options.numbers import FiniteRange
from pipeline.cli.options.video_codec import codec_option
from pipeline.cli.results.numbers import json_number
from pipeline.errors import InputError, printable

if TYPE_CHECKING:
    from pipeline.control.state import Limits


@click.command("advise")
@click.argument("paths", nargs=-1, required=True, type=GivenPath())
@click.option("--exposure", help="exposure time of the pictures, e.g. 4ms or 1/250s; from EXIF if left out")
@click.option("--iso", type=FiniteRange(1, 1_000_000), help="their ISO; from EXIF if left out")
@click.option(
    "--speed", type=FiniteRange(0, 1e9), help="speed of the image, px/s, where it is known; else from the blur"
)
@click.option(
    "--sensor", default="paper", show_default=True, help="for predicting noise: preset, or record of a sensor"
)
@click.option(
    "--base-iso", default=100.0, show_default=True, type=FiniteRange(1, 1_000_000),
    help="ISO at which the sensor's constants hold: the lowest, or that of the recorded raw frames",
)  # fmt: skip
@click.option("--exposure-max", default="33ms", show_default=True, help="longest exposure time allowed")
@click.option(
    "--iso-max", default=3200.0, show_default=True, type=FiniteRange(100, 1_000_000), help="highest ISO allowed"
)
@click.option("--camera", "camera_name", help="of which blur is calibrated, as camera-monitor calibrate stored it")
@codec_option
@click.option("--surface", type=GivenPath(), help="of average precision; by default data/control_surface/all.npz")
def command(
    paths: tuple[Path, ...], exposure: str | None, iso: float | None, speed: float | None, sensor: str,
    base_iso: float, exposure_max: str, iso_max: float, camera_name: str | None, codec: str | None,
    surface: Path | None,
) -> None:  # fmt: skip
    """Advise exposure time and gain for PATHS: pictures, videos, or folders of them.

    Prints one JSON object per frame: estimated noise and motion blur, the average precision expected at the present
    settings with its 95 % interval, the best settings inside the limits (from 50 us and ISO 100 to --exposure-max and
    --iso-max), and the reason. Where a codec hides the noise but there is a bound, the advised settings are better with
    any noise up to it, and best_ap_percent is the least of these. Where the estimators abstain or nothing was measured,
    the action states it. Pictures taken with settings outside the limits get settings inside them. A file that cannot
    be used is named on standard error and left out.

    Without --camera a lens softer than that of the surface counts as motion.

    Exit codes: 0 done; 2 if a file could not be used; 130 interrupted.
    """
    from collections import Counter

    from pipeline.camera.exposure import Camera
    from pipeline.cli.analysis.frame import system_mtf
    from pipeline.cli.analysis.surface import find_surface
    from pipeline.cli.calibration import camera_store
    from pipeline.cli.frames.given_files import expand
    from pipeline.cli.frames.pictures import least_side_px, readable
    from pipeline.cli.frames.set_aside import SetAside
    from pipeline.cli.frames.shot_settings import seconds, with_settings
    from pipeline.condition import ConditionMonitor
    from pipeline.control.advice import advise
    from pipeline.control.policy import ControlledCamera
    from pipeline.control.state import BASE_ISO, CameraState
    from pipeline.executor import one_thread
    from pipeline.recording.measured_sensor import sensor_of, with_lower_gain

    one_thread()
    if exposure is not None:
        seconds(exposure, "--exposure")
    limits = _limits(exposure_max, iso_max)
    stored = None if camera_name is None else camera_store.load(camera_name)
    model = with_lower_gain(sensor_of(sensor).sensor, base_iso / BASE_ISO)  # gain 1 is ISO 100 below
    camera = ControlledCamera(limits, Camera(model))
    files = expand(paths)
    performance, without = find_surface(surface)
    if performance is None:
        raise InputError(without)
    monitor = ConditionMonitor()
    if stored is not None:
        camera_store.apply(stored, monitor)
        if doubt := stored.doubt():
            click.echo(f"warning: {doubt}", err=True)
    hinted, set_aside = Counter[int](), SetAside()
    sharp_px = None if stored is None else stored.size_px
    for path, exposure_s, known_iso in with_settings(files, exposure, iso, set_aside):
        state = CameraState(exposure_s, known_iso / BASE_ISO)
        for name, image, problem, coding in readable([path], 1, hinted, least_side_px(monitor.noise_estimator)):
            try:
                if image is None:
                    raise InputError(problem)
                known = coding.or_by(codec or "")
                condition = monitor.frame(image, known.codec, known.quantiser)
                if sharp_px is not None and image.shape != sharp_px:
                    reason = camera_store.of_other_size(printable(name), image.shape, [sharp_px])
                    click.echo(f"warning: {reason}", err=True)
                    sharp_px = None  # once is enough
                if stored is not None:
                    condition = system_mtf(condition, performance.reference)
                advice = advise(image, state, camera, performance, speed_px_s=speed, condition=condition)
            except InputError as error:
                set_aside.add(name, error)
                continue
            row = {
                key: json_number(value) if isinstance(value, float) else value for key, value in advice.row().items()
            }
            click.echo(json.dumps({"picture": name, **row}))
    set_aside.refuse()


def _limits(exposure_max: str, iso_max: float) -> Limits:
    """The limits of advised settings.

    Raises:
        InputError: the longest exposure time is no time, or shorter than the shortest that is advised.
    """
    from pipeline.cli.frames.shot_settings import seconds
    from pipeline.control.state import BASE_ISO, Limits

    exposure_max_s = seconds(exposure_max, "--exposure-max")
    if exposure_max_s < Limits.exposure_min_s:
        shortest = f"{1e6 * Limits.exposure_min_s:g} us"
        raise InputError(f"--exposure-max {exposure_max}: expected at least {shortest}, the shortest time advised")
    return Limits(exposure_max_s=exposure_max_s, gain_max=iso_max / BASE_ISO)
