"""What networks of the MTF and of noise minimise, whatever they see of a patch, and how they are validated.

With MTF m of Laplace scale b and noise sigma of scale s (`pipeline.blur.networks.spectral_net.laplace_loss`),

    loss = mean(|M - m| / b + log b) + 0.05 mean(|sigma_true - sigma| / s + log s).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.learning.settings import Training
from pipeline.learning.trainer import Trained

if TYPE_CHECKING:
    import torch

    from pipeline.blur.networks.spectral_net import Answer

SIGMA_WEIGHT = 0.05  # of the noise's likelihood beside the MTF's
COVERAGE = 0.95
SCORE = "mtf_error_percent"


def loss(outputs: Answer, truth: Mapping[str, torch.Tensor]) -> tuple[torch.Tensor, dict[str, torch.Tensor]]:
    """The loss of the module, and mean absolute errors.

    Args:
        outputs: MTF and its scale (N, 2, 8), noise and its scale (N,), DN.
        truth: ``mtf`` (N, 2, 8) and ``sigma_dn`` (N,), among others.
    """
    from pipeline.blur.networks.spectral_net import laplace_loss

    mtf, scale, sigma_dn, sigma_scale = outputs
    value = laplace_loss(mtf, scale, truth["mtf"])
    value = value + SIGMA_WEIGHT * laplace_loss(sigma_dn, sigma_scale, truth["sigma_dn"])
    measures = {
        "mtf_error_percent": 100 * (mtf - truth["mtf"]).detach().abs().mean().double(),
        "sigma_error_dn": (sigma_dn - truth["sigma_dn"]).detach().abs().mean(),
    }
    return value, measures


def measures(outputs: Sequence[Answer], truth: Mapping[str, torch.Tensor]) -> dict[str, float]:
    """Mean absolute errors on held-out samples, and how wide intervals must be.

    ``interval`` is the factor k for which m +- k b holds the truth in 95 % of the values.

    Args:
        outputs: of the samples, batch after batch; see `loss`.
        truth: of all samples; see `loss`.
    """
    import torch

    mtf, scale, sigma_dn, _ = (torch.cat(parts) for parts in zip(*outputs, strict=True))
    error = (mtf - truth["mtf"]).abs()
    clean = truth["sigma_dn"] == 0
    return {
        "mtf_error_percent": 100 * float(error.mean()),
        "mtf_error_clean_percent": 100 * float(error[clean].mean()),
        "mtf_error_noisy_percent": 100 * float(error[~clean].mean()),
        "sigma_error_dn": float((sigma_dn - truth["sigma_dn"]).abs().mean()),
        "interval": float(torch.quantile((error / scale).flatten(), COVERAGE)),
    }


def save(path: Path, trained: Trained, training: Training, architecture: str, code: str, *, released: bool) -> None:
    """Write the weight file of a training: weights, settings, measures and the interval's factor.

    Arguments are those of `pipeline.learning.fitting.save`.
    """
    from pipeline.learning import fitting

    interval = fitting.final_measures(trained)["validation_interval"]
    fitting.save(path, trained, training, architecture=architecture, code=code, released=released, interval=interval)
