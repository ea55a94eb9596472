"""One call for blur and noise of a frame or of patches: MTF and sigma with intervals, abstentions, maps, time taken.

A camera monitor and a controller ask the same question of every frame: how much contrast is left, how much noise was
added, where, and how sure is that. Any two estimators of the registries answer it together here; an abstention is
counted and has its reason, and a frame without any estimate has NaN, never a zero.
"""

from __future__ import annotations

import time
import warnings
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from numbers import Integral
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from pipeline import blur, noise
from pipeline.answers import WrongAnswer, asked, check_array
from pipeline.blur.base import FREQUENCIES, PATCH_PX, BlurEstimate, Estimator, as_patches
from pipeline.blur.camera_calibration import CalibratedEstimator, CameraFittable, calibrate, refuse_relative
from pipeline.camera.saturation import SATURATED
from pipeline.condition.coarse_grain import most_coarse_noise_dn
from pipeline.condition.frame_tiles import MOST_PATCHES, MOST_TILES, frame_tiles
from pipeline.condition.grey_frame import grey_frame
from pipeline.condition.picture_area import COVERED_REASON, covered, picture_area, shifted
from pipeline.condition.sharp_edges import CONTRADICTED, contradicted
from pipeline.condition.structure import STRIPED, STRUCTURELESS, striped, structureless
from pipeline.condition.summary import (
    Summary,
    at_most_dn,
    noise_parts,
    summarise,
    summarise_noise,
    unsharp,
    with_upper_end,
)
from pipeline.condition.video_codecs import hidden_noise_dn, is_doubtful
from pipeline.datasets.patches import Patch, cut, tiles
from pipeline.datasets.selection import evenly_spread
from pipeline.errors import InputError
from pipeline.noise.base import COMPRESSED, FLAT, NoiseEstimate, NoiseEstimator, smallest_patch_px
from pipeline.noise.maps import CELL_PX, CellEstimator, pasted

Estimate = TypeVar("Estimate", BlurEstimate, NoiseEstimate)

TILE_PX = 128
DOUBTED_BY = 24
"""Most patches by which a frame given as sharp is doubted."""


@dataclass(frozen=True)
class BlurState:
    """Blur over a frame.

    Attributes:
        patches: N squares of the frame, row by row from the top.
        estimate: their N answers.
        grid: (rows, columns) of the patches; (0, 0) in a frame smaller than a patch.
        summary: over the patches: arrays (2, 8), horizontal and vertical at the eight frequencies.
        milliseconds: time on the clock.
    """

    patches: Sequence[Patch]
    estimate: BlurEstimate
    grid: tuple[int, int]
    summary: Summary
    milliseconds: float

    @property
    def map_mtf(self) -> NDArray[np.floating]:
        """(rows, columns, 2, 8) MTF over the frame; NaN where abstained."""
        return self.estimate.mtf.reshape(*self.grid, 2, FREQUENCIES)


@dataclass(frozen=True)
class NoiseState:
    """Noise over a frame.

    Attributes:
        patches: N squares of the frame, row by row from the top.
        estimate: their N answers.
        grid: (rows, columns) of the patches.
        summary: over the patches: arrays of shape (); without an answer where most patches abstain because of a codec.
            Of a frame without fine detail the interval allows for coarse noise (`pipeline.condition.coarse_grain`).
        map_dn: (h, w) sigma over the frame, DN, NaN where unknown: of every 8 x 8 px cell where the estimator gives it,
            else the patches' answers as (rows, columns). All of it is NaN where the summary has no answer: the few
            patches that answer then mostly have grain that looks like noise.
        milliseconds: time on the clock.
        at_most_dn: upper end of the summary's interval; where it has no answer because of a codec, what the frame holds
            at most (`pipeline.condition.summary.most_noise_dn`); else NaN. DN.
        white_sigma_dn: of the summary, the part that is white, as the sensor's is before processing smooths it, DN; NaN
            without an answer and from methods that do not separate it (`pipeline.condition.summary.noise_parts`).
        correlation: of the noise of adjacent pixels, -1 to 1; NaN likewise.
    """

    patches: Sequence[Patch]
    estimate: NoiseEstimate
    grid: tuple[int, int]
    summary: Summary
    map_dn: NDArray[np.floating]
    milliseconds: float
    at_most_dn: float = np.nan
    white_sigma_dn: float = np.nan
    correlation: float = np.nan


@dataclass(frozen=True)
class Condition:
    """Blur and noise of one frame, or of a set of patches taken as one.

    Attributes:
        blur, noise: in detail.
    """

    blur: BlurState
    noise: NoiseState

    @property
    def mtf(self) -> Summary:
        """Summary (2, 8) of the contrast left, 0..1."""
        return self.blur.summary

    @property
    def sigma_dn(self) -> Summary:
        """Summary () of the noise, DN."""
        return self.noise.summary

    @property
    def abstained(self) -> dict[str, bool]:
        """Whether ``blur`` and ``noise`` have no estimate."""
        return {"blur": not np.isfinite(self.mtf.value).all(), "noise": not np.isfinite(self.sigma_dn.value).all()}

    @property
    def reasons(self) -> dict[str, dict[str, int]]:
        """Of ``blur`` and of ``noise``: reason of abstention -> how many patches."""
        parts = {"blur": self.blur.estimate.reason, "noise": self.noise.estimate.reason}
        return {name: dict(sorted(Counter(str(word) for word in why if word).items())) for name, why in parts.items()}

    @property
    def milliseconds(self) -> float:
        """Time on the clock for both."""
        return self.blur.milliseconds + self.noise.milliseconds


class ConditionMonitor:
    """Estimates blur and noise of frames, or of patches.

    Args:
        blur_name: blur estimator of `pipeline.blur`.
        noise_name: noise estimator of `pipeline.noise`.
        blur_options, noise_options: theirs.
        tile_px: side of the tiles that noise is estimated on; smaller frames get one tile of their smaller side.
        most_tiles: of them in a frame; a frame that more would cover gets an even selection
            (`pipeline.condition.frame_tiles`).
        most_patches: likewise of the patches of 192 px that blur is estimated on.

    Raises:
        InputError: unknown names or options, weights that are absent, a tile too small for the noise estimator, or no
            tile or patch at all.
    """

    def __init__(
        self,
        blur_name: str = "spectral",
        noise_name: str = noise.DEFAULT,
        *,
        blur_options: Mapping[str, Any] | None = None,
        noise_options: Mapping[str, Any] | None = None,
        tile_px: int = TILE_PX,
        most_tiles: int = MOST_TILES,
        most_patches: int = MOST_PATCHES,
    ) -> None:
        for name, value in (("tile_px", tile_px), ("most_tiles", most_tiles), ("most_patches", most_patches)):
            if not isinstance(value, Integral) or value < 1:
                raise InputError(f"condition monitor: {name}={value!r}, expected a whole number, at least 1")
        self.blur_name, self.noise_name = blur_name, noise_name
        self.blur_options, self.noise_options = dict(blur_options or {}), dict(noise_options or {})
        self.blur_estimator = blur.create(blur_name, **self.blur_options)
        self.noise_estimator = noise.create(noise_name, **self.noise_options)
        least_px = smallest_patch_px(self.noise_estimator)
        if tile_px < least_px:
            raise InputError(
                f"condition monitor: tile_px={tile_px}, expected at least {least_px} for noise by {noise_name}"
            )
        self.tile_px, self.most_tiles, self.most_patches = tile_px, most_tiles, most_patches
        estimators = {"blur": self.blur_estimator, "noise": self.noise_estimator}
        self._calibrated: tuple[Any, Any] = (None, None)
        """The estimator that `calibrate` made, and the one that it was made of."""
        self.weights_released = {name: bool(getattr(made, "released", True)) for name, made in estimators.items()}
        """Of ``blur`` and ``noise``: False where the estimator runs on weights that are not the released ones."""

    def calibrate(
        self, sharp_frames: Sequence[NDArray[np.floating]], *, fitted: bool = False, names: Iterable[str] = ()
    ) -> None:
        """Answer from now on with the blur that was *added* to this camera's own sharp frames.

        Called again, it takes the place of the calibration before. A frame that does not look sharp itself gives a
        `UserWarning` (`pipeline.condition.summary.unsharp`): blur relative to it is underestimated.

        Args:
            sharp_frames: (H, W) frames in [0, 1], known to be sharp.
            fitted: calibrate by frames that are blurred synthetically (`pipeline.blur.camera_calibration`), which takes
                some thousand estimates; otherwise divide by the estimates of the frames as they are, which makes sharp
                frames exactly 1, but errs more where there is blur. An estimator of several members is always fitted.
            names: of the frames, for warnings; their numbers by default.

        Raises:
            InputError: none of their patches can be measured, the blur estimator's answers are relative to something
                already, as the generic lens, or there are not as many names as frames.
        """
        calibrated, made_of = self._calibrated
        uncalibrated = made_of if self.blur_estimator is calibrated else self.blur_estimator
        refuse_relative(uncalibrated)
        readable = readable_patches(sharp_frames)
        patches = np.concatenate(readable)
        labels = list(names)
        if labels and len(labels) != len(readable):
            raise InputError(f"sharp frames: {len(labels)} names of {len(readable)} frames; give one for each, or none")
        labels = labels or [f"sharp frame {number + 1} of {len(readable)}" for number in range(len(readable))]
        for label, part in zip(labels, readable, strict=True):
            if len(part):
                _warn_of_blur(label, uncalibrated, self.blur_name, part)
        if not fitted and isinstance(uncalibrated, Estimator) and not isinstance(uncalibrated, CameraFittable):
            self.blur_estimator = uncalibrated.divided(patches)
        elif fitted:
            self.blur_estimator = CalibratedEstimator(uncalibrated, calibrate(uncalibrated, patches))
        else:
            self.blur_estimator = uncalibrated.calibrated(patches)
        self._calibrated = (self.blur_estimator, uncalibrated)

    def frame(self, image: NDArray[np.floating], codec: str = "", quantiser: int | None = None) -> Condition:
        """The condition of one frame; bars beside the picture are left out (`pipeline.condition.picture_area`).

        Args:
            image: (H, W) float in [0, 1], grey levels as the camera encoded them (not linear light).
            codec: of the video that it is a frame of, by FFmpeg's name, where that is known, e.g. ``"hevc"``, or its
                four-character code; of some, weak noise is not estimated (`pipeline.condition.video_codecs`).
            quantiser: how coarsely it quantised the frame, where that is known
                (`pipeline.datasets.decoding.video_coding`).

        Returns:
            the condition; blur abstains with a frame smaller than 192 px.

        Raises:
            InputError: not such a frame, smaller than the noise estimator needs, or an estimator gives no answer
                (`pipeline.answers.asked`).
        """
        picture = grey_frame(image)
        area = _area(picture, self.noise_estimator)
        shape = picture[area].shape
        large_enough = min(shape) >= PATCH_PX
        squares = shifted(frame_tiles(shape, PATCH_PX, self.most_patches), area) if large_enough else []
        small = shifted(frame_tiles(shape, self.tile_px, self.most_tiles), area)
        blurred = self._blur(cut(picture, squares), squares)
        return Condition(blurred, self._noise(cut(picture, small), small, picture, codec, quantiser))

    def patches(self, patches: NDArray[np.floating]) -> Condition:
        """The condition of a set of patches, say of all objects in a frame.

        Args:
            patches: (N, 1, 192, 192) float in [0, 1]; both estimators see the same pixels.

        Returns:
            the condition; grids have one row, places are 0.

        Raises:
            InputError: the patches are not as expected, or an estimator gives no answer (`pipeline.answers.asked`).
        """
        stack = as_patches(patches)
        positions = [Patch(0, 0, PATCH_PX) for _ in range(len(stack))]
        return Condition(self._blur(stack, positions), self._noise(stack, positions, None))

    def _blur(self, stack: NDArray[np.float32], squares: Sequence[Patch]) -> BlurState:
        start = time.perf_counter()
        if not squares:
            stack = np.empty((0, 1, PATCH_PX, PATCH_PX), np.float32)
        answer = asked(f"blur estimator '{self.blur_name}'", self.blur_estimator.estimate, stack, "mtf")
        readable = _without(answer, _unreadable(stack))
        result = _without(readable, {CONTRADICTED: contradicted(readable, stack)})
        taken = (time.perf_counter() - start) * 1e3
        return BlurState(squares, result, _grid(squares), summarise(result.mtf, result.low, result.high), taken)

    def _noise(
        self,
        stack: NDArray[np.float32],
        squares: Sequence[Patch],
        picture: NDArray[np.float32] | None,
        codec: str = "",
        quantiser: int | None = None,
    ) -> NoiseState:
        return _noise(self.noise_estimator, self.noise_name, stack, squares, picture, codec, quantiser)


def readable_patches(sharp_frames: Sequence[NDArray[np.floating]]) -> list[NDArray[np.float32]]:
    """Of each frame that was given as sharp, the patches that an estimator can read sharpness from.

    Args:
        sharp_frames: (H, W) float in [0, 1], grey levels as the camera encoded them.

    Returns:
        for each frame (N, 1, 192, 192): patches that cover it inside bars beside the picture, without those that hold
        shading and noise only or that a uniform surround covers in part; N may be 0.

    Raises:
        InputError: not such frames, none is as large as a patch, or no patch of any is left.
    """
    cuts = [_whole_cover(grey_frame(frame)) for frame in sharp_frames]
    if not any(map(len, cuts)):
        raise InputError(f"sharp frames: none is as large as a patch of {PATCH_PX} px; give whole frames")
    readable = [_readable(part) for part in cuts]
    if not any(map(len, readable)):
        raise InputError("sharp frames: no patch has structure that shows sharpness, only shading and noise")
    none = np.empty((0, 1, PATCH_PX, PATCH_PX), np.float32)  # of a frame smaller than a patch
    return [part if len(part) else none for part in readable]


def noise_of_frame(
    estimator: NoiseEstimator,
    image: NDArray[np.floating],
    tile_px: int = TILE_PX,
    most_tiles: int = MOST_TILES,
    *,
    codec: str = "",
    quantiser: int | None = None,
    name: str = "",
) -> NoiseState:
    """The noise of one frame alone, as `ConditionMonitor.frame` has it.

    Args:
        estimator: of `pipeline.noise`.
        image: (H, W) float in [0, 1], grey levels as the camera encoded them.
        tile_px: side of the tiles; smaller frames get one tile of their smaller side.
        most_tiles: of them.
        codec: see `ConditionMonitor.frame`.
        quantiser: see there.
        name: of the estimator in messages; that of its class by default.

    Returns:
        the noise over the tiles inside bars beside the picture.

    Raises:
        InputError: not such a frame, smaller than the estimator needs, or no answer (`pipeline.answers.asked`).
    """
    picture = grey_frame(image)
    area = _area(picture, estimator)
    squares = shifted(frame_tiles(picture[area].shape, tile_px, most_tiles), area)
    known = name or type(estimator).__name__
    return _noise(estimator, known, cut(picture, squares), squares, picture, codec, quantiser)


def _noise(
    estimator: NoiseEstimator,
    name: str,
    stack: NDArray[np.float32],
    squares: Sequence[Patch],
    picture: NDArray[np.float32] | None,
    codec: str = "",
    quantiser: int | None = None,
) -> NoiseState:
    """The noise of squares (N, 1, h, w) of a frame, or of patches without one."""
    start = time.perf_counter()
    grid = _grid(squares)
    lost = covered(stack)
    called = f"noise estimator '{name}'"
    if picture is not None and isinstance(estimator, CellEstimator):
        result, cells = asked(called, estimator.estimate_cells, stack, "sigma_dn", partial(_checked_cells, stack.shape))
        cells = np.where(lost[:, None, None], np.float32(np.nan), cells)
        whole: NDArray[np.floating] = pasted(cells, squares, (picture.shape[0], picture.shape[1]))
    else:
        result = asked(called, estimator.estimate, stack, "sigma_dn")
        whole = np.where(lost, np.nan, result.sigma_dn).reshape(grid)
    result = _without(result, {COVERED_REASON: lost})
    taken = (time.perf_counter() - start) * 1e3
    coarse_dn = np.nan
    if picture is not None:
        coarse_dn = most_coarse_noise_dn(stack[~np.isin(result.reason, (FLAT, SATURATED, COVERED_REASON))])
    summary = summarise_noise(result)
    hidden_dn = hidden_noise_dn(codec, quantiser)
    if is_doubtful(float(summary.value), hidden_dn):
        result = withheld(result, hidden_dn)
        summary = summarise_noise(result)
    summary = with_upper_end(summary, coarse_dn)
    if np.isnan(summary.value):
        whole = np.full_like(whole, np.nan)
    bound_dn, parts = at_most_dn(result, summary, coarse_dn), noise_parts(result, summary)
    return NoiseState(squares, result, grid, summary, whole, taken, bound_dn, *parts)


def _checked_cells(shape: tuple[int, ...], answered: object) -> object:
    """The estimate out of what `estimate_cells` returned for patches of a shape (N, 1, h, w)."""
    if not (isinstance(answered, tuple) and len(answered) == 2):
        raise WrongAnswer(f"estimate_cells returned {type(answered).__name__}, expected a tuple: estimate and cells")
    check_array("cells", answered[1], (shape[0], shape[2] // CELL_PX, shape[3] // CELL_PX))
    return answered[0]


def withheld(estimate: NoiseEstimate, hidden_dn: float) -> NoiseEstimate:
    """The estimate of a frame's tiles behind a codec that may hide noise: no answers, and bounds that allow for it."""
    masked = _without(estimate, {COMPRESSED: ~estimate.abstained})
    most_dn = estimate.at_most_dn
    return masked if most_dn is None else replace(masked, at_most_dn=np.hypot(most_dn, hidden_dn))


def _whole_cover(frame: NDArray[np.float32]) -> NDArray[np.float32]:
    """(N, 1, 192, 192) patches that cover a frame inside its bars; none where it is too small."""
    area = picture_area(frame)
    return cut(frame, shifted(tiles(frame[area].shape, PATCH_PX, "cover"), area))


def _warn_of_blur(label: str, estimator: Any, name: str, patches: NDArray[np.float32]) -> None:
    """Warn of a frame that was given as sharp and does not look it, by up to `DOUBTED_BY` of its patches."""
    shown = patches[evenly_spread(range(len(patches)), DOUBTED_BY)]
    result = asked(f"blur estimator '{name}'", estimator.estimate, shown, "mtf")
    doubt = unsharp(summarise(result.mtf, result.low, result.high).value)
    if doubt:
        warnings.warn(f"{label} {doubt}", stacklevel=3)


def _readable(stack: NDArray[np.float32]) -> NDArray[np.float32]:
    """Of (N, 1, 192, 192) patches those that an estimator can read blur from."""
    lost = np.zeros(len(stack), bool)
    for patches in _unreadable(stack).values():
        lost |= patches
    return stack[~lost]


def _unreadable(stack: NDArray[np.float32]) -> dict[str, NDArray[np.bool_]]:
    """Patches that no estimator can read blur from, by reason."""
    if not len(stack):
        return {}
    return {STRUCTURELESS: structureless(stack), COVERED_REASON: covered(stack), STRIPED: striped(stack)}


def _without(estimate: Estimate, lost: Mapping[str, NDArray[np.bool_]]) -> Estimate:
    """The estimate of blur or noise without answers for the patches lost, by reason; other abstentions stay."""
    for reason, patches in lost.items():
        abstaining = patches & ~estimate.abstained
        if not abstaining.any():
            continue
        masked: dict[str, Any] = {"hidden": None} if isinstance(estimate, BlurEstimate) else {}
        for part in fields(estimate):
            values = getattr(estimate, part.name)
            if part.name not in ("abstained", "reason", "hidden") and values is not None:
                masked[part.name] = np.where(np.expand_dims(abstaining, tuple(range(1, values.ndim))), np.nan, values)
        reasons = np.where(abstaining, reason, estimate.reason)
        estimate = replace(estimate, abstained=estimate.abstained | abstaining, reason=reasons, **masked)
    return estimate


def _area(picture: NDArray[np.float32], estimator: NoiseEstimator) -> tuple[slice, slice]:
    """The part of a frame inside its bars.

    Raises:
        InputError: it is smaller than the noise estimator needs.
    """
    area = picture_area(picture)
    (height, width), least_px = picture[area].shape, smallest_patch_px(estimator)
    if min(height, width) < least_px:
        inside = "" if (height, width) == picture.shape else " inside the bars beside it"
        raise InputError(
            f"frame: the picture{inside} has {width} x {height} px; noise needs at least {least_px} px a side"
        )
    return area


def _grid(squares: Sequence[Patch]) -> tuple[int, int]:
    """Rows and columns of squares listed row by row; squares in one place count as one row."""
    rows = len({square.y_px for square in squares})
    return (rows, len(squares) // rows) if rows else (0, 0)
