"""Kernel estimates as pictures: one patch under the kernels of the bank, with the kernel an estimator finds in it.

The pictures are made as `pipeline.blur.evaluation.evaluate_frame` makes its numbers, so that a kernel shown is the one
behind the row of the same frame, patch and kernel.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.blur.base import BlurEstimate, BlurEstimator
from pipeline.blur.evaluation import SHARP
from pipeline.camera import mtf
from pipeline.camera.psf.kernel import Kernel
from pipeline.datasets.corrupted import CameraSettings, corrupted
from pipeline.datasets.patches import Patch, cut

if TYPE_CHECKING:
    from pipeline.datasets.frame import Frame

Map = Callable[[Callable[[Kernel], "Picture"], Sequence[Kernel], str], list["Picture"]]


@dataclass(frozen=True)
class Picture:
    """One kernel's entry.

    Attributes:
        kernel: the kernel applied.
        patch: (h, w) uint8, what the estimator saw.
        answer: of this one patch.
    """

    kernel: Kernel
    patch: NDArray[np.uint8]
    answer: BlurEstimate

    @property
    def amae_percent(self) -> float:
        """AMAE of this patch alone; NaN where abstained."""
        return float(mtf.amae(self.answer.mtf[0], mtf.sample(self.kernel.psf)))


def picture(
    kernel: Kernel, *, frame: Frame, patch: Patch, estimator: BlurEstimator, camera: CameraSettings, seed: int
) -> Picture:
    """Blur a frame by one kernel and estimate one of its patches.

    Args:
        kernel: the blur.
        frame: a sharp frame.
        patch: where to look.
        estimator: takes (N, 1, H, W).
        camera: the camera that forms the image.
        seed: root of the random streams.
    """
    psf = None if kernel.name == SHARP else kernel.psf
    shown = corrupted(frame.image(), frame, "photon", 0.0, camera, seed, psf, kernel.name)  # level 0: no noise drawn
    seen = cut(shown.image, [patch])
    return Picture(kernel, np.rint(seen[0, 0] * 255.0).astype(np.uint8), estimator.estimate(seen))


def _in_turn(function: Callable[[Kernel], Picture], kernels: Sequence[Kernel], label: str) -> list[Picture]:
    return [function(kernel) for kernel in kernels]


def _unrotated(kernels: Sequence[Kernel]) -> list[Kernel]:
    """Of each kind and size the kernel of the smallest rotation, in the bank's order."""
    first: dict[tuple[str, float], Kernel] = {}
    for kernel in sorted(kernels, key=lambda kernel: kernel.angle_deg):
        first.setdefault((kernel.kind, kernel.size_px), kernel)
    return [kernel for kernel in kernels if kernel.name != SHARP and first[kernel.kind, kernel.size_px] is kernel]


def gallery(
    frame: Frame,
    patches: Sequence[Patch],
    kernels: Sequence[Kernel],
    estimator: BlurEstimator,
    camera: CameraSettings,
    seed: int,
    run_map: Map = _in_turn,
) -> tuple[dict[str, np.ndarray], dict[str, Any]] | None:
    """Arrays and their description, as the report draws them: the first patch under each kernel of rotation 0.

    Args:
        frame: the frame shown.
        patches: of that frame, at least one.
        kernels: the bank; of each kind and size the smallest rotation (0 in the paper's bank) is shown.
        estimator: one that finds kernels.
        camera: the camera that forms the image.
        seed: root of the random streams.
        run_map: ``run_map(function, kernels, label)``; by default one after the other.

    Returns:
        ``patch_<kernel>`` (h, w) uint8, ``estimate_<kernel>`` (k, k) float32, NaN where abstained, and
        ``truth_<kernel>`` (n, n) float32; and ``{"dataset", "frame", "patch", "label", "kernels": [{"kernel", "kind",
        "size_px", "mtf", "true_mtf", "amae_percent", "abstained", "reason"}]}`` with MTFs as [H, V] lists of eight.
        None if the estimator answers without kernels.
    """
    chosen = _unrotated(kernels)
    make = partial(picture, frame=frame, patch=patches[0], estimator=estimator, camera=camera, seed=seed)
    first = make(chosen[0])
    if first.answer.kernel is None:
        return None
    arrays: dict[str, np.ndarray] = {}
    entries = []
    for made in [first, *run_map(make, chosen[1:], "kernels shown")]:
        name, answer = made.kernel.name, made.answer
        assert answer.kernel is not None  # an estimator has kernels for every patch or for none
        arrays[f"patch_{name}"] = made.patch
        arrays[f"estimate_{name}"] = answer.kernel[0].astype(np.float32)
        arrays[f"truth_{name}"] = made.kernel.psf.astype(np.float32)
        entries.append(
            {
                "kernel": name,
                "kind": made.kernel.kind,
                "size_px": float(made.kernel.size_px),
                "mtf": answer.mtf[0].tolist(),
                "true_mtf": mtf.sample(made.kernel.psf).tolist(),
                "amae_percent": made.amae_percent,
                "abstained": bool(answer.abstained[0]),
                "reason": str(answer.reason[0]),
            }
        )
    head = {"dataset": frame.dataset, "frame": frame.name, "patch": 0, "label": patches[0].label}
    return arrays, {**head, "kernels": entries}
