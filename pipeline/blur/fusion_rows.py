"""Training rows of the fusion gate: answers of the three estimators for the samples, with the truth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.blur import fusion_samples
from pipeline.blur.fusion_members import join_members
from pipeline.blur.fusion_samples import Recipe
from pipeline.dependencies.closure import fingerprint

RunMap = Callable[..., list[Any]]


@dataclass(frozen=True)
class Rows:
    """What the gate is trained on: one row for each patch and each set of patches that it was deconvolved in.

    Attributes:
        members: (N, 3, 2, 8) MTF by the spectral network, GBB and PMP; the first stands in where another abstains.
        scale: (N, 2, 8) Laplace scale of the first.
        sigma_read_dn: (N,) noise that the spectral network reads, DN.
        count: (N,) patches that GBB and PMP were run on together.
        mtf: (N, 2, 8) the truth.
        sigma_dn: (N,) noise added, DN.
        sample: (N,) number of the sample.
    """

    members: NDArray[np.float32]
    scale: NDArray[np.float32]
    sigma_read_dn: NDArray[np.float32]
    count: NDArray[np.float32]
    mtf: NDArray[np.float32]
    sigma_dn: NDArray[np.float32]
    sample: NDArray[np.int_]

    def part(self, kept: NDArray[np.bool_]) -> Rows:
        """The rows where `kept`."""
        return Rows(**{name: value[kept] for name, value in vars(self).items()})


def rows(recipe: Recipe, spectral_weights: Path, cache: Path, run_map: RunMap) -> Rows:
    """All training rows.

    Args:
        recipe: what to draw.
        spectral_weights: weight file of the spectral network.
        cache: folder outside of any stage's outputs; an interrupted run goes on from what it has.
        run_map: (function, items, label) -> results (`pipeline.executor.run_map`); changes no result.
    """
    from pipeline.blur.spectral import Spectral

    folder = cache / f"fusion-{fingerprint(fusion_samples.__name__, asdict(recipe))}"
    made = run_map(
        partial(fusion_samples.deconvolved, recipe=recipe, folder=folder), range(recipe.samples), "fusion samples"
    )
    spectral, parts = Spectral(spectral_weights), []
    for index, sample in enumerate(made):
        mtf, scale, sigma_read = spectral.predict(sample["patches"][:, None].astype(np.float32) / 255)
        for others, views in zip(sample["others"], [*range(recipe.singles), slice(None)], strict=True):
            chosen = np.atleast_1d(np.arange(recipe.views)[views])
            count = len(chosen)
            parts.append(
                Rows(
                    join_members(mtf[chosen], others).astype(np.float32),
                    scale[chosen],
                    sigma_read[chosen],
                    np.full(count, count, np.float32),
                    np.repeat(sample["mtf"][None], count, axis=0).astype(np.float32),
                    np.full(count, sample["sigma_dn"], np.float32),
                    np.full(count, index),
                )
            )
    return Rows(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in vars(parts[0])})
