"""``camera-monitor advise``: the best exposure and gain for one's own pictures, and why."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import click

from pipeline.errors import InputError

SURFACE = Path("data/control_surface/all.npz")
_TIME = re.compile(r"^(?P<number>[0-9.]+(?:/[0-9.]+)?)\s*(?P<unit>us|ms|s)$")
_UNITS = {"us": 1e-6, "ms": 1e-3, "s": 1.0}
_EXIF_IFD, _EXPOSURE_TIME, _ISO = 0x8769, 33434, 34855


@click.command("advise")
@click.argument("paths", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--exposure", help="exposure time of the pictures, e.g. 4ms or 1/250s; from EXIF if left out")
@click.option("--iso", type=float, help="their ISO; from EXIF if left out")
@click.option("--speed", type=float, help="speed of the image, px/s, where it is known; else from the blur")
@click.option("--sensor", default="paper", show_default=True, help="sensor preset, for predicting noise")
@click.option("--exposure-max", default="33ms", show_default=True, help="longest exposure time allowed")
@click.option("--iso-max", default=3200.0, show_default=True, type=float, help="highest ISO allowed")
@click.option("--surface", default=SURFACE, show_default=True, type=click.Path(path_type=Path), help="of control")
def command(
    paths: tuple[Path, ...], exposure: str | None, iso: float | None, speed: float | None, sensor: str,
    exposure_max: str, iso_max: float, surface: Path,
) -> None:  # fmt: skip
    """Advise exposure time and gain for PATHS: pictures, videos, or folders of them.

    Prints one JSON object per frame: estimated noise and motion blur, the average precision expected at the present
    settings with its 95 % interval, the best settings inside the limits, and the reason. Where the estimators
    abstain or nothing was measured, the action says so.
    """
    from pipeline.camera.exposure import Camera
    from pipeline.camera.sensor import named
    from pipeline.cli.pictures import expand, read
    from pipeline.condition import ConditionMonitor
    from pipeline.control.advice import advise
    from pipeline.control.performance import Performance
    from pipeline.control.policy import ControlledCamera
    from pipeline.control.state import BASE_ISO, CameraState, Limits
    from pipeline.executor import one_thread

    one_thread()
    if speed is not None and not (math.isfinite(speed) and speed >= 0):
        raise InputError(f"--speed {speed}: expected a speed of at least 0 px/s")
    limits = Limits(exposure_max_s=seconds(exposure_max, "--exposure-max"), gain_max=iso_max / BASE_ISO)
    camera = ControlledCamera(limits, Camera(named(sensor)))
    performance, monitor = Performance.load(surface), ConditionMonitor()
    for path in expand(paths):
        time, gain = settings(path, exposure, iso)
        state = CameraState(time, gain / BASE_ISO)
        for name, image in read(path):
            advice = advise(image, state, camera, performance, monitor, speed)
            row = {key: _plain(value) for key, value in advice.row().items()}
            click.echo(json.dumps({"picture": name, **row}))


def seconds(text: str, option: str) -> float:
    """A time such as ``4ms``, ``250us`` or ``1/250s`` in seconds.

    Raises:
        InputError: naming the option.
    """
    match = _TIME.match(text.strip())
    try:
        if match is None:
            raise ValueError
        number, _, divisor = match["number"].partition("/")
        value = float(number) / (float(divisor) if divisor else 1.0) * _UNITS[match["unit"]]
        if not value > 0:
            raise ValueError
    except (ValueError, ZeroDivisionError):
        raise InputError(f"{option} {text}: expected a time with its unit, e.g. 4ms, 250us or 1/250s") from None
    return value


def settings(path: Path, exposure: str | None, iso: float | None) -> tuple[float, float]:
    """Exposure time in seconds and ISO of a picture: as given, else from its EXIF data.

    Raises:
        InputError: neither given nor in the file.
    """
    found = exif(path) if exposure is None or iso is None else (None, None)
    time = seconds(exposure, "--exposure") if exposure is not None else found[0]
    gain = iso if iso is not None else found[1]
    for option, value in (("--exposure", time), ("--iso", gain)):
        if value is None:
            raise InputError(f"{path}: no EXIF data say its settings; give {option}")
        if not (math.isfinite(value) and value > 0):
            raise InputError(f"{path}: {option} {value:g}: expected a number above 0")
    assert time is not None and gain is not None
    return time, gain


def exif(path: Path) -> tuple[float | None, float | None]:
    """Exposure time in seconds and ISO from a picture's EXIF data, None where absent."""
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path) as picture:
            tags = picture.getexif().get_ifd(_EXIF_IFD)
    except (OSError, UnidentifiedImageError):
        return None, None
    time, gain = tags.get(_EXPOSURE_TIME), tags.get(_ISO)
    if isinstance(gain, (tuple, list)):
        gain = gain[0] if gain else None
    return None if time is None else float(time), None if gain is None else float(gain)


def _plain(value: object) -> object:
    """JSON has no NaN: it becomes null; numbers keep four digits."""
    if isinstance(value, float):
        return None if not math.isfinite(value) else float(f"{value:.4g}")
    return value
