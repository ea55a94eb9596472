"""How often flags of noise and of lines are raised: with nothing to be flagged, and with what they name.

These are ``banded``, ``dead_lines`` and ``impulses``.

`rates` is of whole frames of a dataset, grey, in whole levels. *False* rates are of the frames with white noise of 0 to
25 DN, as they are or stored by a codec; ``sharpened`` ones were sharpened (unsharp mask, 1.2 px, twice the difference)
after the noise was added. *True* rates are of the frames as they are with offsets of whole rows or columns, normal and
independent, with one dead (0 DN), hot (255 DN) or half-gain row or column, or with salt and pepper (half of the pixels
black, half white), as they are or stored as JPEG of quality 90. Frames of recorded datasets have noise of their own.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.camera.processing.codec import VIDEO, Codec, store
from pipeline.condition.dead_lines import dead_lines
from pipeline.condition.frame_flags import BANDED_DN, IMPULSE_FRACTION
from pipeline.condition.impulses import impulse_fraction
from pipeline.condition.row_noise import column_noise_dn, row_noise_dn
from pipeline.datasets.decoding.pictures import SUFFIXES, read_grey8
from pipeline.streams import stream

Frame = NDArray[np.uint8]

SEED = 1
WHITE_DN = (0.0, 5.0, 10.0, 25.0)
CODECS = (Codec("none"), *(Codec("jpeg", quality) for quality in (60, 80, 95)), Codec("h264", 23))
OFFSETS_DN = (1.0, 2.0, 5.0, 10.0, 20.0)
DEAD = {"dead": (0.0, 0.0), "hot": (0.0, 255.0), "half-gain": (0.5, 0.0)}  # gain, and level added in DN
IMPULSE_FRACTIONS = (1e-4, 1e-3, 1e-2, 5e-2)
AFTER = (Codec("none"), Codec("jpeg", 90))  # what frames with defects are stored by
FRAMES_BEFORE = 2
LEAST_SIDE_PX = 128


def frames_below(folder: Path) -> Iterator[tuple[str, Frame]]:
    """Name and grey levels of every picture in a folder or below it, whose sides have `LEAST_SIDE_PX` or more."""
    for path in sorted(path for path in folder.rglob("*") if path.suffix.lower() in SUFFIXES):
        frame = read_grey8(path)
        if min(frame.shape) >= LEAST_SIDE_PX:
            yield path.relative_to(folder).as_posix(), frame


def rates(dataset: str, frames: Iterable[tuple[str, Frame]]) -> dict[str, Any]:
    """Share of the frames in which each flag is raised.

    Args:
        dataset: name, of the random streams.
        frames: name and (H, W) grey levels of each.

    Returns:
        ``frames``, their number, and ``false`` and ``true``: condition -> `_summary` of the measures.
    """
    measures: dict[str, dict[str, list[dict[str, float]]]] = {"false": {}, "true": {}}
    count = 0
    for name, frame in frames:
        count += 1
        for part, pictures in (("false", _clean(frame, dataset, name)), ("true", _defective(frame, dataset, name))):
            for condition, picture in pictures:
                measures[part].setdefault(condition, []).append(measured(picture))
    summaries = {
        part: {condition: _summary(rows) for condition, rows in conditions.items()}
        for part, conditions in measures.items()
    }
    return {"frames": count, **summaries}


def measured(levels: Frame) -> dict[str, float]:
    """The measures behind the flags: ``row_noise_dn``, ``column_noise_dn``, ``dead_lines`` and ``impulse_fraction``."""
    return {
        "dead_lines": dead_lines(levels),
        "row_noise_dn": row_noise_dn(levels),
        "column_noise_dn": column_noise_dn(levels),
        "impulse_fraction": impulse_fraction(levels),
    }


def _summary(rows: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Shares of frames flagged, medians and greatest of each measure; what cannot be measured raises no flag."""
    values = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    banded = (values["row_noise_dn"] > BANDED_DN) | (values["column_noise_dn"] > BANDED_DN)
    content = {
        "banded": round(float(banded.mean()), 4),
        "dead_lines": round(float(np.mean(~banded & (values["dead_lines"] > 0))), 4),
        "impulses": round(float(np.mean(values["impulse_fraction"] > IMPULSE_FRACTION)), 4),
    }
    for name, column in values.items():
        known = column[np.isfinite(column)]
        if known.size:
            digits = 6 if name == "impulse_fraction" else 2
            content |= {
                f"median_{name}": round(float(np.median(known)), digits),
                f"greatest_{name}": round(float(known.max()), digits),
            }
    return content


def _clean(frame: Frame, *key: str) -> Iterator[tuple[str, Frame]]:
    """Condition and picture of everything that is to raise none of the flags."""
    for sigma_dn in WHITE_DN:
        draws = stream(SEED, "flag rates", "white", *key, sigma_dn)
        shots = [_levels(frame + draws.normal(0, sigma_dn, frame.shape)) for _ in range(1 + FRAMES_BEFORE)]
        for codec in CODECS:
            before = shots[1:] if codec.name in VIDEO else []
            yield f"{sigma_dn:g} DN, {_described(codec)}", _stored(shots[0], codec, before)
        noisy = shots[0].astype(np.float32)
        yield f"{sigma_dn:g} DN, sharpened", _levels(noisy + 2 * (noisy - cv2.GaussianBlur(noisy, (0, 0), 1.2)))


def _defective(frame: Frame, *key: str) -> Iterator[tuple[str, Frame]]:
    """Condition and picture of everything that is to raise one of the flags."""
    for codec in AFTER:
        for sigma_dn in OFFSETS_DN:
            for lines, shape in (("rows", (frame.shape[0], 1)), ("columns", (1, frame.shape[1]))):
                offsets = stream(SEED, "flag rates", lines, *key, sigma_dn).normal(0, sigma_dn, shape)
                yield f"{lines} {sigma_dn:g} DN, {_described(codec)}", _stored(_levels(frame + offsets), codec)
        draws = stream(SEED, "flag rates", "dead lines", *key)
        for axis, lines in enumerate(("row", "column")):
            number = int(draws.integers(4, frame.shape[axis] - 4))
            for state, (gain, level_dn) in DEAD.items():
                faulty = np.moveaxis(frame.astype(np.float32), axis, 0)
                faulty[number] = gain * faulty[number] + level_dn
                yield f"{state} {lines}, {_described(codec)}", _stored(_levels(np.moveaxis(faulty, 0, axis)), codec)
        for fraction in IMPULSE_FRACTIONS:
            drawn = stream(SEED, "flag rates", "impulses", *key, fraction).random(frame.shape)
            salted = np.where(drawn < fraction / 2, 0, np.where(drawn > 1 - fraction / 2, 255, frame))
            yield f"impulses {fraction:g}, {_described(codec)}", _stored(_levels(salted), codec)


def _stored(frame: Frame, codec: Codec, before: Iterable[Frame] = ()) -> Frame:
    """A grey frame as it comes back from a codec."""
    picture, *others = (np.repeat(grey[..., None], 3, axis=2) for grey in (frame, *before))
    return _levels(store(picture, codec, others).mean(axis=2))


def _levels(values: NDArray[Any]) -> Frame:
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)


def _described(codec: Codec) -> str:
    return codec.name if codec.name == "none" else f"{codec.name} {codec.quality}"
