"""One experiment: frames under conditions, estimated by any estimators, as one long table beside the ground truth.

>>> from pipeline.experiments.condition import grid, sharp_kernel
>>> from pipeline.experiments.frames import of_dataset
>>> from pipeline.experiments.run import Method, run
>>> frames = of_dataset(pipeline.datasets.open_dataset("photos", "photos"), "sigma_dn")
>>> run(frames, grid([sharp_kernel()], ["dcsn"], [0, 10]), [Method("mine", "sigma_dn", MyEstimator())])

Each row holds one estimate: the noise of a patch, or the MTF of a patch in one direction at one frequency, with its
interval, its ground truth, and the reason where the estimator abstained.
"""

from __future__ import annotations

import functools
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.answers import asked
from pipeline.camera import mtf
from pipeline.camera.blur import blur
from pipeline.camera.psf.defocus import create as disc
from pipeline.camera.saturation import saturated_fraction
from pipeline.camera.settings import CameraSettings
from pipeline.datasets.patches import Patch, cut
from pipeline.datasets.selection import evenly_spread
from pipeline.executor import run_map
from pipeline.experiments.arguments import check_arguments
from pipeline.experiments.condition import Condition, CorruptedImage, Quantity, Subset
from pipeline.experiments.corrupt import SharpFrame
from pipeline.experiments.frames import TestFrame
from pipeline.experiments.tables import MEASUREMENTS

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

    from pipeline.blur.base import BlurEstimate
    from pipeline.datasets.frame import Frame

Executor = Callable[[Callable[[Any], Any], Sequence[Any], str], list[Any]]
"""``executor(function, items, label)`` gives the results in the items' order, e.g. `pipeline.executor.run_map`."""


def in_process(function: Callable[[Any], Any], items: Sequence[Any], label: str = "") -> list[Any]:
    """The default executor: one item after the other, in this process."""
    return run_map(function, items, label=label)


@dataclass(frozen=True)
class Registered:
    """A registered estimator, created where it is needed: in the worker process.

    Attributes:
        create: of the registry: `pipeline.blur.create` or `pipeline.noise.create`.
        kind: name in the registry.
        options: of the estimator.
    """

    create: Callable[..., Any]
    kind: str
    options: Mapping[str, Any] = field(default_factory=dict)

    def open(self) -> Any:
        """The estimator, kept by each worker process."""
        return _created(self.create, self.kind, json.dumps(dict(self.options), sort_keys=True))


@dataclass(frozen=True)
class PreFilter:
    """Denoise, then estimate: noisy patches are blurred by a disc before their MTF is estimated.

    Attributes:
        filters_px: diameters of the discs; each gives estimates of its own.
        from_sigma_dn: noise of a patch, as estimated, from which it is filtered, DN.
        noise_estimator: estimates that noise; None filters every patch.
    """

    filters_px: tuple[float, ...] = ()
    from_sigma_dn: float = 0.0
    noise_estimator: Any = None

    def noisy(self, patches: NDArray[np.float32]) -> NDArray[np.bool_]:
        """(N,) which patches are filtered; where the noise is unknown, none is."""
        if self.noise_estimator is None:
            return np.ones(len(patches), dtype=np.bool_)
        estimator = opened(self.noise_estimator)
        name = f"noise estimator '{type(estimator).__name__}' of the pre-filter"
        sigma_dn = asked(name, estimator.estimate, patches, "sigma_dn").sigma_dn
        with np.errstate(invalid="ignore"):
            above: NDArray[np.bool_] = np.asarray(sigma_dn) >= self.from_sigma_dn
        return above


@dataclass(frozen=True)
class Method:
    """An estimator's part in an experiment.

    Attributes:
        name: in the tables.
        quantity: that it estimates: ``"mtf"`` or ``"sigma_dn"``.
        estimator: has ``estimate(patches)`` (`pipeline.blur.base`, `pipeline.noise.base`), or is a `Registered` or the
            like, with ``open()``. With more than one worker it must be picklable.
        subset: conditions it is run on.
        frames: how many frames it is run on, evenly spread; None for all.
        of_folds: estimators in its place for each fold of the frames, where it is cross-fitted.
        prefilter: applied before it under noise.
    """

    name: str
    quantity: Quantity
    estimator: Any
    subset: Subset = field(default_factory=Subset)
    frames: int | None = None
    of_folds: tuple[Any, ...] = ()
    prefilter: PreFilter = field(default_factory=PreFilter)

    @property
    def key(self) -> tuple[Quantity, str]:
        """What tells it from others: an estimator of noise and one of blur may have one name."""
        return self.quantity, self.name

    def opened(self, fold: int) -> Any:
        """The estimator for one fold of the frames."""
        return opened(self.of_folds[fold] if self.of_folds else self.estimator)


def run(
    frames: Sequence[TestFrame],
    conditions: Sequence[Condition],
    methods: Sequence[Method],
    *,
    camera: CameraSettings | None = None,
    seed: int = 1,
    executor: Executor = in_process,
    label: str = "",
    paired: bool = True,
) -> pd.DataFrame:
    """Estimates of every frame under every condition by every method.

    Args:
        frames: with their patches.
        conditions: how the frames are corrupted; best ordered by kernel.
        methods: estimators and their parts of the experiment.
        camera: that forms the corrupted images; the paper's if None.
        seed: root of the random streams.
        executor: changes no result.
        label: of its progress bar.
        paired: see `pipeline.experiments.corrupt`.

    Returns:
        `pipeline.experiments.tables.MEASUREMENTS`, in the order of frames, conditions, methods and patches.

    Raises:
        InputError: an unknown estimator, option or noise source, no answer of an estimator (`pipeline.answers.asked`),
            an object that is no estimator, two methods of one name and quantity, or no `TestFrame`.
    """
    import pandas as pd

    check_arguments(frames, methods)
    takes = {method.key: {item.frame.name for item in evenly_spread(frames, method.frames)} for method in methods}
    work = [(item, tuple(key for key, chosen in takes.items() if item.frame.name in chosen)) for item in frames]
    measure = partial(
        measure_frame,
        conditions=conditions,
        methods=methods,
        camera=camera or CameraSettings(),
        seed=seed,
        paired=paired,
    )
    parts = [part for part in executor(measure, work, label) if part]
    if not parts:
        return MEASUREMENTS.conform(pd.DataFrame(columns=list(MEASUREMENTS.columns)))
    columns = {name: np.concatenate([part[name] for part in parts]) for name in MEASUREMENTS.columns}
    return MEASUREMENTS.conform(pd.DataFrame(columns))


def measure_frame(
    work: tuple[TestFrame, Sequence[tuple[Quantity, str]]],
    *,
    conditions: Sequence[Condition],
    methods: Sequence[Method],
    camera: CameraSettings,
    seed: int,
    paired: bool = True,
) -> dict[str, NDArray[Any]]:
    """What one worker does: one frame under all conditions.

    Args:
        work: the frame, and the keys of the methods that take it.
        conditions: see `run`, like all that follow.
        methods: all, those that do not take the frame among them.
        camera: that forms the corrupted images.
        seed: root of the random streams.
        paired: see `pipeline.experiments.corrupt`.

    Returns:
        columns of `pipeline.experiments.tables.MEASUREMENTS`; empty without any estimate.
    """
    item, keys = work
    sharp = SharpFrame(item.frame, camera, seed, paired=paired)
    estimators = {method.key: method.opened(item.fold) for method in methods if method.key in keys}
    saturated = {quantity: saturated_fraction(cut(sharp.image, patches)) for quantity, patches in item.patches.items()}
    rows, views = _Rows(), dict[bool, _View]()
    for condition in conditions:
        active = [
            method
            for method in methods
            if method.key in keys
            and method.quantity in condition.quantities
            and item.patches.get(method.quantity)
            and method.subset.holds(condition)
        ]
        if not active:
            continue
        image = sharp.under(condition)
        if condition.noisy not in views or views[condition.noisy].image is not image:
            views[condition.noisy] = _View(sharp, condition, image, item.patches)
        view = views[condition.noisy]
        for method in active:
            estimator = estimators[method.key]
            plain = view.estimate(method, estimator)
            about = {**_about(item.frame, condition), **_about_method(method, estimator)}
            if method.quantity == "sigma_dn":
                rows.add(about, _noise_columns(view, plain, saturated["sigma_dn"]))
                continue
            rows.add(about, _mtf_columns(view, plain, saturated["mtf"]))
            for filter_px in method.prefilter.filters_px if condition.noisy else ():
                noisy, estimate = view.noisy(method.prefilter), plain
                if noisy.any():
                    estimate = _with_replaced(plain, view.estimate(method, estimator, filter_px, noisy), noisy)
                columns = _mtf_columns(view, estimate, saturated["mtf"], noisy)
                rows.add({**about, "filter_px": float(filter_px)}, columns)
    return rows.columns()


def opened(estimator: Any) -> Any:
    """An estimator itself, or what the ``open()`` of a `Registered` or the like gives."""
    return estimator.open() if hasattr(estimator, "open") else estimator


@functools.lru_cache(maxsize=8)
def _created(create: Callable[..., Any], kind: str, options: str) -> Any:
    return create(kind, **json.loads(options))


class _View:
    """One corrupted frame, cut into patches; each estimator runs on it once."""

    def __init__(
        self,
        sharp: SharpFrame,
        condition: Condition,
        image: CorruptedImage,
        patches: Mapping[Quantity, Sequence[Patch]],
    ) -> None:
        self.sharp, self.condition, self.image, self.patches = sharp, condition, image, patches
        self._cuts: dict[Quantity, NDArray[np.float32]] = {}
        self._estimates: dict[tuple[int, Quantity, float, bytes | None], Any] = {}
        self._noisy: dict[int, NDArray[np.bool_]] = {}

    def pixels(self, quantity: Quantity) -> NDArray[np.float32]:
        """(N, 1, H, W) the patches of a quantity."""
        if quantity not in self._cuts:
            self._cuts[quantity] = cut(self.image.image, self.patches[quantity])
        return self._cuts[quantity]

    @cached_property
    def sigma_dn(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(N,) noise of the tiles after and before the 8-bit range clips it, DN."""
        tiles = self.patches["sigma_dn"]
        return self.image.clipped_sigma_dn(tiles), self.image.unclipped_sigma_dn(tiles)

    @cached_property
    def sequences(self) -> NDArray[np.float32]:
        """(N, F, 1, H, W) the patches of the MTF in the earlier frames and in this one, the oldest first."""
        moments = [cut(frame.under(self.condition).image, self.patches["mtf"]) for frame in self.sharp.earlier]
        return np.stack([*moments, self.pixels("mtf")], axis=1)

    def noisy(self, prefilter: PreFilter) -> NDArray[np.bool_]:
        """(N,) which patches are filtered."""
        if id(prefilter) not in self._noisy:
            self._noisy[id(prefilter)] = prefilter.noisy(self.pixels("mtf"))
        return self._noisy[id(prefilter)]

    def estimate(
        self,
        method: Method,
        estimator: Any,
        filter_px: float = 0.0,
        chosen: NDArray[np.bool_] | None = None,
    ) -> Any:
        """What a method's estimator answers; with a filter, for the chosen patches blurred by its disc."""
        quantity = method.quantity
        key = (id(estimator), quantity, filter_px, None if chosen is None else chosen.tobytes())
        if key not in self._estimates:
            from_sequences = getattr(estimator, "estimate_sequences", None)
            if quantity != "mtf" or not self.sharp.earlier:
                from_sequences = None
            pixels = self.pixels(quantity) if from_sequences is None else self.sequences
            if chosen is not None:
                pixels = pixels[chosen]
                pixels = blur(pixels.reshape(-1, 1, *pixels.shape[-2:]), disc(filter_px)).reshape(pixels.shape)
            ask = from_sequences or estimator.estimate
            self._estimates[key] = asked(f"estimator '{method.name}'", ask, pixels, quantity)
        return self._estimates[key]


def _with_replaced(plain: BlurEstimate, filtered: BlurEstimate, chosen: NDArray[np.bool_]) -> BlurEstimate:
    """The plain estimate, with that of the chosen patches replaced."""
    changed: dict[str, Any] = {"kernel": None}
    for name in ("mtf", "abstained", "reason", "low", "high"):
        value = getattr(plain, name)
        if value is None:
            continue
        new = getattr(filtered, name)
        changed[name] = value.astype(np.result_type(value, new))  # a reason may be longer than those before
        changed[name][chosen] = new
    return replace(plain, **changed)


def _about(frame: Frame, condition: Condition) -> dict[str, Any]:
    """Columns that all rows of a frame under a condition share."""
    kernel = condition.kernel
    return {
        "dataset": frame.dataset,
        "frame": frame.name,
        "experiment": condition.experiment,
        "kernel": kernel.name,
        "blur_kind": kernel.kind,
        "kernel_size_px": float(kernel.size_px),
        "angle_deg": float(kernel.angle_deg),
        "noise_source": condition.noise_source,
        "target_sigma_dn": float(condition.target_sigma_dn),
        "filter_px": 0.0,
    }


def _about_method(method: Method, estimator: Any) -> dict[str, Any]:
    """Columns that all rows of a method share."""
    return {
        "estimator": method.name,
        "relative_to": str(getattr(estimator, "relative_to", mtf.SYSTEM)) if method.quantity == "mtf" else "",
    }


def _patch_columns(patches: Sequence[Patch], repeats: int = 1) -> dict[str, NDArray[Any]]:
    columns = {
        "patch": np.arange(len(patches)),
        "x_px": np.array([patch.x_px for patch in patches]),
        "y_px": np.array([patch.y_px for patch in patches]),
    }
    return {name: np.repeat(values, repeats) for name, values in columns.items()}


def _noise_columns(view: _View, estimate: Any, saturated: NDArray[np.float64]) -> dict[str, Any]:
    """Rows of the noise of every tile."""
    count = len(estimate.sigma_dn)
    clipped, unclipped = view.sigma_dn
    return {
        **_patch_columns(view.patches["sigma_dn"]),
        "quantity": np.full(count, "sigma_dn", object),
        "axis": np.full(count, "", object),
        "frequency": np.full(count, np.nan),
        "truth": clipped,
        "unclipped_truth": unclipped,
        "estimate": np.asarray(estimate.sigma_dn, float),
        "low": np.asarray(estimate.low_dn, float),
        "high": np.asarray(estimate.high_dn, float),
        "smoothed": np.zeros(count, bool),
        "saturated_fraction": saturated,
        "abstained": np.asarray(estimate.abstained, bool),
        "reason": np.asarray(estimate.reason, str).astype(object),
    }


def _mtf_columns(
    view: _View, estimate: BlurEstimate, saturated: NDArray[np.float64], smoothed: NDArray[np.bool_] | None = None
) -> dict[str, Any]:
    """Rows of the MTF of every patch, direction and frequency."""
    count, points = len(estimate), 2 * len(mtf.FREQUENCIES)
    nothing = np.full(estimate.mtf.shape, np.nan)
    ends = {name: getattr(estimate, name) for name in ("low", "high")}
    smoothed = np.zeros(count, bool) if smoothed is None else smoothed
    return {
        **_patch_columns(view.patches["mtf"], points),
        "quantity": np.full(count * points, "mtf", object),
        "axis": np.tile(np.repeat(np.array(["H", "V"], object), len(mtf.FREQUENCIES)), count),
        "frequency": np.tile(np.asarray(mtf.FREQUENCIES, float), 2 * count),
        "truth": np.tile(view.image.true_mtf.ravel(), count),
        "unclipped_truth": np.full(count * points, np.nan),
        "estimate": np.asarray(estimate.mtf, float).ravel(),
        **{name: np.asarray(nothing if end is None else end, float).ravel() for name, end in ends.items()},
        "smoothed": np.repeat(smoothed, points),
        "saturated_fraction": np.repeat(saturated, points),
        "abstained": np.repeat(np.asarray(estimate.abstained, bool), points),
        "reason": np.repeat(np.asarray(estimate.reason, str).astype(object), points),
    }


class _Rows:
    """Blocks of rows that share some columns."""

    def __init__(self) -> None:
        self._shared: list[dict[str, Any]] = []
        self._arrays: list[dict[str, NDArray[Any]]] = []

    def add(self, shared: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> None:
        """One block: values for all its rows, and a value for each."""
        self._shared.append(shared)
        self._arrays.append(arrays)

    def columns(self) -> dict[str, NDArray[Any]]:
        """All blocks, column by column; empty without any."""
        if not self._shared:
            return {}
        counts = [len(arrays["patch"]) for arrays in self._arrays]
        joined = {name: np.concatenate([arrays[name] for arrays in self._arrays]) for name in self._arrays[0]}
        for name, value in self._shared[0].items():
            kind = object if isinstance(value, str) else float
            joined[name] = np.repeat(np.array([shared[name] for shared in self._shared], kind), counts)
        return joined
