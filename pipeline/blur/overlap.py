"""Which patches show the same scene: windows of one picture that overlap.

Where windows overlap they hold the same pixels. Runs of eight pixels along a row, at 8 bits, are compared: other
pictures hardly ever have one in common, but for flat and saturated areas, whose runs are left out. Patches are joined
along chains of overlaps. Windows side by side, or of a camera's next frame, are not recognised.

Not every pair of patches is compared: the `SKETCH_RUNS` runs of lowest hash of each patch, all where it has fewer, are
looked up in every other one, and pairs that have enough of them in common are compared run by run. A pair that shares
no more than `LEAST_SHARE` is missed with a probability of about 1e-6, one that shares more even less often.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.constants import FULL_SCALE_DN

RUN_PX = 8  # whose 8-bit levels make one number
LEAST_RANGE_DN = 12  # of the grey levels in a run that counts
LEAST_SHARE = 0.05  # of a patch's runs that another one must have
SKETCH_RUNS = 512
CANDIDATE_SHARE = LEAST_SHARE / 4  # of a sketch, of which a pair that just overlaps shares 26 +- 5 runs
_MULTIPLIER = np.uint64(0x9E3779B97F4A7C15)  # odd, so that no two runs have the same hash; 2^64 over the golden ratio
_FILTER_BITS = 22

Runs = NDArray[np.uint64]


def scenes(patches: NDArray[np.float32]) -> NDArray[np.int_]:
    """The scene of each patch; takes 1 to 2 ms a patch and up to twice their memory.

    Args:
        patches: (N, h, w) in [0, 1].

    Returns:
        (N,) numbers 0, 1, ... in the order in which scenes appear.
    """
    label = np.arange(len(patches))
    runs = [_runs(patch) for patch in patches]
    for patch, candidates in enumerate(_candidates(runs)):
        for other in candidates:
            if label[patch] != label[other] and _overlap(runs[patch], runs[other]):
                earlier, later = sorted((label[patch], label[other]))
                label[label == later] = earlier
    return np.unique(label, return_inverse=True)[1]


def _runs(patch: NDArray[np.float32]) -> Runs:
    """The different runs of a patch, each as its hash, sorted."""
    levels = np.rint(patch * FULL_SCALE_DN).astype(np.uint8)
    low = high = levels
    packed = levels.astype(np.uint64)
    for step in (1, 2, 4):  # runs of 2, 4 and `RUN_PX`
        low, high = np.minimum(low[:, :-step], low[:, step:]), np.maximum(high[:, :-step], high[:, step:])
        packed = packed[:, :-step] | packed[:, step:] << np.uint64(8 * step)
    numbers = np.sort(packed[high - low >= LEAST_RANGE_DN] * _MULTIPLIER)
    return numbers[np.append(True, numbers[1:] != numbers[:-1])[: len(numbers)]]


def _candidates(runs: list[Runs]) -> Iterator[NDArray[np.int_]]:
    """For each patch, those whose sketch has enough runs in common with it."""
    sizes = np.array([min(len(numbers), SKETCH_RUNS) for numbers in runs])
    if not sizes.any():
        return
    entries = np.concatenate([numbers[:SKETCH_RUNS] for numbers in runs])
    order = np.argsort(entries, kind="stable")
    owner = np.repeat(np.arange(len(runs)), sizes)[order]
    keys, first, owners = np.unique(entries[order], return_index=True, return_counts=True)
    # most runs are in no sketch, which a table of the leading bits shows faster than a search
    shift = np.uint64(64 - _FILTER_BITS)
    present = np.zeros(1 << _FILTER_BITS, bool)
    present[keys >> shift] = True
    for patch, numbers in enumerate(runs):
        likely = numbers[present[numbers >> shift]]
        key = np.searchsorted(keys, likely).clip(max=len(keys) - 1)
        key = key[keys[key] == likely]
        start, count = first[key], owners[key]
        entry = np.arange(count.sum()) + np.repeat(start - np.cumsum(count) + count, count)
        shared = np.bincount(owner[entry], minlength=len(runs))
        shared[patch] = 0
        yield np.flatnonzero(shared > CANDIDATE_SHARE * sizes)


def _overlap(runs: Runs, others: Runs) -> bool:
    """Whether enough runs of the shorter list are in the longer one."""
    both = np.sort(np.concatenate([runs, others]))
    fewer = min(len(runs), len(others))
    return fewer > 0 and bool(np.count_nonzero(both[1:] == both[:-1]) / fewer >= LEAST_SHARE)
