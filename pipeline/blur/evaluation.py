"""How well a blur estimator does: patches of sharp frames under known kernels, beside the kernels' MTF.

Table I of the paper (Wischow et al. 2023, Sec. V): frames are blurred by kernels of several kinds, sizes and rotations;
patches on objects are estimated; the robust median over all patches is compared with the kernel's MTF,

    AMAE = mean over H and V of mean over 8 frequencies of |median - truth|, in percent, averaged over rotations.

Calibrated answers are divided by the same camera's answer for its own sharp frames, so the sharp frame is evaluated as
one more kernel, named ``sharp``, whose truth is 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.blur.base import SHARP_FLOOR, BlurEstimator
from pipeline.camera import mtf
from pipeline.camera.psf.kernel import Kernel
from pipeline.datasets.corrupted import CameraSettings, corrupted
from pipeline.datasets.patches import Patch, cut
from pipeline.statistics import REJECT_BEYOND_MAD
from pipeline.store import Schema
from pipeline.streams import stream

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.datasets.frame import Frame

SHARP = "sharp"

ESTIMATES = Schema(
    "blur estimates",
    {
        "dataset": "string",
        "estimator": "string",
        "kernel": "string",  # "sharp", or a name of the kernel bank
        "kind": "string",
        "size_px": "float64",
        "angle_deg": "float64",
        "effect": "string",  # noise beside the blur, "" for none
        "level_dn": "float64",
        "frame": "string",
        "patch": "int64",
        "axis": "string",  # "H" or "V"
        "frequency": "float64",
        "true_mtf": "float64",
        "mtf": "float64",  # NaN where abstained
        "low": "float64",
        "high": "float64",
        "abstained": "bool",
        "reason": "string",
    },
    {"size_px": "px", "angle_deg": "deg", "level_dn": "DN", "frequency": "fraction of Nyquist"},
)

SUMMARY = Schema(
    "blur summary",
    {
        "dataset": "string",
        "estimator": "string",
        "effect": "string",
        "level_dn": "float64",
        "kind": "string",
        "size_px": "float64",
        "calibrated": "bool",
        "amae_percent": "float64",
        "low_percent": "float64",  # bootstrap 95 % interval of the AMAE over patches
        "high_percent": "float64",
        "patch_error_percent": "float64",  # mean |estimate - truth| per patch, no median
        "coverage": "float64",  # share of truths within low..high, NaN for estimators without an interval
        "angles": "int64",
        "count": "int64",  # patches with an answer, over all angles
        "abstained": "int64",
    },
    {"amae_percent": "%", "low_percent": "%", "high_percent": "%", "patch_error_percent": "%"},
)

Cell = tuple[str, float]


def sharp_kernel() -> Kernel:
    """The kernel that leaves a frame as it is."""
    return Kernel(SHARP, SHARP, 0.0, 0.0, np.ones((1, 1), np.float32))


def evaluate_frame(
    frame: Frame,
    patches: Sequence[Patch],
    kernels: Sequence[Kernel],
    estimator: BlurEstimator,
    camera: CameraSettings,
    seed: int,
    *,
    effect: str = "",
    level_dn: float = 0.0,
) -> list[dict[str, Any]]:
    """Estimate the patches of one frame under every kernel, as the camera would record them.

    Args:
        frame: a sharp frame.
        patches: where to look, all of the estimator's size.
        kernels: blurs; include `sharp_kernel` to be able to calibrate.
        estimator: takes (N, 1, H, W); where it has ``estimate_sequences`` and the frame has earlier ones, those are
            blurred alike and given along.
        camera: the camera that forms the image.
        seed: root of the random streams.
        effect: noise beside the blur (`pipeline.camera.chain`), "" for none.
        level_dn: its standard deviation, DN.

    Returns:
        rows of `ESTIMATES`, but for the estimator's name.
    """
    from dataclasses import replace

    from pipeline.datasets.pictures import read_grey

    sharp = frame.image()
    together = getattr(estimator, "estimate_sequences", None)
    earlier = [read_grey(path) for path in frame.previous] if together is not None else []
    rows: list[dict[str, Any]] = []
    for kernel in kernels:
        psf = None if kernel.name == SHARP else kernel.psf
        noise = effect or "photon"  # at level 0 no noise is drawn, whatever its name
        options: dict[str, Any] = {"camera": camera, "seed": seed, "psf": psf, "psf_name": kernel.name}
        shown = corrupted(sharp, frame, noise, level_dn, **options)
        seen = cut(shown.image, patches)
        if together is not None and earlier and all(image.shape == sharp.shape for image in earlier):
            moments = [
                corrupted(image, replace(frame, name=f"{frame.name}-{back}"), noise, level_dn, **options).image
                for back, image in enumerate(earlier)
            ]
            found = together(np.stack([*(cut(image, patches) for image in moments), seen], axis=1))
        else:
            found = estimator.estimate(seen)
        truth = mtf.sample(kernel.psf)
        common = {
            "dataset": frame.dataset,
            "kernel": kernel.name,
            "kind": kernel.kind,
            "size_px": float(kernel.size_px),
            "angle_deg": float(kernel.angle_deg),
            "effect": effect,
            "level_dn": float(level_dn),
            "frame": frame.name,
        }
        for index in range(len(patches)):
            for axis, frequency in np.ndindex(2, len(mtf.FREQUENCIES)):
                place = (index, axis, frequency)
                rows.append(
                    {
                        **common,
                        "patch": index,
                        "axis": "HV"[axis],
                        "frequency": float(mtf.FREQUENCIES[frequency]),
                        "true_mtf": float(truth[axis, frequency]),
                        "mtf": float(found.mtf[place]),
                        "low": float("nan") if found.low is None else float(found.low[place]),
                        "high": float("nan") if found.high is None else float(found.high[place]),
                        "abstained": bool(found.abstained[index]),
                        "reason": str(found.reason[index]),
                    }
                )
    return rows


def robust_median(values: NDArray[np.floating]) -> NDArray[np.float64]:
    """Median over the first axis of the values within 3.5 MAD of the plain median (`pipeline.statistics.inliers`).

    Args:
        values: (N, ...) numbers; NaN are left out.

    Returns:
        (...); NaN where there is no number.
    """
    data = np.array(values, dtype=np.float64)
    if len(data) == 0:
        return np.full(data.shape[1:], np.nan)
    empty = np.isnan(data).all(axis=0)
    data[:, empty] = 0.0
    deviation = np.abs(data - np.nanmedian(data, axis=0))
    mad = np.nanmedian(deviation, axis=0)
    data[deviation >= REJECT_BEYOND_MAD * np.where(mad == 0, 1.0, mad)] = np.nan
    return np.where(empty, np.nan, np.nanmedian(data, axis=0))


def calibrated(estimates: pd.DataFrame) -> pd.DataFrame:
    """The same estimates divided by the robust median of the same camera's sharp patches, clipped to [0, 1].

    Per dataset, estimator and curve point, as `Estimator.calibrated` does; rows of the sharp kernel stay among them.

    Raises:
        InputError: a dataset and estimator have no answer for sharp frames.
    """
    from pipeline.errors import InputError

    keys = ["dataset", "estimator", "axis", "frequency"]
    sharp = estimates[(estimates["kernel"] == SHARP) & (estimates["level_dn"] == 0)]
    found = {key: float(robust_median(group["mtf"].to_numpy(float))) for key, group in sharp.groupby(keys)}
    own = np.array([found.get(key, np.nan) for key in estimates[keys].itertuples(index=False, name=None)])
    if np.isnan(own).any():
        raise InputError(
            "blur estimates cannot be calibrated: a dataset has no answer for its sharp frames; "
            f"evaluate with the kernel '{SHARP}' as well"
        )
    changed = estimates.copy()
    for name in ("mtf", "low", "high"):
        changed[name] = np.clip(estimates[name].to_numpy(float) / np.maximum(own, SHARP_FLOOR), 0.0, 1.0)
    return changed


def summarise(estimates: pd.DataFrame, seed: int, draws: int, *, is_calibrated: bool = False) -> pd.DataFrame:
    """AMAE of every dataset, estimator, noise, kind and size: one row for each cell of Table I.

    Args:
        estimates: `ESTIMATES`.
        seed: root of the bootstrap's streams.
        draws: bootstrap resamples (of patches, the same for all rotations); 0 for none.
        is_calibrated: what to write into that column.

    Returns:
        `SUMMARY`.
    """
    import pandas as pd

    keys = ["dataset", "estimator", "effect", "level_dn", "kind", "size_px"]
    rows = []
    for cell, group in estimates.groupby(keys, sort=True):
        dataset, estimator, effect, level, kind, size = cell if isinstance(cell, tuple) else (cell,)
        curves, truths = _curves(group)
        key = (str(dataset), str(estimator), str(effect), float(str(level)), str(kind), float(str(size)))
        generator = stream(seed, "bootstrap", "blur", *key)
        count = curves.shape[1]
        resampled = [_amae(curves[:, generator.integers(count, size=count)], truths) for _ in range(draws)]
        low, high = np.nanpercentile(resampled, [2.5, 97.5]) if draws else (np.nan, np.nan)
        answered = ~group["abstained"].to_numpy(bool)
        error = np.abs(group["mtf"].to_numpy(float) - group["true_mtf"].to_numpy(float))[answered]
        inside = ((group["low"] <= group["true_mtf"]) & (group["true_mtf"] <= group["high"])).to_numpy(bool)[answered]
        has_interval = bool(np.isfinite(group["low"].to_numpy(float)).any())
        points = 2 * len(mtf.FREQUENCIES)
        rows.append(
            {
                **dict(zip(keys, key, strict=True)),
                "calibrated": is_calibrated,
                "amae_percent": _amae(curves, truths),
                "low_percent": float(low),
                "high_percent": float(high),
                "patch_error_percent": 100 * float(error.mean()) if len(error) else float("nan"),
                "coverage": float(inside.mean()) if has_interval and len(inside) else float("nan"),
                "angles": len(curves),
                "count": int(answered.sum()) // points,
                "abstained": int((~answered).sum()) // points,
            }
        )
    return SUMMARY.conform(pd.DataFrame(rows, columns=list(SUMMARY.columns)))


def _curves(group: pd.DataFrame) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """One cell's estimates (rotations, patches, 2, 8) and truths (rotations, 2, 8)."""
    ordered = group.sort_values(["angle_deg", "frame", "patch", "axis", "frequency"])
    angles = ordered["angle_deg"].nunique()
    shape = (angles, -1, 2, len(mtf.FREQUENCIES))
    return ordered["mtf"].to_numpy(float).reshape(shape), ordered["true_mtf"].to_numpy(float).reshape(shape)[:, 0]


def _amae(curves: NDArray[np.float64], truths: NDArray[np.float64]) -> float:
    """AMAE of the robust median over patches, averaged over rotations, percent."""
    return float(np.mean(mtf.amae(robust_median(curves.swapaxes(0, 1)), truths)))


def metrics(summary: pd.DataFrame) -> dict[str, Any]:
    """What continuous integration compares: AMAE and abstentions, nested by kind and size, and the mean AMAE.

    Args:
        summary: `SUMMARY` of one dataset and estimator, without noise.
    """
    nested: dict[str, Any] = {}
    for row in summary.to_dict("records"):
        if row["kind"] == SHARP:
            continue
        way = nested.setdefault("calibrated" if row["calibrated"] else "raw", {"mean_amae_percent": []})
        way["mean_amae_percent"].append(row["amae_percent"])
        cell = {"amae_percent": row["amae_percent"], "count": int(row["count"]), "abstained": int(row["abstained"])}
        way.setdefault(str(row["kind"]), {})[f"{row['size_px']:g}"] = cell
    for way in nested.values():
        way["mean_amae_percent"] = float(np.mean(way["mean_amae_percent"]))
    return nested
