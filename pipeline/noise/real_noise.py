"""Noise estimators on photographs of real cameras whose noise was measured.

A pair is a photograph ``NAME_real.*`` and the mean ``NAME_mean.*`` of many photographs of the same static scene. The
ground truth of a patch is the standard deviation of their difference,

    true sigma = std(real - mean)

It also holds what is not noise: misregistration and drift of light show as a difference wherever the mean varies.
`cleaned` removes it, in blocks of 64 px, by least squares:

    real - mean = a0 + a1 m + a2 dm/dx + a3 dm/dy + a4 laplacian(m) + noise,    m = mean smoothed by 0.8 px

The white part and the correlation of that noise are measured as those of training samples are
(`pipeline.camera.processing.temporal_noise`): the least power in rings of spatial frequency, and lag 1.

Estimators run on the photograph, and on the mean, which is nearly free of noise and shows what they take for it.
Pictures are the independent units: intervals resample pictures, not patches.

Such pairs are those of Nam et al. 2016 ("A holistic approach to cross-channel image noise modeling") and Xu et al. 2018
("Real-world noisy image denoising: a new benchmark").
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.answers import asked
from pipeline.cluster_intervals import cluster_mean
from pipeline.datasets.decoding.pictures import SUFFIXES, read_grey8
from pipeline.datasets.patches import Patch, cut, tiles
from pipeline.errors import InputError
from pipeline.streams import stream

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.noise.base import NoiseEstimate, NoiseEstimator

ESTIMATORS: dict[str, tuple[str, dict[str, Any]]] = {
    "adaptive": ("adaptive", {}),
    "correlated": ("correlated", {}),
    "cellwise": ("cellwise", {}),
    "pca": ("pca", {}),
    "pca_stride_2": ("pca", {"stride": 2}),
    "bf": ("bf", {}),
    "wavelet": ("wavelet", {}),
}
"""Those that are measured by default: name in the table -> registered name and options."""

TILE_PX = 128
BLOCK_PX = 64
SMOOTH_PX = 0.8
REAL, MEAN = "_real", "_mean"

COLUMNS = (
    "picture", "x_px", "y_px", "estimator", "sigma_dn", "low_dn", "high_dn", "white_sigma_dn", "correlation", "reason",
    "at_most_dn", "mean_picture_sigma_dn", "mean_picture_reason", "mean_picture_at_most_dn", "true_sigma_dn",
    "cleaned_sigma_dn", "true_correlation", "true_white_sigma_dn",
)  # fmt: skip

PARTS = {
    "white_sigma_dn": (
        "mean_white_sigma_dn", "true_white_mean_dn", "white_mae_dn", "white_mae_low_dn", "white_mae_high_dn",
    ),
    "correlation": (
        "mean_correlation", "true_correlation_mean", "correlation_mae", "correlation_mae_low", "correlation_mae_high",
    ),
}  # fmt: skip
"""Part of an estimate -> columns of `summarise`: its mean, that of the truth, and the error with its interval."""

SUMMARY_COLUMNS = (
    "estimator", "pictures", "patches", "answered_fraction", "mean_sigma_dn", "mean_picture_answered_fraction",
    "mean_picture_sigma_dn", "correlation_mae",
    *(
        f"{truth}_{name}"
        for truth in ("true", "cleaned")
        for name in ("mean_dn", "mae_dn", "mae_low_dn", "mae_high_dn", "bias_dn", "coverage_fraction")
    ),
    *(column for columns in PARTS.values() for column in columns if column != "correlation_mae"),
)  # fmt: skip


@dataclass(frozen=True)
class Pair:
    """A photograph and the mean of many of its scene.

    Attributes:
        name: what their file names have in common.
        real, mean: the files.
    """

    name: str
    real: Path
    mean: Path


def pairs(folder: str | Path) -> list[Pair]:
    """The pairs of a folder, by name.

    Raises:
        InputError: no such folder, no pair in it, a picture without its partner, or two of one name.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"pairs: no folder {folder}")
    files = [path for path in sorted(folder.iterdir()) if path.suffix.lower() in SUFFIXES]
    halves: dict[str, dict[str, Path]] = {REAL: {}, MEAN: {}}
    for path in files:
        for ending, by_name in halves.items():
            if path.stem.endswith(ending):
                other = by_name.setdefault(path.stem.removesuffix(ending), path)
                if other != path:
                    raise InputError(f"pairs {folder}: {other.name} and {path.name} have one name; keep one of them")
    alone = sorted(set(halves[REAL]) ^ set(halves[MEAN]))
    if alone or not halves[REAL]:
        problem = f"{alone[0]} has no partner" if alone else "no pairs"
        raise InputError(f"pairs {folder}: {problem}; expected NAME_real.* and NAME_mean.* for each NAME")
    return [Pair(name, path, halves[MEAN][name]) for name, path in sorted(halves[REAL].items())]


def cleaned(difference: NDArray[np.floating], mean: NDArray[np.floating]) -> NDArray[np.float64]:
    """A difference of pictures without the part that the mean picture explains; see the module.

    Args:
        difference: (H, W) real - mean, DN.
        mean: (H, W) mean picture, DN.

    Returns:
        (H, W) residual, DN; every block has mean zero.
    """
    import cv2

    smooth = cv2.GaussianBlur(mean.astype(np.float64), (0, 0), SMOOTH_PX)
    terms = (
        np.ones_like(smooth),
        smooth,
        cv2.Sobel(smooth, cv2.CV_64F, 1, 0, scale=1 / 8),
        cv2.Sobel(smooth, cv2.CV_64F, 0, 1, scale=1 / 8),
        cv2.Laplacian(smooth, cv2.CV_64F),
    )
    residual = np.array(difference, dtype=np.float64)
    for y in range(0, residual.shape[0], BLOCK_PX):
        for x in range(0, residual.shape[1], BLOCK_PX):
            block = np.s_[y : y + BLOCK_PX, x : x + BLOCK_PX]
            design = np.stack([term[block].ravel() for term in terms], axis=1)
            target = residual[block].ravel()
            solution = np.linalg.lstsq(design, target, rcond=None)[0]
            residual[block] = (target - design @ solution).reshape(residual[block].shape)
    return residual


def measure(pair: Pair, estimators: Mapping[str, NoiseEstimator], tile_px: int = TILE_PX) -> pd.DataFrame:
    """Estimates and ground truth of every patch of a pair.

    Args:
        pair: the pictures; grey levels are their BT.601 luma, rounded to 8 bit.
        estimators: name in the table -> estimator.
        tile_px: side of the patches, which lie side by side from the upper left corner; a multiple of 8, at least 24.

    Returns:
        `COLUMNS`, a row per patch and estimator; NaN where there is none.

    Raises:
        InputError: pictures of unequal size, or smaller than a patch.
    """
    import pandas as pd

    real, mean = read_grey8(pair.real), read_grey8(pair.mean)
    if real.shape != mean.shape or min(real.shape) < tile_px:
        raise InputError(
            f"pair {pair.name}: {pair.real.name} is {real.shape}, {pair.mean.name} is {mean.shape}; expected the same, "
            f"{tile_px} px or more"
        )
    difference = real.astype(np.float64) - mean
    residual = cleaned(difference, mean)
    squares = tiles(real.shape, tile_px)
    noise, noise_alone = (np.stack(pieces(each, squares)) for each in (difference, residual))
    truth = {
        "picture": pair.name,
        "x_px": [square.x_px for square in squares],
        "y_px": [square.y_px for square in squares],
        "true_sigma_dn": noise.std(axis=(1, 2)),
        "cleaned_sigma_dn": noise_alone.std(axis=(1, 2)),
        "true_correlation": _lag_1(noise_alone),
        "true_white_sigma_dn": [white_sigma_dn(each) for each in noise_alone],
    }
    photograph, reference = cut(real, squares), cut(mean, squares)
    tables = []
    for name, estimator in estimators.items():
        answer, of_mean = (
            asked(f"noise estimator '{name}'", estimator.estimate, shown, "sigma_dn")
            for shown in (photograph, reference)
        )
        columns = answer_columns(name, answer) | {
            "mean_picture_sigma_dn": of_mean.sigma_dn,
            "mean_picture_reason": of_mean.reason,
            "mean_picture_at_most_dn": _or_nan(of_mean, of_mean.at_most_dn),
        }
        tables.append(pd.DataFrame(truth | columns)[list(COLUMNS)])
    return pd.concat(tables, ignore_index=True)


def pieces(picture: NDArray[Any], squares: Sequence[Patch]) -> list[NDArray[Any]]:
    """The pixels of patches as they are: views, where `pipeline.datasets.patches.cut` scales them.

    Args:
        picture: (H, W).
        squares: inside the picture.
    """
    return [picture[each.y_px : each.y_px + each.size_px, each.x_px : each.x_px + each.size_px] for each in squares]


def white_sigma_dn(noise: NDArray[np.float64]) -> float:
    """White part of noise, as it is defined for shots of one scene (`pipeline.camera.processing.temporal_noise`).

    Args:
        noise: (H, W) DN; sides a multiple of 8, at least 24 px.

    Returns:
        standard deviation, DN; that module states by how much it is too low on average.

    Raises:
        InputError: other sides.
    """
    from pipeline.camera.processing import temporal_noise

    opposed = np.stack([noise, -noise]) / np.sqrt(2)  # two shots whose variance over shots is the noise squared
    return float(temporal_noise.measure(opposed.astype(np.float32)).white_sigma_dn)


def answer_columns(name: str, answer: NoiseEstimate) -> dict[str, Any]:
    """The columns of `COLUMNS` that hold an estimate.

    Args:
        name: of the estimator in the table.
        answer: of N patches.
    """
    return {
        "estimator": name,
        "sigma_dn": answer.sigma_dn,
        "low_dn": answer.low_dn,
        "high_dn": answer.high_dn,
        "white_sigma_dn": _or_nan(answer, answer.white_sigma_dn),
        "correlation": _or_nan(answer, answer.correlation),
        "reason": answer.reason,
        "at_most_dn": _or_nan(answer, answer.at_most_dn),
    }


def summarise(table: pd.DataFrame, seed: int = 1, draws: int = 500) -> pd.DataFrame:
    """Figures of each estimator over all patches.

    Args:
        table: `COLUMNS`.
        seed: root of the bootstrap's stream.
        draws: resamples of pictures, with all their patches.

    Returns:
        `SUMMARY_COLUMNS`, a row per estimator, errors in DN over the answered patches: ``patches``, ``pictures``,
        ``answered_fraction``, ``mean_sigma_dn``; ``mean_picture_sigma_dn``, the mean reading on the noise-free means,
        where answered in ``mean_picture_answered_fraction``; ``correlation_mae``; and against each truth, ``true`` and
        ``cleaned``: ``_mean_dn``, its mean, ``_mae_dn`` with the 95 % interval ``_mae_low_dn`` to ``_mae_high_dn``,
        ``_bias_dn`` and ``_coverage_fraction``, patches whose interval holds the truth. Over the answered patches whose
        noise is taken apart: means of estimate and truth, ``mean_white_sigma_dn`` and ``true_white_mean_dn``,
        ``mean_correlation`` and ``true_correlation_mean``, ``white_mae_dn`` with its interval, that of
        ``correlation_mae``. NaN where nothing is answered.
    """
    import pandas as pd

    rows = []
    for name, group in table.groupby("estimator", sort=False):
        answered = group[np.isfinite(group["sigma_dn"])]
        row: dict[str, Any] = {
            "estimator": name,
            "pictures": group["picture"].nunique(),
            "patches": len(group),
            "answered_fraction": len(answered) / len(group),
            "mean_sigma_dn": answered["sigma_dn"].mean(),
            "mean_picture_answered_fraction": np.isfinite(group["mean_picture_sigma_dn"]).mean(),
            "mean_picture_sigma_dn": group["mean_picture_sigma_dn"].mean(),
        }
        bounded = answered[np.isfinite(answered["low_dn"]) & np.isfinite(answered["high_dn"])]
        for truth in ("true", "cleaned"):
            error = answered["sigma_dn"] - answered[f"{truth}_sigma_dn"]
            draw = stream(seed, "real noise", str(name), truth)
            mae, low, high, _ = cluster_mean(error.abs(), answered["picture"], draw, draws, bounds=(0.0, math.inf))
            inside = bounded[f"{truth}_sigma_dn"].between(bounded["low_dn"], bounded["high_dn"])
            row |= {
                f"{truth}_mean_dn": answered[f"{truth}_sigma_dn"].mean(),
                f"{truth}_mae_dn": mae,
                f"{truth}_mae_low_dn": low,
                f"{truth}_mae_high_dn": high,
                f"{truth}_bias_dn": error.mean(),
                f"{truth}_coverage_fraction": inside.mean() if len(bounded) else np.nan,
            }
        rows.append(row | _errors_of_parts(str(name), answered, seed, draws))
    return pd.DataFrame(rows, columns=list(SUMMARY_COLUMNS))


def _errors_of_parts(name: str, answered: pd.DataFrame, seed: int, draws: int) -> dict[str, float]:
    """White part and correlation of `summarise`, over the answered patches of an estimator."""
    result: dict[str, float] = {}
    for part, columns in PARTS.items():
        known = answered[np.isfinite(answered[part])]
        error = (known[part] - known[f"true_{part}"]).abs()
        draw = stream(seed, "real noise", name, part)
        mae, low, high, _ = cluster_mean(error, known["picture"], draw, draws, bounds=(0.0, math.inf))
        numbers = (known[part].mean(), known[f"true_{part}"].mean(), mae, low, high)
        result |= dict(zip(columns, numbers, strict=True))
    return result


def shared_errors(table: pd.DataFrame, reference: str, seed: int = 1, draws: int = 500) -> pd.DataFrame:
    """Mean absolute error of each estimator on the patches that a reference estimator answers, too.

    An estimator that abstains from hard patches has a smaller error for it; on the same patches errors can be compared.

    Args:
        table: `COLUMNS`; estimators of one table have the same patches in the same order.
        reference: name of the estimator in the table.
        seed: root of the bootstrap's stream.
        draws: resamples of pictures, with all their patches.

    Returns:
        a row per estimator: ``shared_patches`` that both answer; against each truth, ``true`` and ``cleaned``,
        ``_shared_mae_dn`` in DN with the 95 % interval ``_shared_mae_low_dn`` to ``_shared_mae_high_dn``. No row
        without a shared patch, as where the reference is not in the table.
    """
    import pandas as pd

    is_answered = np.isfinite(table["sigma_dn"])
    number = table.groupby("estimator").cumcount()  # colour planes of a raw picture have patches in the same places
    of_reference = set(number[is_answered & (table["estimator"] == reference)])
    rows = []
    for name, group in table[is_answered & number.isin(of_reference)].groupby("estimator", sort=False):
        row: dict[str, Any] = {"estimator": name, "shared_patches": len(group)}
        for truth in ("true", "cleaned"):
            error = (group["sigma_dn"] - group[f"{truth}_sigma_dn"]).abs()
            draw = stream(seed, "real noise", "shared", str(name), truth)
            ends = cluster_mean(error, group["picture"], draw, draws, bounds=(0.0, math.inf))
            columns = (f"{truth}_shared_mae_dn", f"{truth}_shared_mae_low_dn", f"{truth}_shared_mae_high_dn")
            row |= dict(zip(columns, ends, strict=False))
        rows.append(row)
    names = [f"{truth}_shared_mae_{end}dn" for truth in ("true", "cleaned") for end in ("", "low_", "high_")]
    return pd.DataFrame(rows, columns=["estimator", "shared_patches", *names])


def estimators(kinds: Mapping[str, tuple[str, Mapping[str, Any]]]) -> dict[str, NoiseEstimator]:
    """Estimators by the name they have in a table.

    Args:
        kinds: name -> registered name and options.

    Raises:
        InputError: see `pipeline.noise.create`.
    """
    from pipeline.noise import create

    return {name: create(kind, **options) for name, (kind, options) in kinds.items()}


def _lag_1(residual: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,) mean correlation of horizontally and vertically adjacent pixels of (N, H, W); 0 where all are equal."""
    centred = residual - residual.mean(axis=(1, 2), keepdims=True)
    products = (centred[:, :, 1:] * centred[:, :, :-1]).mean(axis=(1, 2))
    products += (centred[:, 1:] * centred[:, :-1]).mean(axis=(1, 2))
    variance = (centred**2).mean(axis=(1, 2))
    return np.asarray(products / 2 / np.where(variance > 0, variance, np.inf))


def _or_nan(answer: NoiseEstimate, values: NDArray[np.float64] | None) -> NDArray[np.float64]:
    return np.full(len(answer), np.nan) if values is None else values
