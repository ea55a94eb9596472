"""Training the fusion gate: what it minimises, how its interval is measured, and its weight file.

The mean absolute error of the MTF over all rows (`pipeline.blur.fusion.rows`), and beside it the likelihood of a
Laplace distribution, which trains the scale only. All rows at once, a fixed number of AdamW steps, the rate falling to
zero. Cross-validation over samples, each of which has a picture and a kernel of its own, gives the errors reported and
the factor on the scale that holds 95 % of them; the released gate is trained on all samples.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pipeline.blur.fusion.rows import Rows
from pipeline.blur.settings import FusionTraining
from pipeline.dependencies.closure import fingerprint

if TYPE_CHECKING:
    import torch

    from pipeline.blur.fusion.gate import FusionGate

SCALE_WEIGHT = 0.02  # of the scale's likelihood beside the error
COVERAGE = 0.95
LOW_NOISE_DN = 6.0


@dataclass(frozen=True)
class TrainedGate:
    """What a training gives.

    Attributes:
        gate: trained on all rows.
        interval: factor on its Laplace scale for a 95 % interval.
        measures: errors in percent by cross-validation, and the number of rows.
    """

    gate: FusionGate
    interval: float
    measures: dict[str, float]


def train(data: Rows, settings: FusionTraining) -> TrainedGate:
    """Train the gate, after measuring it by cross-validation.

    Args:
        data: rows of all samples.
        settings: see there.
    """
    import torch

    from pipeline.executor import one_thread

    one_thread()
    error, scale = np.empty_like(data.mtf), np.empty_like(data.mtf)
    for fold in range(settings.folds):
        held_out = np.arange(len(error)) % settings.folds == fold
        gate = _fit(data.part(~held_out), settings, f"fold {fold}")
        with torch.inference_mode():
            mtf, wide = gate(*_tensors(data.part(held_out)))
        error[held_out], scale[held_out] = np.abs(mtf.numpy() - data.mtf[held_out]), wide.numpy()
    interval = float(np.quantile(error / scale, COVERAGE))
    return TrainedGate(_fit(data, settings, "all"), interval, {**_measures(data, error), "interval": interval})


def _tensors(data: Rows) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """The gate's arguments."""
    import torch

    return torch.from_numpy(data.members), torch.from_numpy(data.scale), torch.from_numpy(data.sigma_read_dn)


def _fit(data: Rows, settings: FusionTraining, name: str) -> FusionGate:
    """A gate trained on all of the rows."""
    import torch

    from pipeline.blur.fusion.gate import FusionGate
    from pipeline.learning.descent import descend
    from pipeline.learning.initial import initialise

    gate = FusionGate()
    initialise(gate, settings.recipe.seed, f"fusion gate {name}")
    gate.begin()
    arguments, truth = _tensors(data), torch.from_numpy(data.mtf)

    def loss() -> torch.Tensor:
        logits, scale = gate.every(*arguments)
        error = (torch.sigmoid(logits) - truth).abs()
        likelihood = error.detach() / scale + scale.log()
        return (error + SCALE_WEIGHT * likelihood).mean((1, 2, 3)).sum()  # over the networks, which learn apart

    descend(
        gate.parameters(), loss,
        steps=settings.steps, learning_rate=settings.learning_rate, weight_decay=settings.weight_decay,
    )  # fmt: skip
    return gate.eval()


def _measures(data: Rows, error: np.ndarray) -> dict[str, float]:
    """Mean absolute errors of the gate and its members by noise, percent."""
    errors = {"fused": error} | {
        name: np.abs(data.members[:, index] - data.mtf) for index, name in enumerate(("spectral", "gbb", "pmp"))
    }
    subsets = {
        "": np.ones(len(error), bool),
        "_clean": data.sigma_dn == 0,
        "_low_noise": (data.sigma_dn > 0) & (data.sigma_dn <= LOW_NOISE_DN),
        "_high_noise": data.sigma_dn > LOW_NOISE_DN,
    }
    result = {
        f"{name}_error{subset}_percent": 100 * float(values[kept].mean())
        for name, values in errors.items()
        for subset, kept in subsets.items()
        if kept.any()
    }
    return {**result, "rows": float(len(error))}


def save(path: Path, trained: TrainedGate, settings: FusionTraining, *, released: bool = False) -> None:
    """Write the weight file: weights, settings, fingerprint, measures and the interval's factor."""
    from pipeline.blur.fusion.gate import ARCHITECTURE
    from pipeline.learning import weights

    weights.save(
        path,
        trained.gate.state_dict(),
        ARCHITECTURE,
        settings=asdict(settings),
        fingerprint=fingerprint(__name__, asdict(settings)),
        released=released,
        measures=trained.measures,
        interval=trained.interval,
    )
