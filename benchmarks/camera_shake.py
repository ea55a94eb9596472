"""Photographs of real camera shake with measured kernels (Levin et al., CVPR 2009), which no benchmark brings along.

A folder holds ``SCENE_KERNEL.mat``, each with ``x``, the scene from a tripod, ``y``, the same behind camera shake, and
``f``, the measured kernel; ``x`` is that of every file of a scene.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@dataclass(frozen=True)
class Shake:
    """One photograph.

    Attributes:
        scene, kernel: their names.
        sharp, blurred: (H, W) from a tripod and behind camera shake, [0, 1].
        psf: (h, w) measured kernel.
    """

    scene: str
    kernel: str
    sharp: NDArray[np.float64]
    blurred: NDArray[np.float64]
    psf: NDArray[np.float64]


def files(folder: Path) -> list[Path]:
    """Those of a folder, by name."""
    return sorted(folder.glob("*_*.mat"))


def photographs(folder: Path) -> Iterator[Shake]:
    """The photographs of a folder, by name."""
    from scipy.io import loadmat

    for path in files(folder):
        scene, _, kernel = path.stem.partition("_")
        content = loadmat(path)
        yield Shake(scene, kernel, content["x"], content["y"], content["f"])
