"""Where differences from the paper's Table I come from: each choice of the measurement switched, all else equal.

The paper's program and ours differ in choices that have nothing to do with an estimator's merit. Each is a factor of
two settings; kernel estimators are measured under every combination (a full factorial), the same frames, kernels and
patches throughout:

    kernel_px   25 px, as the authors' drivers           31 px, as the paper's text
    storage     the kernel as estimated                  8-bit JPEG, as the authors' programs for JPEG frames (Udacity)
    boundary    reflected beyond the frame               dark beyond it, truncated to 8 bit, as the authors' blur
    patches     over objects                             on a grid over the frame
    mode        exact                                    fast; for some kernels only, since exact is slow
    discs       those that the network was trained on    area-sampled discs of the same area; of the network

The effect of a factor is the mean difference of AMAE between its settings, over all combinations of the others and over
kernels; its 95 % interval resamples whole frames, the same for both settings (`pipeline.experiments.intervals`).
"""

from __future__ import annotations

import functools
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline import blur
from pipeline.camera import authors, mtf
from pipeline.camera.constants import FULL_SCALE_DN
from pipeline.camera.psf.defocus import disc, effective_diameter_px
from pipeline.cluster_intervals import bias_corrected, resamples
from pipeline.errors import InputError
from pipeline.experiments.condition import Condition
from pipeline.experiments.frames import TestFrame
from pipeline.experiments.intervals import robust_median
from pipeline.experiments.run import Executor, Method, Registered, in_process, run
from pipeline.store import Schema
from pipeline.streams import stream

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

    from pipeline.blur.base import BlurEstimate, BlurEstimator
    from pipeline.camera.psf.kernel import Kernel
    from pipeline.camera.settings import CameraSettings
    from pipeline.datasets.frame import Frame
    from pipeline.datasets.patches import Patch

SETTINGS: Mapping[str, tuple[str, str]] = {
    "kernel_px": ("25 px", "31 px"),
    "storage": ("as estimated", "JPEG"),
    "boundary": ("reflected", "dark"),
    "patches": ("objects", "grid"),
    "mode": ("exact", "fast"),
    "discs": ("trained on", "area-sampled"),
}
"""Factor -> its two settings; an effect is the second less the first."""

KERNEL_ESTIMATORS, NETWORK = ("pmp", "gbb"), "cnn"
JPEG_QUALITY = 75
ALL = "all"
FACTOR_CELLS = Schema(
    "cells of the factorial",
    {
        "dataset": "string",
        "estimator": "string",
        **dict.fromkeys(SETTINGS, "string"),  # "" where a factor does not apply
        "blur_kind": "string",
        "kernel_size_px": "float64",
        "amae_percent": "float64",
        "count": "int64",  # patches with an estimate, over all rotations
        "abstained": "int64",
    },
    {"kernel_size_px": "px", "amae_percent": "%"},
)
EFFECTS = Schema(
    "effects of factors",
    {
        "dataset": "string",
        "estimator": "string",
        "factor": "string",
        "first": "string",
        "second": "string",
        "blur_kind": "string",  # or "all"
        "kernel_size_px": "float64",  # 0 for all sizes
        "first_percent": "float64",  # mean AMAE with the first setting
        "second_percent": "float64",
        "effect_percent": "float64",  # second less first, percentage points
        "low_percent": "float64",  # 95 % interval, frames resampled
        "high_percent": "float64",
        "frames": "int64",
        "patches": "int64",
    },
    {"effect_percent": "percentage points"},
)


@dataclass(frozen=True)
class StoredKernel:
    """A kernel estimator whose kernels are stored, and read again, before their MTF is computed.

    Attributes:
        kind: registry name of the estimator.
        options: of it.
        as_jpeg: whether kernels are stored as 8-bit JPEG; else they are taken as estimated.
    """

    kind: str
    options: Mapping[str, Any]
    as_jpeg: bool

    def open(self) -> _Stored:
        """The estimator; both ways of storing share one, so that a patch is estimated once."""
        return _Stored(_estimated_once(self.kind, json.dumps(dict(self.options), sort_keys=True)), self.as_jpeg)


@functools.lru_cache(maxsize=8)
def _estimated_once(kind: str, options: str) -> _EstimatedOnce:
    return _EstimatedOnce(blur.create(kind, **json.loads(options)))


class _EstimatedOnce:
    """An estimator that keeps its last estimate."""

    def __init__(self, estimator: BlurEstimator) -> None:
        self.estimator = estimator
        self._last: tuple[NDArray[np.float32], BlurEstimate] | None = None

    def estimate(self, patches: NDArray[np.float32]) -> BlurEstimate:
        if self._last is None or not np.array_equal(self._last[0], patches):
            self._last = (patches.copy(), self.estimator.estimate(patches))
        return self._last[1]


@dataclass(frozen=True)
class _Stored:
    estimator: _EstimatedOnce
    as_jpeg: bool

    def estimate(self, patches: NDArray[np.float32]) -> BlurEstimate:
        estimate = self.estimator.estimate(patches)
        if not self.as_jpeg or estimate.kernel is None:
            return estimate
        read = [
            np.full(estimate.mtf.shape[1:], np.nan) if refused else np.clip(mtf.sample(through_jpeg(kernel)), 0.0, 1.0)
            for kernel, refused in zip(estimate.kernel, estimate.abstained, strict=True)
        ]
        return replace(estimate, mtf=np.stack(read) if read else estimate.mtf)


def through_jpeg(kernel: NDArray[np.floating], quality: int = JPEG_QUALITY) -> NDArray[np.float64]:
    """A kernel stored as the authors' programs store it for JPEG frames: stretched to 0..255, 8 bit, JPEG.

    Args:
        kernel: (k, k), not constant.
        quality: of the JPEG, 1 to 100.

    Returns:
        (k, k) as read again, unit sum: ringing about the support is part of it.
    """
    import cv2

    low, high = float(kernel.min()), float(kernel.max())
    grey = np.rint((kernel.astype(np.float64) - low) / (high - low) * FULL_SCALE_DN).astype(np.uint8)
    _, data = cv2.imencode(".jpg", grey, [cv2.IMWRITE_JPEG_QUALITY, quality])
    again = np.asarray(cv2.imdecode(data, cv2.IMREAD_GRAYSCALE), dtype=np.float64)
    return np.asarray(again / again.sum())


@dataclass(frozen=True)
class DarkBoundary:
    """Blur as the authors' program does it: darkness beyond the frame, truncated to 8 bit (`pipeline.camera.authors`).

    Takes the place of the camera model in a `Condition`.
    """

    def __call__(self, sharp: NDArray[np.float32], frame: Frame, condition: Condition, seed: int) -> _DarkImage:
        """See `pipeline.experiments.condition.Corruption`; without noise."""
        psf = condition.kernel.psf
        dn = authors.blur_8bit(np.rint(sharp.astype(np.float64) * FULL_SCALE_DN), psf)
        return _DarkImage((dn / FULL_SCALE_DN).astype(np.float32), mtf.sample(psf))


@dataclass(frozen=True, eq=False)
class _DarkImage:
    image: NDArray[np.float32]
    true_mtf: NDArray[np.float64]

    def clipped_sigma_dn(self, patches: Sequence[Patch]) -> NDArray[np.float64]:
        return np.zeros(len(patches))

    def unclipped_sigma_dn(self, patches: Sequence[Patch]) -> NDArray[np.float64]:
        return np.zeros(len(patches))


def measure(
    frames: Mapping[str, Sequence[TestFrame]],
    kernels: Sequence[Kernel],
    exact_sizes_px: Sequence[float],
    *,
    camera: CameraSettings | None = None,
    seed: int = 1,
    draws: int = 500,
    executor: Executor = in_process,
    label: str = "",
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Every combination of factors, and the effect of each.

    Args:
        frames: ``"objects"``, and ``"grid"`` where patches are a factor -> the same frames with patches of that kind.
        kernels: blurs, discs of the authors' program among them.
        exact_sizes_px: sizes of the kernels that exact estimates are made of as well.
        camera: that forms images with reflected boundaries; the paper's if None.
        seed: root of the bootstrap's streams.
        draws: bootstrap resamples of frames.
        executor: changes no result.
        label: of its progress bar.

    Returns:
        `FACTOR_CELLS` and `EFFECTS`.

    Raises:
        InputError: the two kinds of patches are of different frames.
    """
    if len({tuple(item.frame.name for item in frames[kind]) for kind in frames}) > 1:
        raise InputError("factors: patches over objects and on a grid are of different frames; give the same frames")
    runs = [
        _combination(frames, kernels, patches, boundary, exact_sizes_px, camera, seed, executor, label)
        for patches, boundary in product(frames, SETTINGS["boundary"])
    ]
    columns = _Columns([column for part in runs for column in part], draws, seed)
    return columns.cells(), columns.effects()


@dataclass(frozen=True)
class _Column:
    """One combination of settings for one estimator and one blur.

    Attributes:
        dataset, estimator: names.
        settings: factor -> setting; one that is missing does not apply.
        blur: kind and size.
        estimates: frame -> (patches, rotations, 2, 8).
        truth: (rotations, 2, 8).
        count, abstained: estimates over all rotations.
    """

    dataset: str
    estimator: str
    settings: Mapping[str, str]
    blur: tuple[str, float]
    estimates: Mapping[str, NDArray[np.float64]]
    truth: NDArray[np.float64]
    count: int
    abstained: int

    def amae(self, frames: Sequence[str]) -> float:
        """AMAE over frames, which may repeat, in percent."""
        known = [self.estimates[name] for name in frames if name in self.estimates]
        if not known:
            return float("nan")
        return float(mtf.amae(robust_median(np.concatenate(known)), self.truth).mean())


def _combination(
    frames: Mapping[str, Sequence[TestFrame]],
    kernels: Sequence[Kernel],
    patches: str,
    boundary: str,
    exact_sizes_px: Sequence[float],
    camera: CameraSettings | None,
    seed: int,
    executor: Executor,
    label: str,
) -> list[_Column]:
    """All estimators on one kind of patches behind one kind of boundary."""
    base = (patches, boundary) == (SETTINGS["patches"][0], SETTINGS["boundary"][0])
    corruption = DarkBoundary() if boundary == SETTINGS["boundary"][1] else None
    measured = []
    for name, settings, estimator, chosen in _methods(kernels, exact_sizes_px if base else ()):
        method = Method(json.dumps([name, settings], sort_keys=True), "mtf", estimator)
        measured.append((chosen, method))
    tables = []
    groups: dict[int, list[Method]] = {}
    lists = {id(chosen): chosen for chosen, _ in measured}
    for chosen, method in measured:
        groups.setdefault(id(chosen), []).append(method)
    for key, methods in groups.items():
        conditions = [Condition(kernel, corruption=corruption) for kernel in lists[key]]
        text = f"{label}, {patches}, {boundary} boundary"
        tables.append(
            run(frames[patches], conditions, methods, camera=camera, seed=seed, executor=executor, label=text)
        )
    return [
        column
        for table in tables
        for column in _columns_of(table, {"patches": patches, "boundary": boundary})
    ]  # fmt: skip


def _methods(
    kernels: Sequence[Kernel], exact_sizes_px: Sequence[float]
) -> list[tuple[str, dict[str, str], Any, Sequence[Kernel]]]:
    """Estimator, its settings, what opens it, and the kernels it is run on."""
    methods: list[tuple[str, dict[str, str], Any, Sequence[Kernel]]] = []
    few = [kernel for kernel in kernels if kernel.size_px in exact_sizes_px]
    modes: list[tuple[str, Sequence[int], Sequence[Kernel]]] = [("fast", (25, 31), kernels)]
    modes += [("exact", (25,), few)] if few else []
    for mode, sizes, chosen in modes:
        for kind, size, storage in product(KERNEL_ESTIMATORS, sizes, SETTINGS["storage"]):
            options = {"mode": mode, "kernel_size": size}
            settings = {"mode": mode, "kernel_px": f"{size} px", "storage": storage}
            as_jpeg = storage == SETTINGS["storage"][1]
            methods.append((kind, settings, StoredKernel(kind, options, as_jpeg), chosen))
    discs = [kernel for kernel in kernels if kernel.kind == "defocus"]
    others = [
        replace(kernel, psf=disc(effective_diameter_px(kernel.size_px)), name=f"{kernel.name}_area")
        for kernel in discs
    ]  # fmt: skip
    first, second = SETTINGS["discs"]
    network = Registered(blur.create, NETWORK)
    moved = [kernel for kernel in kernels if kernel.kind != "defocus"]
    for settings, chosen in (({"discs": first}, discs), ({"discs": second}, others), ({}, moved)):
        if chosen:
            methods.append((NETWORK, settings, network, chosen))
    return methods


def _columns_of(table: pd.DataFrame, around: Mapping[str, str]) -> list[_Column]:
    columns = []
    points = 2 * len(mtf.FREQUENCIES)
    groups: Any = table.groupby(["dataset", "estimator", "blur_kind", "kernel_size_px"], sort=False)
    for (dataset, method, kind, size), group in groups:
        name, settings = json.loads(str(method))
        ordered = group.sort_values(["frame", "patch", "angle_deg", "axis", "frequency"])
        rotations = ordered["angle_deg"].nunique()
        estimates = {
            str(frame): row["estimate"].to_numpy(float).reshape(-1, rotations, 2, len(mtf.FREQUENCIES))
            for frame, row in ordered.groupby("frame", sort=False)
        }
        truth = ordered["truth"].to_numpy(float)[: rotations * points].reshape(rotations, 2, len(mtf.FREQUENCIES))
        refused = int(ordered["abstained"].sum()) // points
        columns.append(
            _Column(
                str(dataset), name, {**around, **settings}, (str(kind), float(size)), estimates, truth,
                len(ordered) // points - refused, refused,
            )
        )  # fmt: skip
    return columns


class _Columns:
    """All combinations, with the AMAE of each over all frames and over resampled ones."""

    def __init__(self, columns: Sequence[_Column], draws: int, seed: int) -> None:
        self.columns = columns
        self.frames = sorted({name for column in columns for name in column.estimates})
        picks = resamples(len(self.frames), draws, stream(seed, "bootstrap", "factors"))
        samples = [self.frames, *([self.frames[number] for number in pick] for pick in picks)]
        self.errors = [np.array([column.amae(sample) for sample in samples]) for column in columns]

    def cells(self) -> pd.DataFrame:
        """`FACTOR_CELLS`."""
        import pandas as pd

        rows = [
            {
                "dataset": column.dataset,
                "estimator": column.estimator,
                **{factor: column.settings.get(factor, "") for factor in SETTINGS},
                "blur_kind": column.blur[0],
                "kernel_size_px": column.blur[1],
                "amae_percent": errors[0],
                "count": column.count,
                "abstained": column.abstained,
            }
            for column, errors in zip(self.columns, self.errors, strict=True)
        ]
        return FACTOR_CELLS.conform(pd.DataFrame(rows))

    def effects(self) -> pd.DataFrame:
        """`EFFECTS`."""
        import pandas as pd

        rows = []
        for estimator, factor in product((*KERNEL_ESTIMATORS, NETWORK), SETTINGS):
            pairs = self._pairs(estimator, factor)
            blurs = sorted({blur for blur, _, _ in pairs})
            groups: list[tuple[str, float]] = [
                (ALL, 0.0),
                *((kind, 0.0) for kind in sorted({kind for kind, _ in blurs})),
            ]
            for kind, size in [*groups, *blurs] if pairs else []:
                selected = [pair for pair in pairs if kind in (ALL, pair[0][0]) and size in (0.0, pair[0][1])]
                first = np.mean([self.errors[number] for _, number, _ in selected], axis=0)
                second = np.mean([self.errors[number] for _, _, number in selected], axis=0)
                low, high = bias_corrected((second - first)[1:], float((second - first)[0]), len(self.frames))
                numbers = {"first_percent": first[0], "second_percent": second[0]}
                numbers |= {"effect_percent": second[0] - first[0], "low_percent": low, "high_percent": high}
                column = self.columns[selected[0][1]]
                names = {"dataset": column.dataset, "estimator": estimator, "factor": factor}
                ends = dict(zip(("first", "second"), SETTINGS[factor], strict=True))
                patches = sum(len(values) for values in column.estimates.values())
                of_blur = {"blur_kind": kind, "kernel_size_px": size}
                rows.append({**names, **ends, **of_blur, **numbers, "frames": len(self.frames), "patches": patches})
        return EFFECTS.conform(pd.DataFrame(rows))

    def _pairs(self, estimator: str, factor: str) -> list[tuple[tuple[str, float], int, int]]:
        """Blur and the numbers of two columns that differ in this factor alone: first setting, then second."""
        first, second = SETTINGS[factor]
        known = {
            (column.blur, tuple(sorted(column.settings.items()))): number
            for number, column in enumerate(self.columns)
            if column.estimator == estimator
        }
        pairs = []
        for (of_blur, settings), number in known.items():
            if dict(settings).get(factor) == first:
                other = known.get((of_blur, tuple(sorted({**dict(settings), factor: second}.items()))))
                if other is not None:
                    pairs.append((of_blur, number, other))
        return pairs
