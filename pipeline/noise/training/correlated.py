"""Training the network for correlated noise: samples through random cameras, and simpler ones beside them.

Chunks take turns by kind (`KINDS`):

    camera       shots of random cameras (`camera_samples`)
    recorded     likewise, but of cameras that add white noise and a codec only
    noise-free   pictures that look like the mean of many shots (`noise_free_samples`)
    white        white sensor noise on clean views (`samples`, without its noise that a blur has smoothed, which it
                 labels as none)

Every second member of the network learns from camera samples and white noise only (`networks.correlated_net`).
Statistics are made where samples are made, so that a step costs a few milliseconds and each sample can serve often.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pipeline.learning import fitting
from pipeline.learning.picture_maker import PictureMaker
from pipeline.learning.run_options import RunOptions
from pipeline.learning.trainer import Trained
from pipeline.noise.networks.correlated_features import CELL_PX
from pipeline.noise.settings import CorrelatedTraining, Recipe
from pipeline.noise.training import camera_samples, noise_free_samples, samples

if TYPE_CHECKING:
    import torch

COVERAGE = 0.95
CAMERA, RECORDED, NOISE_FREE, WHITE = "camera noise", "recorded noise", "noise-free pictures", "white noise"
KINDS = (CAMERA, CAMERA, RECORDED, CAMERA, NOISE_FREE, CAMERA, WHITE, CAMERA)
STANDARDISING_ROUNDS = 2  # of all kinds, whose statistics set the standardisation
NOISE_FREE_DN = 0.3  # validation reports what is read from samples with less noise
CODE = __name__


class Maker(PictureMaker[CorrelatedTraining]):
    """Makes chunks of samples; chunk i is of the kind ``KINDS[i % 8]`` and numbered within it."""

    def __call__(self, number: int) -> dict[str, np.ndarray]:
        """Chunk `number`: see `correlated_net.loss` for the arrays."""
        round_, turn = divmod(number, len(KINDS))
        kind = KINDS[turn]
        index = round_ * KINDS.count(kind) + KINDS[:turn].count(kind)
        return arrays(kind, self.tiles, self.settings, self.part, index)


def arrays(kind: str, tiles: np.ndarray, settings: CorrelatedTraining, part: str, index: int) -> dict[str, np.ndarray]:
    """A chunk of one kind as arrays.

    Args:
        kind: one of `KINDS`.
        tiles: (M, T, T) bank of pictures.
        settings: of the training.
        part: ``"training"`` or ``"validation"``.
        index: number of the chunk within its kind.
    """
    draw = tiles, settings.seed, f"{part} {kind}", index
    if kind == WHITE:
        return _white(*draw, noise_free_fraction=settings.white_noise_free_fraction)
    if kind == NOISE_FREE:
        made = noise_free_samples.chunk(draw[0], settings.noise_free, *draw[1:])
    else:
        recipe = settings.recipe if kind == CAMERA else settings.recorded
        made = camera_samples.chunk(draw[0], recipe, *draw[1:])
    return {
        **_seen(made.patches_dn),
        "for_all": np.full(len(made.sigma_dn), kind == CAMERA, np.float32),
        "sigma_dn": made.sigma_dn,
        "white_sigma_dn": made.white_sigma_dn,
        "correlation": made.correlation,
        "map_dn": made.map_dn.astype(np.float16),
    }


def _white(
    tiles: np.ndarray, seed: int, purpose: str, index: int, *, noise_free_fraction: float
) -> dict[str, np.ndarray]:
    recipe = replace(Recipe(), blurred_noise_fraction=0.0, clean_fraction=noise_free_fraction)
    made = samples.chunk(tiles, recipe, seed, purpose, index)
    return {
        **_seen(made.patches_dn),
        "for_all": np.ones(len(made.sigma_dn), np.float32),
        "sigma_dn": made.sigma_dn,
        "white_sigma_dn": made.sigma_dn,
        "correlation": np.zeros_like(made.sigma_dn),
        "map_dn": made.map_dn.astype(np.float16),
    }


def _seen(patches_dn: np.ndarray) -> dict[str, np.ndarray]:
    """What the network sees of patches (N, 128, 128): statistics, and the brightness of the cells."""
    from pipeline.noise.networks.correlated_features import statistics

    side = patches_dn.shape[1] // CELL_PX
    cells = patches_dn.reshape(-1, side, CELL_PX, side, CELL_PX).mean(axis=(2, 4), dtype=np.float32)
    return {
        "statistics": np.stack([statistics(patch.astype(np.float32)) for patch in patches_dn]),
        "brightness_dn": cells.astype(np.float16),
    }


def measures(data: Mapping[str, torch.Tensor]) -> Callable[[torch.nn.Module], dict[str, float]]:
    """Measures on held-out samples.

    ``score_dn``, which selects weights, is the mean of |s - s'| / (1 + s' / 10); ``interval`` is the factor k for which
    t +- k b holds ln(1 + sigma) in 95 % of the patches with noise.
    """
    import torch

    truth, correlated = data["sigma_dn"], data["correlation"] > 0.25

    def measure(model: torch.nn.Module) -> dict[str, float]:
        with torch.no_grad():
            sigma, scale, white, correlation, _ = model(data["statistics"])
        error = (sigma - truth).abs()
        miss = (torch.log1p(sigma) - torch.log1p(truth)).abs() / scale
        noisy = truth > NOISE_FREE_DN
        return {
            "score_dn": float((error / (1 + truth / 10)).mean()),
            "sigma_error_dn": float(error.mean()),
            "sigma_error_correlated_dn": float(error[correlated & noisy].mean()),
            "sigma_error_white_dn": float(error[~correlated & noisy].mean()),
            "noise_free_sigma_dn": float(sigma[~noisy].mean()),
            "white_sigma_error_dn": float((white * sigma - data["white_sigma_dn"]).abs().mean()),
            "correlation_error": float((correlation - data["correlation"])[noisy].abs().mean()),
            "interval": float(torch.quantile(miss[noisy], COVERAGE)),
        }

    return measure


def train(settings: CorrelatedTraining, run_options: RunOptions) -> Trained:
    """Train the network, or go on training it.

    Args:
        settings: all that the result depends on.
        run_options: how it runs.

    Returns:
        the network that validated best, and its learning curve.
    """
    import torch

    from pipeline.learning.initial import initialise
    from pipeline.noise.networks.correlated_net import CorrelatedNet, loss

    for held_out in (False, True):
        Maker(settings, run_options.cache, held_out).bank(run_options.executor)
    make = Maker(settings, run_options.cache)
    model = CorrelatedNet(settings.members)
    initialise(model, settings.seed, "correlated noise network")
    first = [torch.from_numpy(make(number)["statistics"]) for number in range(STANDARDISING_ROUNDS * len(KINDS))]
    model.standardise(torch.cat(first))
    unseen = Maker(settings, run_options.cache, validation=True)
    held = fitting.held_out(unseen, settings.validation_chunks, run_options.device)
    return fitting.fit(
        model,
        loss,  # type: ignore[arg-type]
        make,
        settings,
        run_options,
        name="sigma-correlated",
        code=CODE,
        validate=measures(held),
        score="score_dn",
    )


def save(path: Path, trained: Trained, settings: CorrelatedTraining, *, released: bool = False) -> None:
    """Write the weight file of a training: weights, settings, measures and the interval's factor."""
    from pipeline.noise.networks.correlated_net import ARCHITECTURE

    values = {name: float(f"{value:.6g}") for name, value in fitting.final_measures(trained).items()}
    fitting.save(
        path,
        trained,
        settings,
        architecture=ARCHITECTURE,
        code=CODE,
        released=released,
        measures=values,
        interval=values["validation_interval"],
        members=settings.members,
    )
