"""Kernel estimates as pictures: one patch under the kernels of the bank, with the kernel estimated from it.

The patches are those of Table I (`pipeline.experiments.table_one`), so that a kernel shown is the one behind the row of
the same frame, patch and kernel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.answers import asked
from pipeline.blur.base import BlurEstimate
from pipeline.camera import mtf
from pipeline.camera.psf.kernel import Kernel
from pipeline.camera.quantise import to_8bit
from pipeline.camera.settings import CameraSettings
from pipeline.datasets.patches import Patch, cut
from pipeline.experiments.condition import Condition, first_rotations
from pipeline.experiments.corrupt import SharpFrame
from pipeline.experiments.run import Executor, in_process, opened

if TYPE_CHECKING:
    from pipeline.datasets.frame import Frame


@dataclass(frozen=True)
class Picture:
    """One kernel's entry.

    Attributes:
        kernel: the kernel applied.
        patch: (h, w) uint8, as given to the estimator.
        estimate: of this one patch.
    """

    kernel: Kernel
    patch: NDArray[np.uint8]
    estimate: BlurEstimate

    @property
    def amae_percent(self) -> float:
        """AMAE of this patch alone; NaN where abstained."""
        return float(mtf.amae(self.estimate.mtf[0], mtf.sample(self.kernel.psf)))


def picture(
    kernel: Kernel, *, frame: Frame, patch: Patch, estimator: Any, camera: CameraSettings, seed: int
) -> Picture:
    """Blur a frame by one kernel and estimate one of its patches.

    Args:
        kernel: the blur.
        frame: a sharp frame.
        patch: of that frame.
        estimator: see `pipeline.experiments.run.Method`.
        camera: the camera that forms the image.
        seed: root of the random streams.
    """
    pixels = cut(SharpFrame(frame, camera, seed).under(Condition(kernel)).image, [patch])
    asking = opened(estimator)
    estimate = asked(f"blur estimator '{type(asking).__name__}'", asking.estimate, pixels, "mtf")
    return Picture(kernel, to_8bit(pixels[0, 0]), estimate)


def gallery(
    frame: Frame,
    patches: Sequence[Patch],
    kernels: Sequence[Kernel],
    estimator: Any,
    camera: CameraSettings,
    seed: int,
    executor: Executor = in_process,
) -> tuple[dict[str, np.ndarray], dict[str, Any]] | None:
    """Arrays and their description, as the report draws them: the first patch under each kernel of rotation 0.

    Args:
        frame: the frame shown.
        patches: of that frame, at least one.
        kernels: the bank; of each kind and size the smallest rotation (0 in the paper's bank) is shown.
        estimator: one that estimates kernels; see `pipeline.experiments.run.Method`.
        camera: the camera that forms the image.
        seed: root of the random streams.
        executor: changes no result.

    Returns:
        ``patch_<kernel>`` (h, w) uint8, ``estimate_<kernel>`` (k, k) float32, NaN where abstained, and
        ``truth_<kernel>`` (n, n) float32; and ``{"dataset", "frame", "patch", "label", "kernels": [{"kernel",
        "blur_kind", "kernel_size_px", "mtf", "true_mtf", "amae_percent", "abstained", "reason"}]}`` with MTFs as
        [H, V] lists of eight.
        None if the estimator has no kernels.
    """
    chosen = first_rotations(kernels)
    make = partial(picture, frame=frame, patch=patches[0], estimator=estimator, camera=camera, seed=seed)
    first = make(chosen[0])
    if first.estimate.kernel is None:
        return None
    arrays: dict[str, np.ndarray] = {}
    entries = []
    for made in [first, *executor(make, chosen[1:], "kernels shown")]:
        name, estimate = made.kernel.name, made.estimate
        assert estimate.kernel is not None  # an estimator has kernels for every patch or for none
        arrays[f"patch_{name}"] = made.patch
        arrays[f"estimate_{name}"] = estimate.kernel[0].astype(np.float32)
        arrays[f"truth_{name}"] = made.kernel.psf.astype(np.float32)
        entries.append(
            {
                "kernel": name,
                "blur_kind": made.kernel.kind,
                "kernel_size_px": float(made.kernel.size_px),
                "mtf": estimate.mtf[0].tolist(),
                "true_mtf": mtf.sample(made.kernel.psf).tolist(),
                "amae_percent": made.amae_percent,
                "abstained": bool(estimate.abstained[0]),
                "reason": str(estimate.reason[0]),
            }
        )
    head = {"dataset": frame.dataset, "frame": frame.name, "patch": 0, "label": patches[0].label}
    return arrays, {**head, "kernels": entries}
