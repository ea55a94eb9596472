"""Experimental conditions: a blur kernel, a noise source and its target sigma, and the grids of them that a run covers.

A condition names how a sharp frame is corrupted. By default the camera model does it (`pipeline.camera`): the kernel
blurs, and noise of the source is scaled to the target. Another kind of corruption, with a ground truth of its own, is
carried in `Condition.corruption`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np

from pipeline.camera.psf.kernel import Kernel
from pipeline.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pipeline.datasets.frame import Frame
    from pipeline.datasets.patches import Patch

Quantity = Literal["mtf", "sigma_dn"]
QUANTITIES: tuple[Quantity, ...] = ("mtf", "sigma_dn")
SHARP = "sharp"
"""Name of the kernel that leaves a frame as it is."""


class CorruptedImage(Protocol):
    """A corrupted frame and its ground truth, whoever corrupted it.

    Attributes:
        image: (H, W) float32 in [0, 1], the frame as the camera delivers it.
        true_mtf: (2, 8) MTF of the blur, horizontal and vertical; NaN where it is unknown.
    """

    @property
    def image(self) -> NDArray[np.float32]: ...

    @property
    def true_mtf(self) -> NDArray[np.float64]: ...

    def clipped_sigma_dn(self, patches: Sequence[Patch]) -> NDArray[np.float64]:
        """(N,) standard deviation of the noise present in each patch, DN; NaN where it is unknown."""
        ...

    def unclipped_sigma_dn(self, patches: Sequence[Patch]) -> NDArray[np.float64]:
        """(N,) the same before the 8-bit range clips it, DN; NaN where it is unknown."""
        ...


class Corruption(Protocol):
    """Another kind of corruption than the camera model's, e.g. a camera's processing, or a recorded noisy frame."""

    def __call__(self, sharp: NDArray[np.float32], frame: Frame, condition: Condition, seed: int) -> CorruptedImage:
        """Corrupts one frame.

        Args:
            sharp: (H, W) float32 in [0, 1], the frame's image.
            frame: names the random stream.
            condition: the kernel, noise source and target sigma asked for.
            seed: root of the random streams.
        """
        ...


def sharp_kernel(blur_kind: str = SHARP) -> Kernel:
    """The kernel that leaves a frame as it is.

    Args:
        blur_kind: that its rows are filed under.
    """
    return Kernel(SHARP, blur_kind, 0.0, 0.0, np.ones((1, 1), np.float32))


@dataclass(frozen=True)
class Condition:
    """How frames are corrupted, and what is measured on them.

    Attributes:
        kernel: blur; `sharp_kernel` for none.
        noise_source: of the noise (`pipeline.camera.effects.PRESETS`); empty for none.
        target_sigma_dn: standard deviation of the noise over the frame before clipping, DN; 0 adds none.
        experiment: name of the group of conditions this one belongs to, where a run has several; empty for the
            reference that estimators are calibrated by.
        quantities: measured under this condition.
        corruption: replaces the camera model.
    """

    kernel: Kernel = field(default_factory=sharp_kernel)
    noise_source: str = ""
    target_sigma_dn: float = 0.0
    experiment: str = ""
    quantities: frozenset[Quantity] = frozenset(QUANTITIES)
    corruption: Corruption | None = None

    @property
    def blurred(self) -> bool:
        """Whether the kernel does anything."""
        return self.kernel.name != SHARP

    @property
    def noisy(self) -> bool:
        """Whether noise is added."""
        return self.target_sigma_dn > 0

    @property
    def is_reference(self) -> bool:
        """Whether this is the sharp frame without noise that estimators are calibrated by."""
        return not (self.blurred or self.noisy or self.experiment or self.corruption)


@dataclass(frozen=True)
class Subset:
    """The conditions that one estimator is run on; None does not restrict. The reference always belongs to it."""

    sizes_px: Sequence[float] | None = None
    angles_deg: Sequence[float] | None = None
    target_sigmas_dn: Sequence[float] | None = None
    experiments: Sequence[str] | None = None

    def holds(self, condition: Condition) -> bool:
        """Whether a condition belongs to it; rotations count for motion only."""
        if condition.is_reference:
            return True
        kernel = condition.kernel
        limits: list[tuple[Sequence[Any] | None, Any]] = [
            (self.sizes_px, kernel.size_px),
            (self.target_sigmas_dn, condition.target_sigma_dn),
            (self.experiments, condition.experiment),
        ]
        if kernel.kind != "defocus":
            limits.append((self.angles_deg, kernel.angle_deg))
        return all(allowed is None or value in allowed for allowed, value in limits)


def grid(
    kernels: Iterable[Kernel], noise_sources: Sequence[str] = ("",), target_sigmas_dn: Sequence[float] = (0.0,)
) -> list[Condition]:
    """Every kernel with every noise source at every target sigma, in this order.

    Args:
        kernels: blurs, `sharp_kernel` among them where frames without blur are wanted.
        noise_sources: of the noise.
        target_sigmas_dn: standard deviations asked for, DN.
    """
    return [
        Condition(kernel, source, float(target))
        for kernel in kernels
        for source in noise_sources
        for target in target_sigmas_dn
    ]


def sweep_kernels(
    kind: str, sizes_px: Sequence[float], angles_deg: Sequence[float], match: str, seed: int
) -> list[Kernel]:
    """The kernels of a detection sweep, no blur at all first.

    Args:
        kind: of blur, as in `pipeline.camera.psf`.
        sizes_px: sizes; 0 stands for no blur, which is always among them.
        angles_deg: rotations.
        match: see `pipeline.camera.psf.bank.bank`.
        seed: root seed, for random kinds.
    """
    from pipeline.camera.psf.bank import bank

    return [sharp_kernel(), *bank([kind], [size for size in sizes_px if size > 0], angles_deg, seed, match=match)]


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
        sizes = sorted({float(kernel.size_px) for kernel in bank if kernel.kind == kind})
        missing = [size for size in sizes_px if size not in sizes]
        if missing:
            raise InputError(
                f"{key}: the kernel bank has no {kind} of {missing[0]:g} px, only {[f'{size:g}' for size in sizes]}; "
                "add it to psf.kinds and psf.sizes_px, or leave it out here"
            )
    return [kernel for kernel in bank if kernel.kind in set(kinds) and kernel.size_px in sizes_px]


def first_rotations(kernels: Iterable[Kernel]) -> list[Kernel]:
    """Of each kind and size the kernel of the smallest rotation, in the order given; no sharp one."""
    kernels = [kernel for kernel in kernels if kernel.name != SHARP]
    first: dict[tuple[str, float], Kernel] = {}
    for kernel in sorted(kernels, key=lambda kernel: kernel.angle_deg):
        first.setdefault((kernel.kind, kernel.size_px), kernel)
    return [kernel for kernel in kernels if first[kernel.kind, kernel.size_px] is kernel]


def nearest_rotation(kernels: Iterable[Kernel], kind: str, size_px: float, angle_deg: float = 45.0) -> Kernel | None:
    """The kernel of a kind and size whose rotation is nearest to the one wanted, of two the smaller; None without."""
    held = [kernel for kernel in kernels if kernel.kind == kind and kernel.size_px == size_px]
    return min(held, key=lambda kernel: (abs(kernel.angle_deg - angle_deg), kernel.angle_deg)) if held else None
