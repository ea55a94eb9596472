"""What estimators say of the blur alone: the disc that smoothed a patch divided out, raw and calibrated."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pipeline.blur.denoise import EPSILON, divided
from pipeline.blur.evaluation import SHARP, calibrated
from pipeline.camera import mtf
from pipeline.camera.psf.defocus import create as disc

if TYPE_CHECKING:
    import pandas as pd

CELL = ["dataset", "estimator", "experiment", "effect", "level_dn", "kind", "size_px", "filter_px"]
"""What the answers of one cell of the tables have in common."""


def cleared(read: pd.DataFrame, epsilon: float = EPSILON) -> pd.DataFrame:
    """Estimates of the blur alone: smoothed rows divided by the MTF of their disc (`pipeline.blur.denoise.divided`).

    Args:
        read: `BLUR_READ`, calibrated or not.
        epsilon: below it an MTF is taken for noise.

    Returns:
        the same rows; frequencies that fail a condition are NaN, and a patch of which none is left abstains, "noise".
    """
    changed = read.copy()
    known = np.ones(len(read))
    for filter_px in read.loc[read["smoothed"], "filter_px"].unique():
        exact = mtf.sample(disc(float(filter_px)))
        for axis, point in np.ndindex(2, len(mtf.FREQUENCIES)):
            here = (read["filter_px"] == filter_px) & (read["axis"] == "HV"[axis])
            known[(here & np.isclose(read["frequency"], mtf.FREQUENCIES[point])).to_numpy()] = exact[axis, point]
    smoothed = read["smoothed"].to_numpy(bool)
    clear = np.where(smoothed, divided(read["mtf"].to_numpy(float), known, epsilon), read["mtf"].to_numpy(float))
    changed["mtf"] = clear
    for name in ("low", "high"):
        end = read[name].to_numpy(float)
        end = np.where(smoothed, np.clip(end / np.maximum(known, epsilon), 0.0, 1.0), end)
        changed[name] = np.where(np.isnan(clear), np.nan, end)
    patch = ["dataset", "estimator", "experiment", "kernel", "level_dn", "frame", "patch", "filter_px"]
    nothing = changed["mtf"].isna().groupby([changed[key] for key in patch]).transform("all").to_numpy(bool)
    lost = nothing & ~read["abstained"].to_numpy(bool)
    changed["abstained"] = read["abstained"].to_numpy(bool) | lost
    changed["reason"] = np.where(lost, "noise", read["reason"].astype(str))
    return changed


def answers(read: pd.DataFrame) -> list[tuple[bool, pd.DataFrame]]:
    """What the estimators say of the blur alone, raw and calibrated.

    Args:
        read: `BLUR_READ` with the sharp frames.

    Returns:
        (False, raw) and (True, calibrated); an estimator without an answer for sharp frames is not in the latter, and
        neither holds the sharp frames.
    """
    sharp = read[read["kernel"] == SHARP]
    keys = ["estimator", "axis", "frequency"]
    known = sharp["mtf"].notna().groupby([sharp[key] for key in keys]).any().groupby(level=0).all()
    able = read[read["estimator"].isin(known.index[known])]
    made = [(False, cleared(read))]
    if len(able):
        made.append((True, cleared(calibrated(able))))
    return [(way, table[table["kernel"] != SHARP]) for way, table in made]
