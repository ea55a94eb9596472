"""Exposure time and ISO that a picture was taken with: as given on the command line, else from its EXIF data."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.errors import DECODER_ERRORS, InputError, printable

if TYPE_CHECKING:
    from pipeline.cli.frames.set_aside import SetAside

_TIME = re.compile(r"^(?P<number>[0-9.]+(?:/[0-9.]+)?)\s*(?P<unit>us|ms|s)$")
_PER_SECOND = {"us": 1e6, "ms": 1e3, "s": 1.0}
_EXIF_IFD, _EXPOSURE_TIME, _ISO = 0x8769, 33434, 34855
_ISO_OVERFLOW = 65535  # of a tag of 16 bits: the value, if any, is in one of the tags that follow
_SENSITIVITY_TYPE, _OUTPUT, _RECOMMENDED, _SPEED = 0x8830, 0x8831, 0x8832, 0x8833
_BY_TYPE = {
    1: (_OUTPUT,), 2: (_RECOMMENDED,), 3: (_SPEED,), 4: (_OUTPUT, _RECOMMENDED), 5: (_OUTPUT, _SPEED),
    6: (_RECOMMENDED, _SPEED), 7: (_OUTPUT, _RECOMMENDED, _SPEED),
}  # fmt: skip
"""The tags of which PhotographicSensitivity is the value, by SensitivityType. Source: CIPA DC-008 (Exif 2.3), 4.6.5."""


def seconds(text: str, option: str) -> float:
    """A time such as ``4ms``, ``250us`` or ``1/250s`` in seconds.

    Args:
        text: the time with its unit.
        option: the command-line option that gave it, for the message.

    Raises:
        InputError: not such a time; names the option.
    """
    match = _TIME.match(text.strip())
    try:
        if match is None:
            raise ValueError
        number, _, divisor = match["number"].partition("/")
        value = float(number) / (float(divisor) if divisor else 1.0) / _PER_SECOND[match["unit"]]
        if not (value > 0 and math.isfinite(value)):
            raise ValueError
    except (ValueError, ZeroDivisionError):
        raise InputError(f"{option} {text}: expected a time with its unit, e.g. 4ms, 250us or 1/250s") from None
    return value


def shot_settings(path: Path, exposure: str | None, iso: float | None) -> tuple[float | None, float | None]:
    """Exposure time and ISO of a picture; its file is opened only where one of them is not given.

    Args:
        path: the picture.
        exposure: text such as ``4ms``, or None for that of the EXIF data.
        iso: ISO, or None likewise.

    Returns:
        exposure time in seconds and ISO, each None where it is neither given nor in the file.

    Raises:
        InputError: the text is no time.
    """
    exposure_s = seconds(exposure, "--exposure") if exposure is not None else None
    if exposure_s is None or iso is None:
        stored = exif(path)
        exposure_s = stored[0] if exposure_s is None else exposure_s
        iso = stored[1] if iso is None else iso
    return exposure_s, iso


def with_settings(
    files: Iterable[Path], exposure: str | None, iso: float | None, set_aside: SetAside
) -> Iterator[tuple[Path, float, float]]:
    """Pictures with their exposure time in seconds and ISO, as `shot_settings` has them.

    Args:
        files: pictures.
        exposure: see `shot_settings`.
        iso: see there.
        set_aside: names those of which one is neither given nor in the EXIF data, which are left out.
    """
    for path in files:
        time_s, known_iso = shot_settings(path, exposure, iso)
        if time_s is None or known_iso is None:
            missing = {"exposure time": "--exposure"} if time_s is None else {}
            missing |= {"ISO": "--iso"} if known_iso is None else {}
            names, options = " and ".join(missing), " and ".join(missing.values())
            verb = "is" if len(missing) == 1 else "are"
            reason = f"{printable(path)}: its {names} {verb} in no EXIF data; give {options}"
            set_aside.add(str(path), InputError(reason))
        else:
            yield path, time_s, known_iso


def exif(path: Path) -> tuple[float | None, float | None]:
    """Exposure time in seconds and ISO from a picture's EXIF data, None where absent or not a number above 0.

    ISO above 65534, which the tag PhotographicSensitivity cannot hold, is read from the tags that Exif 2.3 has for it.
    """
    from PIL import Image

    from pipeline.cli.frames import picture_file

    try:
        tags = picture_file.exif(path, _EXIF_IFD)
    except (*DECODER_ERRORS, Image.DecompressionBombError):
        return None, None
    return _positive(tags.get(_EXPOSURE_TIME)), _sensitivity(tags)


def _sensitivity(tags: Mapping[int, object]) -> float | None:
    """ISO by the tags of EXIF data; None where it is absent, or only stated to be beyond 16 bits."""
    iso = _positive(_first(tags.get(_ISO)))
    if iso != _ISO_OVERFLOW:
        return iso
    kinds = _BY_TYPE.get(_integer(tags.get(_SENSITIVITY_TYPE)), (_RECOMMENDED, _OUTPUT, _SPEED))
    values = [_positive(_first(tags.get(kind))) for kind in kinds]
    return next((value for value in values if value is not None), None)


def _first(value: object) -> object:
    return value[0] if isinstance(value, (tuple, list)) and value else value


def _integer(value: object) -> int:
    """The number; 0 where it is none."""
    return value if isinstance(value, int) else 0


def _positive(value: object) -> float | None:
    """The number, or None where it is none, not finite or not above 0."""
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, ZeroDivisionError):
        return None
    return number if math.isfinite(number) and number > 0 else None
