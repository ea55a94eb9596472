"""Noise estimates on single pictures from cameras and codecs: an estimator of white noise beside the default one.

Three kinds of picture, each with a truth per 128 px patch:

    photograph  of a real camera with the mean of many of its scene: deviation of the difference
    JPEG        a sharp frame with white noise, stored as JPEG
    video       consecutive frames with white noise, stored by a video codec, the last one decoded

In the last two the truth is the noise of the decoded picture, from several draws of the noise through the same codec
(`pipeline.camera.processing.temporal_noise`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.answers import asked
from pipeline.camera.constants import FULL_SCALE_DN
from pipeline.camera.processing import codec, develop, temporal_noise
from pipeline.datasets.decoding.pictures import read_grey8
from pipeline.datasets.patches import tiles
from pipeline.errors import InputError
from pipeline.noise.real_noise import TILE_PX, pieces
from pipeline.streams import stream

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.noise.base import NoiseEstimator

SHOTS = 4
Grey = NDArray[np.uint8]
COLUMNS = (
    "example", "estimator", "patches", "answered", "sigma_dn", "low_dn", "high_dn", "reasons", "true_sigma_dn",
    "unclipped_sigma_dn",
)  # fmt: skip


@dataclass(frozen=True)
class Example:
    """A picture with known noise.

    Attributes:
        name: what it is, in words.
        picture: (H, W) grey levels as delivered.
        true_sigma_dn: (N,) noise present in its patches, row by row from the upper left corner, DN.
        unclipped_sigma_dn: noise added before the codec, DN; NaN for a photograph.
    """

    name: str
    picture: Grey
    true_sigma_dn: NDArray[np.float64]
    unclipped_sigma_dn: float


def photograph(name: str, real: Path, mean: Path) -> Example:
    """A photograph of a real camera.

    Args:
        name: in words.
        real: the picture.
        mean: the mean of many pictures of its scene, of the same size.

    Raises:
        InputError: a picture is absent or broken, or they differ in size.
    """
    picture, reference = read_grey8(real), read_grey8(mean)
    if picture.shape != reference.shape:
        raise InputError(f"{real.name} is {picture.shape}, {mean.name} is {reference.shape}; expected the same")
    difference = patches(picture).astype(np.float64) - patches(reference)
    return Example(name, picture, difference.std(axis=(1, 2)), float("nan"))


def stored(name: str, frames: Sequence[Path], sigma_dn: float, how: codec.Codec, seed: int) -> Example:
    """A frame with white noise after a codec.

    Args:
        name: in words.
        frames: sharp frames in the order of time, of one size; the last one is shown.
        sigma_dn: standard deviation of the noise, DN.
        how: the codec; JPEG stores the last frame alone.
        seed: root of the noise's stream.

    Raises:
        InputError: a frame is absent or broken, or frames differ in size.
    """
    sharp = [read_grey8(path) for path in frames]
    if len({frame.shape for frame in sharp}) != 1:
        raise InputError(f"frames: sizes {[frame.shape for frame in sharp]}, expected one size")
    decoded = np.stack([_decoded(sharp, sigma_dn, how, seed, shot) for shot in range(SHOTS)])
    tiles = np.stack([patches(picture) for picture in decoded], axis=1)
    truth = np.array([temporal_noise.measure(shots).sigma_dn for shots in tiles])
    return Example(name, decoded[0], truth, sigma_dn)


def patches(picture: Grey) -> Grey:
    """(N, 128, 128) complete patches side by side, row by row from the upper left corner."""
    squares = pieces(picture, tiles(picture.shape, TILE_PX))
    return np.array(squares, picture.dtype).reshape(-1, TILE_PX, TILE_PX)


def measure(example: Example, estimators: Mapping[str, NoiseEstimator]) -> pd.DataFrame:
    """Medians over the patches of an example.

    Args:
        example: a picture.
        estimators: name in the table -> estimator.

    Returns:
        `COLUMNS`, a row per estimator: medians of the answered patches, NaN without any; ``reasons`` counts the
        abstentions by reason.
    """
    import pandas as pd

    stack = patches(example.picture)[:, None].astype(np.float32) / np.float32(FULL_SCALE_DN)
    rows: list[dict[str, Any]] = []
    for name, estimator in estimators.items():
        answer = asked(f"noise estimator '{name}'", estimator.estimate, stack, "sigma_dn")
        reasons = pd.Series(answer.reason[answer.abstained]).value_counts().sort_index()
        answered = ~answer.abstained

        def median(values: NDArray[np.float64], kept: NDArray[np.bool_] = answered) -> float:
            return float(np.median(values[kept])) if kept.any() else float("nan")

        rows.append(
            {
                "example": example.name,
                "estimator": name,
                "patches": len(stack),
                "answered": int(answered.sum()),
                "sigma_dn": median(answer.sigma_dn),
                "low_dn": median(answer.low_dn),
                "high_dn": median(answer.high_dn),
                "reasons": ", ".join(f"{reason}: {count}" for reason, count in reasons.items()),
                "true_sigma_dn": float(np.median(example.true_sigma_dn)),
                "unclipped_sigma_dn": example.unclipped_sigma_dn,
            }
        )
    return pd.DataFrame(rows)[list(COLUMNS)]


def _decoded(sharp: Sequence[Grey], sigma_dn: float, how: codec.Codec, seed: int, shot: int) -> Grey:
    noisy = []
    for number, frame in enumerate(sharp):
        noise = stream(seed, "noise examples", how.name, shot, number).normal(0, sigma_dn, frame.shape)
        grey = np.clip(np.rint(frame + noise), 0, FULL_SCALE_DN).astype(np.uint8)
        noisy.append(np.repeat(grey[..., None], 3, axis=2))
    decoded = codec.store(noisy[-1], how, noisy[:-1]).astype(np.float64)
    return np.rint(decoded @ develop.LUMA).astype(np.uint8)
