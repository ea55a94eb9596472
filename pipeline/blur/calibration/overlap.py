"""Which patches show the same scene: windows of one picture that overlap.

Where windows overlap they hold the same pixels. Runs of eight pixels along a row, at 8 bits, are compared: other
pictures hardly ever have one in common, but for flat and saturated areas, whose runs are left out. Patches are joined
along chains of overlaps. Windows side by side, or of a camera's next frame, are not recognised.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.constants import FULL_SCALE_DN

RUN_PX = 8
LEAST_RANGE_DN = 12  # of the grey levels in a run that counts
LEAST_SHARE = 0.05  # of a patch's runs that another one must have
MOST_PATCHES = 40  # that are compared, each with each; more are taken for several pictures, which they need not be


def scenes(patches: NDArray[np.float32]) -> NDArray[np.int_]:
    """The scene of each patch.

    Args:
        patches: (N, h, w) in [0, 1].

    Returns:
        (N,) numbers 0, 1, ... in the order in which scenes appear.
    """
    label = np.arange(len(patches))
    if len(patches) > MOST_PATCHES:
        return label
    runs = [_runs(patch) for patch in patches]
    for second in range(len(patches)):
        for first in range(second):
            if label[first] != label[second] and _overlap(runs[first], runs[second]):
                earlier, later = sorted((label[first], label[second]))
                label[label == later] = earlier
    return np.unique(label, return_inverse=True)[1]


def _runs(patch: NDArray[np.float32]) -> NDArray[np.uint64]:
    """The different runs of a patch, each as one number, sorted."""
    levels = np.rint(patch * FULL_SCALE_DN).astype(np.uint8)
    windows = np.lib.stride_tricks.sliding_window_view(levels, RUN_PX, axis=1).reshape(-1, RUN_PX)
    structured = np.ptp(windows, axis=1) >= LEAST_RANGE_DN
    return np.unique(np.ascontiguousarray(windows[structured]).view(np.uint64).ravel())


def _overlap(first: NDArray[np.uint64], second: NDArray[np.uint64]) -> bool:
    """Whether enough runs of the shorter list are in the longer one."""
    few, many = sorted((first, second), key=len)
    if len(few) == 0:
        return False
    at = np.searchsorted(many, few).clip(max=len(many) - 1)
    return bool(np.mean(many[at] == few) >= LEAST_SHARE)
