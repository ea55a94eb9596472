"""Noise estimators on recordings of real cameras, as one experiment.

Pairs: a photograph and the mean of many of its scene; the truth is the deviation of their difference
(`pipeline.noise.real_noise`).

Raw frames: their noise is white and follows the photon transfer of the sensor,

    sigma^2 = c + K (mu - black)

with K and c measured from the same frames (`pipeline.experiments.real_noise.sensor_constants`). This is the cleaned
truth: what differs from shot to shot. A single frame also holds what pixels differ by in every shot, the fixed pattern,
as white and as fine as noise: with it,

    sigma^2 = c + K (mu - black) + s^2 (mu - black)^2

is the raw truth, an upper limit, for s holds the finest grain of the scene, too. Patches are of single colour planes,
neither clipped nor brighter than 40 of 255 DN, where the fixed pattern would exceed the noise. Estimators are given raw
grey values over full scale, which is 255 DN or, of deeper converters, white; tables are in DN of the frames.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.answers import asked
from pipeline.camera.characterisation import emva1288
from pipeline.camera.constants import FULL_SCALE_DN
from pipeline.datasets.decoding.raw_frames import RawFrame
from pipeline.datasets.patches import tiles
from pipeline.noise import real_noise
from pipeline.noise.real_noise import COLUMNS, Pair

if TYPE_CHECKING:
    import pandas as pd

Kinds = Mapping[str, tuple[str, Mapping[str, Any]]]
Executor = Callable[..., list[Any]]

BRIGHTEST_DN = 40.0
"""Mean of a raw patch, above black, up to which shot noise exceeds a fixed pattern of a few hundredths; of 8 bits."""


def measure_pairs(folder: Path, kinds: Kinds, executor: Executor, label: str = "") -> pd.DataFrame:
    """Estimates and truth of every patch of the pairs of a folder.

    Args:
        folder: with pairs, see `pipeline.noise.real_noise.pairs`.
        kinds: name in the table -> registered estimator and its options.
        executor: maps a function over items, see `pipeline.executor.run_map`; changes no result.
        label: for its progress.

    Returns:
        `pipeline.noise.real_noise.COLUMNS`.

    Raises:
        InputError: the folder, a picture or weights are absent or broken, or there is no such estimator.
    """
    import pandas as pd

    tables = executor(partial(_of_pair, kinds=kinds), real_noise.pairs(folder), label=label)
    return pd.concat(tables, ignore_index=True)


def measure_raw(
    frames: Sequence[RawFrame],
    fits: Mapping[str, emva1288.PhotonTransfer],
    white_dn: float,
    kinds: Kinds,
    executor: Executor,
    label: str = "",
) -> pd.DataFrame:
    """Estimates and truth of patches of raw frames.

    Args:
        frames: of lit scenes.
        fits: colour plane -> its photon transfer.
        white_dn: grey value of saturation, DN.
        kinds: name in the table -> registered estimator and its options.
        executor: maps a function over items, see `pipeline.executor.run_map`; changes no result.
        label: for its progress.

    Returns:
        `pipeline.noise.real_noise.COLUMNS`; ``picture`` is the frame's name, the cleaned truth is
        white, and there is no mean picture. No row where no patch is dark enough.
    """
    import pandas as pd

    parts = executor(partial(_of_frame, fits=fits, white_dn=white_dn, kinds=kinds), frames, label=label)
    tables = [table for part in parts for table in part]
    return pd.concat(tables, ignore_index=True)[list(COLUMNS)] if tables else pd.DataFrame(columns=list(COLUMNS))


def real_noise_metrics(summary: pd.DataFrame) -> dict[str, Any]:
    """Errors, coverage and answered share of each estimator.

    Args:
        summary: `pipeline.noise.real_noise.summarise`.
    """
    names = ("answered_fraction", "mean_picture_sigma_dn", "true_mae_dn", "cleaned_mae_dn", "cleaned_coverage_fraction")
    return {
        str(row["estimator"]): {name: row[name] for name in names if np.isfinite(row[name])}
        for row in summary.to_dict("records")
    }


def _of_pair(pair: Pair, kinds: Kinds) -> pd.DataFrame:
    return real_noise.measure(pair, real_noise.estimators(kinds))


def _of_frame(
    frame: RawFrame, fits: Mapping[str, emva1288.PhotonTransfer], white_dn: float, kinds: Kinds
) -> list[pd.DataFrame]:
    """Tables of the colour planes of one frame that hold a usable patch."""
    import pandas as pd

    estimators, pixels, parts = real_noise.estimators(kinds), frame.pixels(), []
    scale = _scale(white_dn)
    for plane, fit in fits.items():
        grey = emva1288.plane(pixels, plane)
        every = tiles(grey.shape, real_noise.TILE_PX)
        beside = zip(every, real_noise.pieces(grey, every), strict=True)
        squares = [square for square, piece in beside if _usable(piece, white_dn, fit)]
        if not squares:
            continue
        patches = np.stack(real_noise.pieces(grey, squares))
        mean = patches.mean(axis=(1, 2))
        truth = {
            "picture": frame.path.stem,
            "x_px": [square.x_px for square in squares],
            "y_px": [square.y_px for square in squares],
            "mean_picture_sigma_dn": np.nan,
            "mean_picture_reason": "",
            "mean_picture_at_most_dn": np.nan,
            "true_sigma_dn": fit.sigma_with_pattern_dn(mean),
            "cleaned_sigma_dn": fit.sigma_dn(mean),
            "true_correlation": 0.0,
            "true_white_sigma_dn": fit.sigma_dn(mean),
        }
        for name, estimator in estimators.items():
            shown = patches[:, None].astype(np.float32) / np.float32(FULL_SCALE_DN * scale)
            answer = asked(f"noise estimator '{name}'", estimator.estimate, shown, "sigma_dn")
            columns = real_noise.answer_columns(name, answer)
            in_dn = {column: values * scale for column, values in columns.items() if column.endswith("_dn")}
            parts.append(pd.DataFrame(truth | columns | in_dn))
    return parts


def _scale(white_dn: float) -> float:
    """DN of the frames in one DN of 8 bits."""
    return max(white_dn, FULL_SCALE_DN) / FULL_SCALE_DN


def _usable(patch: Any, white_dn: float, fit: emva1288.PhotonTransfer) -> bool:
    """Whether a patch is neither cut off at black nor clipped at white nor too bright."""
    lowest_dn = emva1288.LOWEST_STEPS * fit.step_dn
    bright_enough = lowest_dn <= patch.mean() - fit.black_dn <= BRIGHTEST_DN * _scale(white_dn)
    return bool(bright_enough and patch.max() < emva1288.CLIPPED_FRACTION * white_dn)
