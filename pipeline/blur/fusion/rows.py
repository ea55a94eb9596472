"""Training rows of the fusion gate: answers of the three estimators for the samples, with the truth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.blur.fusion import samples as fusion_samples
from pipeline.blur.fusion.members import join_members
from pipeline.blur.settings import FusionRecipe
from pipeline.dependencies.closure import fingerprint

RunMap = Callable[..., list[Any]]


@dataclass(frozen=True)
class Rows:
    """What the gate is trained on, one row for each sample.

    Attributes:
        members: (N, 3, 2, 8) MTF by the spectral network, GBB and PMP; the first stands in where another abstains.
        scale: (N, 2, 8) Laplace scale of the first.
        sigma_read_dn: (N,) noise that the spectral network reads, DN.
        mtf: (N, 2, 8) the truth.
        sigma_dn: (N,) noise added, DN.
    """

    members: NDArray[np.float32]
    scale: NDArray[np.float32]
    sigma_read_dn: NDArray[np.float32]
    mtf: NDArray[np.float32]
    sigma_dn: NDArray[np.float32]

    def part(self, kept: NDArray[np.bool_]) -> Rows:
        """The rows where `kept`."""
        return Rows(**{name: value[kept] for name, value in vars(self).items()})


def rows(recipe: FusionRecipe, spectral_weights: Path, cache: Path, run_map: RunMap) -> Rows:
    """All training rows.

    Args:
        recipe: what to draw.
        spectral_weights: weight file of the spectral network.
        cache: folder outside of any stage's outputs; an interrupted run goes on from what it has.
        run_map: (function, items, label) -> results (`pipeline.executor.run_map`); changes no result.
    """
    from pipeline.blur.spectral import Spectral

    folder = cache / f"fusion-{fingerprint(fusion_samples.__name__, asdict(recipe))}"
    deconvolved = partial(fusion_samples.deconvolved, recipe=recipe, folder=folder)
    made = run_map(deconvolved, range(recipe.samples), "fusion samples")
    patch, mtf, sigma_dn, others = (
        np.stack([sample[name] for sample in made]) for name in ("patch", "mtf", "sigma_dn", "others")
    )
    read, scale, sigma_read_dn = Spectral(spectral_weights).predict(patch[:, None].astype(np.float32) / np.float32(255))
    arrays = (join_members(read, others), scale, sigma_read_dn, mtf, sigma_dn)
    return Rows(*(np.asarray(part, np.float32) for part in arrays))
