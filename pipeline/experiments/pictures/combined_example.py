"""The example of a combined experiment: one patch at each step of image formation and noise level, and MTF curves."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.camera import mtf
from pipeline.camera.psf.kernel import Kernel
from pipeline.camera.settings import CameraSettings
from pipeline.camera.steps import steps as chain
from pipeline.camera.truth import Corrupted
from pipeline.cluster_intervals import NO_INTERVAL
from pipeline.datasets.patches import Patch
from pipeline.experiments.calibrate import raw_and_calibrated
from pipeline.experiments.combined import CELL, Pair
from pipeline.experiments.condition import Condition, nearest_rotation
from pipeline.experiments.corrupt import SharpFrame
from pipeline.experiments.frames import TestFrame
from pipeline.experiments.intervals import bootstrap_stream, frame_interval, robust_median
from pipeline.experiments.tables import CURVES
from pipeline.statistics import robust
from pipeline.streams import stream

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.datasets.frame import Frame

ENDS = {"input": "scene", "quantised": "frame"}
"""Names of the first and the last step in the tables and arrays of an example; the others keep theirs."""


def steps(formation: Corrupted, patch: Patch) -> dict[str, NDArray[np.uint8]]:
    """One patch after every step of image formation that did something.

    Args:
        formation: a corrupted frame.
        patch: of that frame.

    Returns:
        name of the step (`pipeline.camera.steps`, `ENDS`) -> (h, w) uint8, in the order of the camera.
    """
    return {ENDS.get(step.name, step.name): _middle(step.image * 255.0, patch) for step in chain(formation)}


def _middle(image_dn: NDArray[np.floating], patch: Patch) -> NDArray[np.uint8]:
    """The middle quarter of a patch, uint8."""
    side, edge = patch.size_px // 2, patch.size_px // 4
    piece = image_dn[patch.y_px + edge : patch.y_px + edge + side, patch.x_px + edge : patch.x_px + edge + side]
    return np.rint(piece).astype(np.uint8)


def highest_contrast_patch(frames: Iterable[TestFrame]) -> tuple[Frame, Patch]:
    """The patch whose middle has the highest standard deviation, so that a blur is visible in it.

    Args:
        frames: with patches for the MTF, at least one; the first of equals is taken.
    """
    candidates = []
    for item in frames:
        image = item.frame.image()
        for patch in item.patches["mtf"]:
            candidates.append((float(_middle(image * 255.0, patch).std()), item.frame, patch))
    _, frame, patch = max(candidates, key=lambda entry: entry[0])
    return frame, patch


def example(
    frame: Frame,
    patch: Patch,
    pairs: Sequence[Pair],
    kernels: Sequence[Kernel],
    size_px: float,
    target_sigmas_dn: Sequence[float],
    camera: CameraSettings,
    seed: int,
) -> tuple[dict[str, NDArray[np.uint8]], dict[str, Any]]:
    """Images and their description, as the report draws them.

    Args:
        frame: the frame shown.
        patch: its patch.
        pairs: what comes together.
        kernels: the bank.
        size_px: of the blur shown.
        target_sigmas_dn: shown; the steps are those of the highest.
        camera: the camera that forms the image.
        seed: root of the random streams.

    Returns:
        ``step_<experiment>_<step>`` and ``level_<experiment>_<number>`` (h, w) uint8; and ``{"dataset", "frame",
        "label", "kernel_size_px", "experiments": [{"experiment", "kernel", "blur_kind", "noise_source", "angle_deg",
        "steps",
        "target_sigmas_dn"}]}``. Experiments whose kernel the bank lacks are left out.
    """
    sharp = SharpFrame(frame, camera, seed, paired=False)
    arrays: dict[str, NDArray[np.uint8]] = {}
    entries = []
    for pair in pairs:
        kernel = nearest_rotation(kernels, pair.blur_kind, size_px)
        if kernel is None:
            continue
        for number, level in enumerate(target_sigmas_dn):
            formation = sharp.formation(Condition(kernel, pair.noise_source, float(level), pair.name))
            arrays[f"level_{pair.name}_{number}"] = _middle(formation.image * 255.0, patch)
            if level == max(target_sigmas_dn):
                images = steps(formation, patch)
                arrays |= {f"step_{pair.name}_{name}": image for name, image in images.items()}
        entries.append(
            {
                "experiment": pair.name,
                "kernel": kernel.name,
                "blur_kind": kernel.kind,
                "noise_source": pair.noise_source,
                "angle_deg": float(kernel.angle_deg),
                "steps": list(images),
                "target_sigmas_dn": [float(level) for level in target_sigmas_dn],
            }
        )
    head = {"dataset": frame.dataset, "frame": frame.name, "label": patch.label, "kernel_size_px": float(size_px)}
    return arrays, {**head, "experiments": entries}


def example_angle(measurements: pd.DataFrame, kind: str, size_px: float, angle_deg: float = 45.0) -> float:
    """The rotation, of those measured, that is nearest to the one wanted (the smaller of two)."""
    rows = (measurements["blur_kind"] == kind) & (measurements["kernel_size_px"] == size_px)
    return float(min(measurements.loc[rows, "angle_deg"].unique(), key=lambda angle: (abs(angle - angle_deg), angle)))


def example_curves(measurements: pd.DataFrame, size_px: float, seed: int = 0, draws: int = 500) -> pd.DataFrame:
    """MTF curves of one kernel of each experiment, over levels: robust statistics over patches.

    Args:
        measurements: `pipeline.experiments.tables.MEASUREMENTS`; rows of noise are passed over.
        size_px: of the kernel; of motion, the rotation nearest to 45 degrees.
        seed: root of the bootstrap's random streams.
        draws: bootstrap resamples of frames.

    Returns:
        `pipeline.experiments.tables.CURVES`; axis ``"HV"`` is the mean of both directions, which the paper draws.
    """
    import pandas as pd

    keys = [*CELL, "angle_deg"]
    rows = []
    quiet: dict[tuple[object, ...], tuple[NDArray[np.str_], dict[str, NDArray[np.float64]]]] = {}
    for calibrated, table in raw_and_calibrated(measurements[measurements["quantity"] == "mtf"]):
        of_size = table[table["kernel_size_px"] == size_px]
        for key, group in of_size.groupby(keys, sort=True):
            cell = dict(zip(keys, key, strict=True))
            if cell["angle_deg"] != example_angle(of_size, str(cell["blur_kind"]), size_px):
                continue
            ordered = group.sort_values(["frame", "patch", "axis", "frequency"])
            shape = (-1, 2, len(mtf.FREQUENCIES))
            estimates, truth = (ordered[name].to_numpy(float).reshape(shape) for name in ("estimate", "truth"))
            frames = ordered["frame"].to_numpy(str).reshape(shape)[:, 0, 0]
            del cell["noise_source"]
            axes = {"H": estimates[:, 0], "V": estimates[:, 1], "HV": estimates.mean(axis=1)}
            true_of = {"H": truth[0, 0], "V": truth[0, 1], "HV": truth[0].mean(axis=0)}
            curve = (calibrated, *(value for name, value in cell.items() if name != "target_sigma_dn"))
            is_least = curve not in quiet  # keys are sorted: the least noise comes first
            same_frames, least = quiet.setdefault(curve, (frames, axes))
            for axis, curves in axes.items():
                true = true_of[axis]
                for point, values in enumerate(curves.T):
                    low, high = NO_INTERVAL
                    if not is_least and np.array_equal(frames, same_frames):
                        generator = bootstrap_stream(seed, "example curves", *map(str, key), calibrated, axis, point)
                        low, high = change_interval(least[axis].T[point], values, frames, generator, draws)
                    statistics = robust(values, stream(0, "bootstrap", "no interval"), 1)
                    rows.append(
                        {
                            **cell,
                            "calibrated": calibrated,
                            "axis": axis,
                            "frequency_index": point,
                            "frequency": float(mtf.FREQUENCIES[point]),
                            "true_mtf": float(true[point]),
                            "median": statistics.median,
                            "minimum": statistics.minimum,
                            "maximum": statistics.maximum,
                            "change_low": low,
                            "change_high": high,
                            "count": statistics.count,
                            "abstained": statistics.abstained,
                        }
                    )
    return CURVES.conform(pd.DataFrame(rows, columns=list(CURVES.columns)))


def change_interval(
    before: NDArray[np.float64],
    after: NDArray[np.float64],
    frames: NDArray[np.str_],
    generator: np.random.Generator,
    draws: int,
) -> tuple[float, float]:
    """95 % interval of the change of a robust median over patches, whole frames resampled for both at once.

    Args:
        before: (N,) estimates of N patches, NaN where abstained.
        after: (N,) those of the same patches.
        frames: (N,) the frame of each.
        generator: random stream of the bootstrap.
        draws: see `pipeline.experiments.intervals.frame_interval`.

    Returns:
        lower and upper end; NaN with fewer than two frames that have an estimate before and after.
    """
    answered = [np.isin(frames, frames[np.isfinite(values)]) for values in (before, after)]
    both = answered[0] & answered[1]
    if not both.any():
        return NO_INTERVAL

    def change(patches: NDArray[np.float64]) -> NDArray[np.float64]:
        return robust_median(patches[..., 1]) - robust_median(patches[..., 0])

    return frame_interval(np.stack([before, after], axis=1)[both], frames[both], change, generator, draws)
