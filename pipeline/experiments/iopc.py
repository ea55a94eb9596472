"""Noise and MTF as estimated on objects, under every condition of a detection sweep: the axes of the IOPC curves.

The paper's curves are drawn over what a camera can estimate of itself, not over the condition asked for: over the
patches on objects, the median noise and the median MTF (mean of horizontal and vertical, at the second frequency).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from pipeline import blur, noise
from pipeline.camera import mtf
from pipeline.camera.psf.kernel import Kernel
from pipeline.camera.settings import CameraSettings
from pipeline.datasets.frame import Box, Frame
from pipeline.datasets.patches import Patch, object_patches, tiles
from pipeline.datasets.selection import evenly_spread
from pipeline.detection.classes import ClassMap
from pipeline.errors import InputError
from pipeline.experiments.condition import Quantity, grid
from pipeline.experiments.frames import TestFrame
from pipeline.experiments.run import Executor, Method, Registered, in_process, run
from pipeline.experiments.tables import MEASURED

if TYPE_CHECKING:
    import pandas as pd

    from pipeline.detection.settings import EvaluationSettings
    from pipeline.experiments.settings import MeasureSettings

MOST_WORDS = 8
"""Words of labels that a message names."""
FREQUENCY_INDEX = 1
"""Which of the paper's eight frequencies an MTF is taken at."""


def on_objects(
    frames: Sequence[Frame], words: ClassMap, section: MeasureSettings, criteria: EvaluationSettings
) -> list[TestFrame]:
    """Frames with patches for the MTF and tiles for noise that overlap objects to be detected.

    Args:
        frames: labelled.
        words: what the labels mean to a detector.
        section: sides of patches and tiles, and how many of a frame.
        criteria: which objects count.
    """
    chosen = []
    for frame in frames:
        truth = words.truth(frame.boxes, criteria.min_height_px, criteria.min_visible_fraction)
        boxes = [Box("object", x1, y1, x2, y2) for x1, y1, x2, y2 in truth.boxes[~truth.ignore].tolist()]
        shape = frame.image().shape
        patches = object_patches(shape, boxes, section.patch_px)
        over = [tile for tile in tiles(shape, section.tile_px, "cover") if any(_meet(tile, box) for box in boxes)]
        limited: dict[Quantity, list[Patch]] = {
            "mtf": evenly_spread(patches, section.per_frame),
            "sigma_dn": evenly_spread(over, section.per_frame),
        }
        chosen.append(TestFrame(frame, limited))
    return chosen


def _meet(tile: Patch, box: Box) -> bool:
    inside_x = box.x1 < tile.x_px + tile.size_px and box.x2 > tile.x_px
    return inside_x and box.y1 < tile.y_px + tile.size_px and box.y2 > tile.y_px


def measure(
    frames: Sequence[TestFrame],
    kernels: Sequence[Kernel],
    noise_source: str,
    target_sigmas_dn: Sequence[float],
    section: MeasureSettings,
    *,
    camera: CameraSettings | None = None,
    seed: int = 1,
    executor: Executor = in_process,
    label: str = "",
) -> pd.DataFrame:
    """Noise and MTF of every frame behind every kernel at every level.

    Args:
        frames: from `on_objects`.
        kernels: of the sweep, the sharp one among them.
        noise_source: of the noise.
        target_sigmas_dn: levels, DN.
        section: names of the estimators.
        camera: that forms the images; the paper's if None.
        seed: root of the random streams.
        executor: changes no result.
        label: of its progress bar.

    Returns:
        `pipeline.experiments.tables.MEASURED`.

    Raises:
        InputError: no frame has an object.
    """
    measurements = run(
        frames,
        grid(kernels, [noise_source], target_sigmas_dn),
        [
            Method(section.mtf, "mtf", Registered(blur.create, section.mtf)),
            Method(section.sigma, "sigma_dn", Registered(noise.create, section.sigma)),
        ],
        camera=camera,
        seed=seed,
        executor=executor,
        label=label,
    )
    if measurements.empty:
        names = " and ".join(sorted({item.frame.dataset for item in frames})) or "without frames"
        counts = Counter(box.label for item in frames for box in item.frame.boxes)
        words = ", ".join(f"'{word}' ({count})" for word, count in counts.most_common(MOST_WORDS)) or "nothing"
        raise InputError(
            f"dataset '{names}': no frame has an object to measure noise and blur on; its labels say {words}; "
            "'camera-monitor dataset' shows which words are objects, detection.evaluation which are large enough"
        )
    return measured(measurements)


def measured(measurements: pd.DataFrame) -> pd.DataFrame:
    """One row for the noise of a tile, and one for the MTF of a patch: the mean of both directions at one frequency.

    Args:
        measurements: `pipeline.experiments.tables.MEASUREMENTS`.

    Returns:
        `pipeline.experiments.tables.MEASURED`.
    """
    frequency = mtf.FREQUENCIES[FREQUENCY_INDEX]
    is_mtf = (measurements["quantity"] == "mtf").to_numpy()
    at = np.isclose(measurements["frequency"].to_numpy(float), frequency)
    horizontal, vertical = (is_mtf & at & (measurements["axis"] == axis).to_numpy() for axis in "HV")
    rows = measurements[~is_mtf | horizontal].copy()
    of_mtf = (rows["quantity"] == "mtf").to_numpy()
    for name in ("estimate", "truth"):
        both = np.stack([measurements.loc[part, name].to_numpy(float) for part in (horizontal, vertical)], axis=1)
        mean = both.mean(axis=1)
        single = name == "estimate"  # the precision that networks estimate in
        rows.loc[of_mtf, name] = mean.astype(np.float32) if single else mean
    rows = rows.rename(columns={"truth": "true"})
    return MEASURED.conform(rows[list(MEASURED.columns)])
