"""Maps of local noise: an estimator's, beside the noise added in each cell's neighbourhood.

Photon noise grows with brightness, so that one number describes a frame badly; an estimator that estimates cell by cell
is compared with the noise about each cell.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.settings import CameraSettings
from pipeline.experiments.condition import Condition
from pipeline.experiments.corrupt import SharpFrame
from pipeline.experiments.run import opened
from pipeline.noise.maps import CELL_PX, NoiseMapper

if TYPE_CHECKING:
    from pipeline.datasets.frame import Frame

NEIGHBOURHOOD_PX = 40
"""Side of the square whose noise is a cell's truth: 1600 samples give a standard deviation to 1.8 %."""

SHOWN_SOURCES = ("photon", "dcsn")


def local_truth(noise_dn: NDArray[np.float32]) -> NDArray[np.float32]:
    """Root mean square of the noise about each cell's centre.

    Args:
        noise_dn: (H, W) noise of zero mean, DN.

    Returns:
        (ceil(H / 8), ceil(W / 8)) DN.
    """
    import cv2

    side = (NEIGHBOURHOOD_PX, NEIGHBOURHOOD_PX)
    # In double precision, and never below zero: a running sum leaves rounding where there is no noise.
    power = np.maximum(cv2.blur(np.square(noise_dn, dtype=np.float64), side, borderType=cv2.BORDER_REFLECT_101), 0.0)
    rows, columns = (
        np.minimum(np.arange(CELL_PX // 2, length + CELL_PX // 2, CELL_PX), length - 1) for length in noise_dn.shape
    )
    sigma_dn: NDArray[np.float32] = np.sqrt(power[np.ix_(rows, columns)]).astype(np.float32)
    return sigma_dn


def noise_maps(
    frame: Frame,
    estimator: Any,
    noise_sources: Sequence[str],
    target_sigma_dn: float,
    camera: CameraSettings,
    seed: int,
    *,
    paired: bool = False,
) -> tuple[dict[str, NDArray[Any]], dict[str, Any]] | None:
    """Maps of one frame under photon noise and under noise that does not depend on brightness.

    Args:
        frame: a sharp frame.
        estimator: of noise (`pipeline.experiments.run.opened`); without a ``map`` there is nothing to show.
        noise_sources: of the study; the maps take `SHOWN_SOURCES` of them, or else the first.
        target_sigma_dn: standard deviation over the frame asked for, DN.
        camera: the camera that adds the noise.
        seed: root of the random streams.
        paired: see `pipeline.experiments.corrupt`.

    Returns:
        arrays ``<source>_seen`` (H, W) uint8, ``<source>_added`` and ``<source>_found`` (h, w) float32 DN, and their
        description (dataset, frame, target_sigma_dn, cell_px, effects); None without a ``map`` of cells.
    """
    estimator = opened(estimator)
    if not isinstance(estimator, NoiseMapper):
        return None
    sharp = SharpFrame(frame, camera, seed, paired=paired)
    arrays: dict[str, NDArray[Any]] = {}
    chosen = [source for source in SHOWN_SOURCES if source in noise_sources] or list(noise_sources[:1])
    for source in chosen:
        formation = sharp.formation(Condition(noise_source=source, target_sigma_dn=float(target_sigma_dn)))
        estimated, added = estimator.map(formation.image), local_truth(formation.noise_dn)
        if estimated.shape != added.shape:  # a map of other cells than ours
            return None
        arrays |= {f"{source}_seen": formation.image_8bit, f"{source}_added": added, f"{source}_found": estimated}
    description = {"dataset": frame.dataset, "frame": frame.name, "target_sigma_dn": target_sigma_dn}
    return arrays, {**description, "cell_px": CELL_PX, "effects": chosen}
