"""What a combined experiment is made of: blur with noise, the part each estimator takes, and when to smooth first."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.camera.psf.kernel import Kernel
from pipeline.errors import InputError

DISC = "disc"
"""Experiment that reads the smoothing discs themselves, without noise."""


@dataclass(frozen=True)
class Experiment:
    """Blur and noise that come together.

    Attributes:
        name: e.g. ``"defocus_dcsn"``.
        kind: of the kernels.
        effect: of the noise (`pipeline.camera.effects.PRESETS`).
    """

    name: str
    kind: str
    effect: str


@dataclass(frozen=True)
class Subset:
    """Which conditions one estimator is run on; None does not restrict."""

    sizes_px: Sequence[float] | None = None
    angles_deg: Sequence[float] | None = None
    levels_dn: Sequence[float] | None = None
    experiments: Sequence[str] | None = None

    def holds(self, experiment: Experiment, kernel: Kernel, level_dn: float) -> bool:
        """Whether a condition belongs to it; rotations count for motion only."""
        asked: list[tuple[Sequence[Any] | None, Any]] = [
            (self.sizes_px, kernel.size_px),
            (self.levels_dn, level_dn),
            (self.experiments, experiment.name),
        ]
        if kernel.kind != "defocus":
            asked.append((self.angles_deg, kernel.angle_deg))
        return all(allowed is None or value in allowed for allowed, value in asked)


@dataclass(frozen=True)
class Smoothing:
    """Denoise, then estimate.

    Attributes:
        filters_px: diameters of the smoothing discs; each gives an answer of its own.
        from_sigma_dn: noise of a patch, as read, from which it is smoothed, DN.
        sigma_dn: (N, 1, H, W) patches -> (N,) noise, DN; None smooths every patch.
    """

    filters_px: tuple[float, ...] = ()
    from_sigma_dn: float = 0.0
    sigma_dn: Callable[[NDArray[np.float32]], NDArray[np.floating]] | None = None

    def noisy(self, patches: NDArray[np.float32]) -> NDArray[np.bool_]:
        """(N,) which patches are to be smoothed; where nothing can be said of the noise, none is."""
        if self.sigma_dn is None:
            return np.ones(len(patches), dtype=np.bool_)
        with np.errstate(invalid="ignore"):
            found: NDArray[np.bool_] = np.asarray(self.sigma_dn(patches)) >= self.from_sigma_dn
        return found


def chosen_kernels(
    kernels: Iterable[Kernel], kinds: Iterable[str], sizes_px: Sequence[float], key: str
) -> list[Kernel]:
    """The kernels of these kinds and sizes, in the bank's order.

    Args:
        kernels: the bank.
        kinds: wanted.
        sizes_px: wanted.
        key: of the configuration, for the message.

    Raises:
        InputError: the bank lacks a kind or size.
    """
    bank = list(kernels)
    for kind in dict.fromkeys(kinds):
        held = sorted({float(kernel.size_px) for kernel in bank if kernel.kind == kind})
        missing = [size for size in sizes_px if size not in held]
        if missing:
            raise InputError(
                f"{key}: the kernel bank has no {kind} of {missing[0]:g} px, only {[f'{size:g}' for size in held]}; "
                "add it to psf.kinds and psf.sizes_px, or leave it out here"
            )
    return [kernel for kernel in bank if kernel.kind in set(kinds) and kernel.size_px in sizes_px]


def spread(items: Sequence[Any], count: int | None) -> list[Any]:
    """At most so many of them, evenly spread; None takes all."""
    if count is None or len(items) <= count:
        return list(items)
    return [items[number * len(items) // count] for number in range(count)]
