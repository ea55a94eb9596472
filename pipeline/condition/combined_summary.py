"""Statistics of blur and noise at once: AMAE over kernels and levels, sigma over levels, and the example's curves."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.blur.denoise import EPSILON, divided, expected_amae
from pipeline.blur.evaluation import SHARP, calibrated, robust_median
from pipeline.camera import mtf
from pipeline.camera.psf.defocus import create as disc
from pipeline.condition.combined_tables import BLUR_CELLS, CURVES, NOISE_CELLS
from pipeline.statistics import robust
from pipeline.streams import stream

if TYPE_CHECKING:
    import pandas as pd

DISC = "disc"
"""Experiment that reads the smoothing discs themselves, without noise."""

CELL = ["dataset", "estimator", "experiment", "effect", "level_dn", "kind", "size_px", "filter_px"]
NOISE_CELL = ["dataset", "estimator", "experiment", "kind", "size_px", "effect", "level_dn"]
BLOCK = 2_000_000  # numbers resampled together


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


def blur_cells(read: pd.DataFrame, seed: int, draws: int) -> pd.DataFrame:
    """Errors of every estimator for every experiment, kernel size, level and smoothing, raw and calibrated.

    Args:
        read: `BLUR_READ`.
        seed: root of the bootstrap's streams.
        draws: bootstrap resamples, of patches, the same for all rotations.

    Returns:
        `BLUR_CELLS`, without the expected error (`with_expected`).
    """
    import pandas as pd

    rows = []
    for is_calibrated, table in answers(read):
        for cell, group in table.groupby(CELL, sort=True):
            rows.append(_blur_cell(dict(zip(CELL, cell, strict=True)), group, seed, draws, is_calibrated))
    return BLUR_CELLS.conform(pd.DataFrame(rows, columns=list(BLUR_CELLS.columns)))


def _blur_cell(cell: dict[str, Any], group: pd.DataFrame, seed: int, draws: int, is_calibrated: bool) -> dict[str, Any]:
    ordered = group.sort_values(["angle_deg", "frame", "patch", "axis", "frequency"])
    shape = (ordered["angle_deg"].nunique(), -1, 2, len(mtf.FREQUENCIES))
    given, truth = (ordered[name].to_numpy(float).reshape(shape) for name in ("mtf", "true_mtf"))
    by_patch, truths = given.swapaxes(0, 1), truth[:, 0]
    middle = robust_median(by_patch)
    low, high = _interval(by_patch, truths, stream(seed, "bootstrap", "combined", *cell.values()), draws)
    patches = group[~group["abstained"].to_numpy(bool)]
    answered = patches[patches["mtf"].notna()]
    error = (answered["mtf"] - answered["true_mtf"]).abs()
    interval = answered[answered["low"].notna()]
    held = (interval["low"] <= interval["true_mtf"]) & (interval["true_mtf"] <= interval["high"])
    points = 2 * len(mtf.FREQUENCIES)
    nan = float("nan")
    return {
        **cell,
        "calibrated": is_calibrated,
        "amae_percent": float(_amae(middle, truths)),
        "low_percent": low,
        "high_percent": high,
        "patch_error_percent": 100 * float(error.mean()) if len(error) else nan,
        "coverage": float(held.mean()) if len(held) else nan,
        "angles": shape[0],
        "count": len(patches) // points,
        "abstained": (len(group) - len(patches)) // points,
        "smoothed_share": float(group["smoothed"].mean()),
        "frequencies_share": len(answered) / len(patches) if len(patches) else nan,
        "mae_h_percent": float(_amae(middle[:, [0, 0]], truths[:, [0, 0]])),
        "mae_v_percent": float(_amae(middle[:, [1, 1]], truths[:, [1, 1]])),
        "expected_amae_percent": nan,
    }


def _amae(curves: NDArray[np.float64], truths: NDArray[np.float64]) -> NDArray[np.float64]:
    """AMAE in percent over the frequencies answered, averaged over rotations: (..., rotations, 2, 8) -> (...)."""
    each = mtf.amae(curves, truths, skip_missing=True)
    known = np.isfinite(each)
    total = np.where(known, each, 0.0).sum(axis=-1)
    count = known.sum(axis=-1)
    return np.where(count == 0, np.nan, total / np.maximum(count, 1))


def _interval(
    by_patch: NDArray[np.float64], truths: NDArray[np.float64], generator: np.random.Generator, draws: int
) -> tuple[float, float]:
    """Bootstrap 95 % interval of the AMAE: (patches, rotations, 2, 8) and (rotations, 2, 8)."""
    count = len(by_patch)
    picks = generator.integers(count, size=(draws, count))
    block = max(1, BLOCK // by_patch.size)
    found = np.concatenate(
        [_amae(robust_median(by_patch[part.T]), truths) for part in np.split(picks, range(block, draws, block))]
    )
    if not np.isfinite(found).any():
        return float("nan"), float("nan")
    low, high = np.nanpercentile(found, [2.5, 97.5])
    return float(low), float(high)


def with_expected(cells: pd.DataFrame) -> pd.DataFrame:
    """The cells with the error to be expected of smoothed answers, and without the discs' own.

    Expected is sqrt(a1^2 + a2^2), from the same estimator's AMAE for the blur (a1) and for the disc (a2), both without
    noise (Wischow et al. 2023, supplement).

    Args:
        cells: `BLUR_CELLS` with experiment `DISC` and level 0.
    """
    who = ["dataset", "estimator", "calibrated"]
    without = cells[(cells["level_dn"] == 0) & (cells["filter_px"] == 0)]
    error = {
        (*key[:3], key[3] == DISC, key[4]): value
        for *key, value in without[[*who, "experiment", "size_px", "amae_percent"]].itertuples(index=False, name=None)
    }
    expected = [
        float(expected_amae(error.get((*key[:3], False, size), np.nan), error.get((*key[:3], True, filter_px), np.nan)))
        for *key, size, filter_px in cells[[*who, "size_px", "filter_px"]].itertuples(index=False, name=None)
    ]
    changed = cells.assign(expected_amae_percent=expected)
    return changed[changed["experiment"] != DISC].reset_index(drop=True)


def example_angle(read: pd.DataFrame, kind: str, size_px: float, wanted_deg: float = 45.0) -> float:
    """The rotation, of those evaluated, that is nearest to the one wanted (the smaller of two)."""
    held = read[(read["kind"] == kind) & (read["size_px"] == size_px)]["angle_deg"].unique()
    return float(min(held, key=lambda angle: (abs(angle - wanted_deg), angle)))


def example_curves(read: pd.DataFrame, size_px: float) -> pd.DataFrame:
    """Curves of one kernel of each experiment, over levels: robust statistics over patches.

    Args:
        read: `BLUR_READ`.
        size_px: of the kernel; of motion, the rotation nearest to 45 degrees.

    Returns:
        `CURVES`; axis ``"HV"`` is the mean of both directions, which the paper draws.
    """
    import pandas as pd

    keys = [*CELL, "angle_deg"]
    rows = []
    for is_calibrated, table in answers(read):
        of_size = table[table["size_px"] == size_px]
        for cell, group in of_size.groupby(keys, sort=True):
            where = dict(zip(keys, cell, strict=True))
            if where["angle_deg"] != example_angle(of_size, str(where["kind"]), size_px):
                continue
            ordered = group.sort_values(["frame", "patch", "axis", "frequency"])
            shape = (-1, 2, len(mtf.FREQUENCIES))
            given, truth = (ordered[name].to_numpy(float).reshape(shape) for name in ("mtf", "true_mtf"))
            del where["effect"]
            for axis, curves, true in (
                ("H", given[:, 0], truth[0, 0]),
                ("V", given[:, 1], truth[0, 1]),
                ("HV", given.mean(axis=1), truth[0].mean(axis=0)),
            ):
                for place, values in enumerate(curves.T):
                    found = robust(values, stream(0, "bootstrap", "no interval"), 1)
                    rows.append(
                        {
                            **where,
                            "calibrated": is_calibrated,
                            "axis": axis,
                            "place": place,
                            "frequency": float(mtf.FREQUENCIES[place]),
                            "true_mtf": float(true[place]),
                            "median": found.median,
                            "minimum": found.minimum,
                            "maximum": found.maximum,
                            "count": found.count,
                            "abstained": found.abstained,
                        }
                    )
    return CURVES.conform(pd.DataFrame(rows, columns=list(CURVES.columns)))


def noise_cells(read: pd.DataFrame, seed: int, draws: int) -> pd.DataFrame:
    """Robust statistics of the noise read, per estimator, experiment, kernel size and level.

    Args:
        read: `NOISE_READ`.
        seed: root of the bootstrap's streams.
        draws: bootstrap resamples.

    Returns:
        `NOISE_CELLS`.
    """
    import pandas as pd

    rows = []
    for key, group in read.groupby(NOISE_CELL, sort=True):
        cell: dict[str, Any] = dict(zip(NOISE_CELL, key, strict=True))
        values, true, added = (group[name].to_numpy(float) for name in ("sigma_dn", "true_sigma_dn", "added_sigma_dn"))
        found = robust(values, stream(seed, "bootstrap", "combined noise", *cell.values()), draws)
        error = np.abs(values - added)[np.isfinite(values)]
        interval = group[group["low_dn"].notna()]
        held = (interval["low_dn"] <= interval["added_sigma_dn"]) & (interval["added_sigma_dn"] <= interval["high_dn"])
        rows.append(
            {
                **cell,
                "median_dn": found.median,
                "minimum_dn": found.minimum,
                "maximum_dn": found.maximum,
                "low_dn": found.low,
                "high_dn": found.high,
                "true_median_dn": float(robust_median(true)),
                "added_median_dn": float(robust_median(added)),
                "patch_error_dn": float(error.mean()) if len(error) else float("nan"),
                "coverage": float(held.mean()) if len(held) else float("nan"),
                "count": found.count,
                "rejected": found.rejected,
                "abstained": found.abstained,
            }
        )
    return NOISE_CELLS.conform(pd.DataFrame(rows, columns=list(NOISE_CELLS.columns)))


def metrics(blur: pd.DataFrame, noise: pd.DataFrame | None = None) -> dict[str, Any]:
    """What continuous integration compares: means over kernel sizes, nested by experiment, estimator and level.

    Where every patch was abstained from there is no mean, and none is written; the counts say so.

    Args:
        blur: `BLUR_CELLS`.
        noise: `NOISE_CELLS`.
    """
    nested: dict[str, Any] = {}

    def put(path: list[str], content: dict[str, Any]) -> None:
        place = nested
        for part in path:
            place = place.setdefault(part, {})
        place.update({name: value for name, value in content.items() if np.isfinite(value)})

    keys = ["experiment", "estimator", "calibrated", "filter_px", "level_dn"]
    for key, group in blur.groupby(keys, sort=True):
        cell: dict[str, Any] = dict(zip(keys, key, strict=True))
        way = "calibrated" if cell["calibrated"] else "raw"
        way += f", smoothed by {cell['filter_px']:g} px" if cell["filter_px"] else ""
        put(
            ["blur", cell["experiment"], cell["estimator"], way, f"{cell['level_dn']:g}"],
            {
                "amae_percent": float(group["amae_percent"].mean()),
                "count": int(group["count"].sum()),
                "abstained": int(group["abstained"].sum()),
            },
        )
    keys = ["experiment", "estimator", "level_dn"]
    for key, group in noise.groupby(keys, sort=True) if noise is not None else ():
        cell = dict(zip(keys, key, strict=True))
        put(
            ["noise", cell["experiment"], cell["estimator"], f"{cell['level_dn']:g}"],
            {
                "median_dn": float(group["median_dn"].mean()),
                "patch_error_dn": float(group["patch_error_dn"].mean()),
                "abstained": int(group["abstained"].sum()),
            },
        )
    return nested
