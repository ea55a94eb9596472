"""Fits to a camera for an honest evaluation: each half of the frames is judged with a fit to the other half."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.blur.camera_fit import CameraMap, fit
from pipeline.errors import InputError

if TYPE_CHECKING:
    from pipeline.datasets.frame import Frame
    from pipeline.datasets.patches import Patch

    Work = tuple[Frame, Sequence[Patch]]


def halves(count: int) -> list[int]:
    """Which half each of a dataset's frames, in order, is judged in: 0 for the first, 1 for the others.

    Halves are not mixed, for frames that follow each other may show the same place.

    Args:
        count: of frames.

    Raises:
        InputError: fewer than two frames.
    """
    if count < 2:
        raise InputError(
            f"{count} frame to fit a camera on and be judged by; give at least two, or leave camera_samples out"
        )
    return [int(2 * number >= count) for number in range(count)]


def fits(
    work: Sequence[Work],
    kind: str,
    options: Mapping[str, Any],
    *,
    samples: int,
    seed: int,
    run_map: Callable[..., list[Any]] | None = None,
) -> list[CameraMap]:
    """The fit that each half of the frames is judged with, which is to the other half.

    Args:
        work: sharp frames with their patches.
        kind: of the estimator (`pipeline.blur.create`).
        options: its options.
        samples: see `pipeline.blur.camera_fit.fit`.
        seed: see there.
        run_map: (function, items, label) -> results; None calls one after the other.

    Raises:
        InputError: fewer than two frames, or see `pipeline.blur.camera_fit.fit`.
    """
    sides = halves(len(work))
    others = [[one for one, side in zip(work, sides, strict=True) if side != own] for own in (0, 1)]
    make = partial(fit_frames, kind=kind, options=dict(options), samples=samples, seed=seed)
    return [make(other) for other in others] if run_map is None else run_map(make, others, "fit to the camera")


def fit_frames(work: Sequence[Work], *, kind: str, options: dict[str, Any], samples: int, seed: int) -> CameraMap:
    """Fit an estimator to the patches of sharp frames; see `pipeline.blur.camera_fit.fit`."""
    from pipeline import blur
    from pipeline.datasets.patches import cut

    sharp = np.concatenate([cut(np.asarray(frame.image()), patches) for frame, patches in work])
    return fit(blur.create(kind, **options), sharp, samples=samples, seed=seed)
