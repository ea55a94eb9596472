"""Blur and noise at once: one frame under kernels and noise levels together, read by blur and noise estimators.

The paper's combined experiments (Wischow et al. 2023, Sec. V and supplement). The order is the paper's unless
`camera.order` says otherwise: photon noise is blurred by the optics; dark current and readout come after them and stay
sharp. Defocus with dark-current noise is therefore a sharp noise on a blurred picture, linear motion with photon noise
a blurred one.

Denoise, then estimate (`pipeline.blur.denoise`): a patch read as noisy is also estimated after smoothing by a disc.
What is kept then is the MTF as read, that of blur and disc together; `pipeline.condition.combined_answers.cleared`
divides the disc out, after any calibration.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.blur.base import BlurEstimate, BlurEstimator
from pipeline.blur.evaluation import SHARP, sharp_kernel
from pipeline.camera import mtf
from pipeline.camera.blur import blur
from pipeline.camera.psf.defocus import create as disc
from pipeline.camera.psf.kernel import Kernel
from pipeline.camera.truth import Corrupted, local_sigma
from pipeline.condition.combined_design import Experiment, Smoothing, Subset
from pipeline.datasets.corrupted import CameraSettings, corrupted
from pipeline.datasets.patches import Patch, cut
from pipeline.noise.base import NoiseEstimator

if TYPE_CHECKING:
    from pipeline.datasets.frame import Frame

Rows = list[dict[str, Any]]
NOISELESS = "photon"  # at level 0 no noise is drawn, whatever its name


@dataclass(frozen=True)
class Bench:
    """Everything but the frame.

    Attributes:
        experiments: what comes together.
        kernels: blurs; each experiment takes those of its kind.
        levels_dn: standard deviations of the noise asked for, DN.
        blur: name -> blur estimator and its part of the conditions.
        noise: name -> noise estimator; runs on the first rotation of each kernel and on frames without blur.
        smoothing: denoise, then estimate.
        camera: the camera that forms the image.
        seed: root of the random streams.
    """

    experiments: Sequence[Experiment]
    kernels: Sequence[Kernel]
    levels_dn: Sequence[float]
    blur: Mapping[str, tuple[BlurEstimator, Subset]]
    noise: Mapping[str, NoiseEstimator] = field(default_factory=dict)
    smoothing: Smoothing = field(default_factory=Smoothing)
    camera: CameraSettings = field(default_factory=CameraSettings)
    seed: int = 1

    def evaluate(self, frame: Frame, patches: Sequence[Patch], tiles: Sequence[Patch]) -> tuple[Rows, Rows]:
        """All conditions of one frame.

        Args:
            frame: a sharp frame.
            patches: where blur is estimated.
            tiles: where noise is estimated.

        Returns:
            rows of `BLUR_READ`, sharp frames without noise (to calibrate by) among them, and of `NOISE_READ`
            (`pipeline.condition.combined_tables`).
        """
        view = _View(frame, patches, tiles, self.camera, self.seed)
        clear = view.shows(sharp_kernel(), NOISELESS, 0.0)
        blur_rows, noise_rows = [], self._unblurred(view, clear)
        for name, (estimator, _) in self.blur.items():
            where = {"estimator": name, "experiment": "", "effect": "", "level_dn": 0.0}
            blur_rows += _blur_rows(clear, {**where, "filter_px": 0.0}, clear.read_by(estimator))
        for kernel in self.kernels:
            noiseless: _Shown | None = None
            for experiment in self.experiments:
                for level in self.levels_dn if experiment.kind == kernel.kind else ():
                    takes_noise = bool(self.noise and tiles) and kernel in self._first_rotations
                    asked = [name for name, (_, part) in self.blur.items() if part.holds(experiment, kernel, level)]
                    if not asked and not takes_noise:
                        continue
                    if level == 0.0:
                        shown = noiseless = noiseless or view.shows(kernel, NOISELESS, 0.0)
                    else:
                        shown = view.shows(kernel, experiment.effect, level)
                    where = {"experiment": experiment.name, "effect": experiment.effect, "level_dn": float(level)}
                    for name in asked:
                        blur_rows += self._read(shown, {**where, "estimator": name}, self.blur[name][0])
                    if takes_noise:
                        noise_rows += self._noise(shown, where)
        return blur_rows, noise_rows

    @cached_property
    def _first_rotations(self) -> list[Kernel]:
        first: dict[tuple[str, float], Kernel] = {}
        for kernel in sorted(self.kernels, key=lambda kernel: kernel.angle_deg):
            first.setdefault((kernel.kind, kernel.size_px), kernel)
        return list(first.values())

    def _read(self, shown: _Shown, where: dict[str, Any], estimator: BlurEstimator) -> Rows:
        """One estimator's answers as the patches are and, under noise, with every smoothing disc."""
        plain = shown.read_by(estimator)
        rows = _blur_rows(shown, {**where, "filter_px": 0.0}, plain)
        for filter_px in self.smoothing.filters_px if where["level_dn"] > 0 else ():
            noisy = shown.noisy(self.smoothing)
            found = plain
            if noisy.any():
                found = _chosen(noisy, shown.read_by(estimator, filter_px, noisy), plain)
            rows += _blur_rows(shown, {**where, "filter_px": float(filter_px)}, found, noisy)
        return rows

    def _unblurred(self, view: _View, clear: _Shown) -> Rows:
        """The noise estimators on frames without blur: one reading for all experiments of an effect."""
        rows: Rows = []
        if not (self.noise and view.tiles):
            return rows
        for effect in dict.fromkeys(experiment.effect for experiment in self.experiments):
            for level in self.levels_dn:
                shown = clear if level == 0.0 else view.shows(sharp_kernel(), effect, level)
                found = self._noise(shown, {"effect": effect, "level_dn": float(level)})
                for experiment in self.experiments:
                    if experiment.effect == effect:
                        rows += [{**row, "experiment": experiment.name, "kind": experiment.kind} for row in found]
        return rows

    def _noise(self, shown: _Shown, where: dict[str, Any]) -> Rows:
        rows: Rows = []
        for name, estimator in self.noise.items():
            found = estimator.estimate(shown.tiles)
            rows += [
                {
                    **shown.place,
                    **where,
                    "estimator": name,
                    "patch": index,
                    "true_sigma_dn": float(shown.sigma_dn[0][index]),
                    "added_sigma_dn": float(shown.sigma_dn[1][index]),
                    "sigma_dn": float(found.sigma_dn[index]),
                    "low_dn": float(found.low_dn[index]),
                    "high_dn": float(found.high_dn[index]),
                    "abstained": bool(found.abstained[index]),
                    "reason": str(found.reason[index]),
                }
                for index in range(len(shown.tiles))
            ]
        return rows


class _View:
    """One frame, its earlier ones if estimators want them, and where to look."""

    def __init__(
        self, frame: Frame, patches: Sequence[Patch], tiles: Sequence[Patch], camera: CameraSettings, seed: int
    ) -> None:
        self.frame, self.patches, self.tiles, self.camera, self.seed = frame, patches, tiles, camera, seed
        self.sharp = frame.image()

    @cached_property
    def earlier(self) -> list[NDArray[np.float32]]:
        """The frames before this one; none unless all are of its size."""
        from pipeline.datasets.pictures import read_grey

        images = [read_grey(path) for path in self.frame.previous]
        return images if all(image.shape == self.sharp.shape for image in images) else []

    def seen(self, kernel: Kernel, effect: str, level_dn: float, back: int | None = None) -> Corrupted:
        """The frame, or one before it, as the camera would record it."""
        psf = None if kernel.name == SHARP else kernel.psf
        image, frame = self.sharp, self.frame
        if back is not None:
            image, frame = self.earlier[back], replace(frame, name=f"{frame.name}-{back}")
        return corrupted(image, frame, effect, level_dn, self.camera, self.seed, psf, kernel.name)

    def shows(self, kernel: Kernel, effect: str, level_dn: float) -> _Shown:
        """The frame under one condition."""
        return _Shown(self, kernel, effect, level_dn)


class _Shown:
    """One frame under one condition; what is costly is made when first asked for."""

    def __init__(self, view: _View, kernel: Kernel, effect: str, level_dn: float) -> None:
        self.view, self.kernel, self.condition = view, kernel, (kernel, effect, level_dn)
        self.truth = view.seen(*self.condition)
        self.patches = cut(self.truth.image, view.patches)
        self.tiles = cut(self.truth.image, view.tiles)
        self._read: dict[tuple[int, float], BlurEstimate] = {}
        self._noisy: NDArray[np.bool_] | None = None

    @property
    def place(self) -> dict[str, Any]:
        """What tells this frame and kernel from others."""
        kernel, frame = self.kernel, self.view.frame
        where = {"dataset": frame.dataset, "frame": frame.name, "kind": kernel.kind}
        return {**where, "size_px": float(kernel.size_px)}

    @cached_property
    def sigma_dn(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(N,) of the tiles: noise after and before the 8-bit range cut it."""
        tiles = self.view.tiles
        return local_sigma(self.truth, tiles), local_sigma(self.truth, tiles, "before")

    @cached_property
    def sequences(self) -> NDArray[np.float32]:
        """(N, F, 1, H, W) the patches with the same places in earlier frames, the oldest first."""
        moments = [
            cut(self.view.seen(*self.condition, back=back).image, self.view.patches)
            for back in range(len(self.view.earlier))
        ]
        return np.stack([*moments, self.patches], axis=1)

    def noisy(self, smoothing: Smoothing) -> NDArray[np.bool_]:
        """Which patches are to be smoothed; asked once."""
        if self._noisy is None:
            self._noisy = smoothing.noisy(self.patches)
        return self._noisy

    def read_by(
        self, estimator: BlurEstimator, filter_px: float = 0.0, which: NDArray[np.bool_] | None = None
    ) -> BlurEstimate:
        """An estimator's answer, once for each; with a filter, for the chosen patches smoothed by its disc."""
        key = (id(estimator), filter_px)
        if key not in self._read:
            together = getattr(estimator, "estimate_sequences", None)
            given = self.patches if together is None or not self.view.earlier else self.sequences
            if which is not None:
                given = given[which]
                given = blur(given.reshape(-1, 1, *given.shape[-2:]), disc(filter_px)).reshape(given.shape)
            self._read[key] = estimator.estimate(given) if given.ndim == 4 or together is None else together(given)
        return self._read[key]


def _chosen(which: NDArray[np.bool_], smoothed: BlurEstimate, plain: BlurEstimate) -> BlurEstimate:
    """The plain answer, with those of the chosen patches put in."""
    changed: dict[str, Any] = {"kernel": None}
    for name in ("mtf", "abstained", "reason", "low", "high"):
        value = getattr(plain, name)
        if value is None:
            continue
        new = getattr(smoothed, name)
        changed[name] = value.astype(np.result_type(value, new))  # a reason may be longer than those before
        changed[name][which] = new
    return replace(plain, **changed)


def _blur_rows(
    shown: _Shown, where: dict[str, Any], found: BlurEstimate, smoothed: NDArray[np.bool_] | None = None
) -> Rows:
    """Rows of `BLUR_READ`: patches x directions x frequencies."""
    kernel, truth = shown.kernel, mtf.sample(shown.kernel.psf)
    common = {**shown.place, **where, "kernel": kernel.name, "angle_deg": float(kernel.angle_deg)}
    nothing = np.full(found.mtf.shape, np.nan)
    low, high = (nothing if end is None else end for end in (found.low, found.high))
    rows: Rows = []
    for index in range(len(found)):
        patch = {
            **common,
            "patch": index,
            "abstained": bool(found.abstained[index]),
            "reason": str(found.reason[index]),
            "smoothed": smoothed is not None and bool(smoothed[index]),
        }
        for axis, point in np.ndindex(2, len(mtf.FREQUENCIES)):
            place = (index, axis, point)
            rows.append(
                {
                    **patch,
                    "axis": "HV"[axis],
                    "frequency": float(mtf.FREQUENCIES[point]),
                    "true_mtf": float(truth[axis, point]),
                    "mtf": float(found.mtf[place]),
                    "low": float(low[place]),
                    "high": float(high[place]),
                }
            )
    return rows
