"""The network for correlated noise: statistics of a patch to total noise, white noise, correlation and a noise curve.

Several small perceptrons (128-128-64) see the same standardised statistics (`correlated_features`); their answers are
averaged. Every second one is trained without the samples that say how common pictures without noise and behind a codec
alone are; where the answer hangs on that, members disagree and the interval widens.

The total is predicted relative to one statistic that is already near it:

    ln(sigma + 0.3) = ln(r + 0.3) + c,      r: deviation of the second-least eigenvalue, spacing 2, flattest 60 %

with a Laplace scale of ln(1 + sigma). The noise curve gives the noise at five grey levels relative to the patch's, for
maps: behind a tone curve noise peaks at middle grey.
"""

from __future__ import annotations

from collections.abc import Mapping

import torch
import torch.nn.functional as functional
from torch import nn

from pipeline.learning.elementwise import logarithm, square_root
from pipeline.noise.networks.correlated_features import COUNT, REFERENCE

ARCHITECTURE = "sigma-correlated-2"
HIDDEN = (128, 128, 64)
CURVE_LEVELS_DN = (24.0, 76.0, 128.0, 180.0, 232.0)
OFFSET_DN = 0.3
LIMIT = 4.0  # standard deviations that standardised statistics are limited to
SCALE_FLOOR = 0.01
SCALE_START = -1.5
WHITE_START = 1.0

Answer = tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor]


class CorrelatedNet(nn.Module):
    """See the module.

    Args:
        members: perceptrons that are averaged.
    """

    def __init__(self, members: int = 4) -> None:
        super().__init__()
        self.mean: torch.Tensor
        self.deviation: torch.Tensor
        self.register_buffer("mean", torch.zeros(COUNT))
        self.register_buffer("deviation", torch.ones(COUNT))
        self.members = nn.ModuleList(_perceptron() for _ in range(members))

    def standardise(self, statistics: torch.Tensor) -> None:
        """Set the standardisation from training statistics (N, COUNT)."""
        self.mean.copy_(statistics.mean(0))
        self.deviation.copy_(statistics.std(0) + 0.05)

    def answers(self, statistics: torch.Tensor) -> Answer:
        """What each member answers.

        Args:
            statistics: (N, COUNT).

        Returns:
            sigma_dn, Laplace scale of ln(1 + sigma), white fraction of sigma, correlation: (M, N) each; ln of the noise
            curve: (M, N, 5).
        """
        seen = ((statistics - self.mean) / self.deviation).clamp(-LIMIT, LIMIT)
        out = torch.stack([member(seen) for member in self.members])
        reference = logarithm(statistics[:, REFERENCE].exp() + OFFSET_DN)
        sigma = (reference + out[..., 0]).exp() - OFFSET_DN
        scale = functional.softplus(out[..., 1] + SCALE_START) + SCALE_FLOOR
        return sigma, scale, torch.sigmoid(out[..., 2] + WHITE_START), torch.tanh(out[..., 3]), out[..., 4:]

    def forward(self, statistics: torch.Tensor) -> Answer:
        """The members' mean answer, sigma >= 0; the scale includes their disagreement; shapes without M."""
        sigma, scale, white, correlation, curve = self.answers(statistics)
        level = torch.log1p(sigma.clamp_min(0))
        spread = level.std(0, unbiased=False) if len(level) > 1 else torch.zeros_like(level[0])
        return torch.expm1(level.mean(0)), scale.mean(0) + spread, white.mean(0), correlation.mean(0), curve.mean(0)


def _perceptron() -> nn.Sequential:
    layers: list[nn.Module] = []
    width = COUNT
    for hidden in HIDDEN:
        layers += [nn.Linear(width, hidden), nn.SiLU()]
        width = hidden
    return nn.Sequential(*layers, nn.Linear(width, 4 + len(CURVE_LEVELS_DN)))


def cell_map(sigma: torch.Tensor, curve: torch.Tensor, brightness_dn: torch.Tensor) -> torch.Tensor:
    """Noise of cells by their brightness.

    Args:
        sigma: (N,) DN.
        curve: (N, 5) ln of the relative noise at `CURVE_LEVELS_DN`.
        brightness_dn: (N, h, w) mean grey level of the cells.

    Returns:
        (N, h, w) DN whose root mean square is sigma.
    """
    first, last, count = CURVE_LEVELS_DN[0], CURVE_LEVELS_DN[-1], len(CURVE_LEVELS_DN)
    position = ((brightness_dn - first) / (last - first) * (count - 1)).clamp(0, count - 1)
    below = position.floor().clamp(max=count - 2)
    flat, index = position.flatten(1) - below.flatten(1), below.flatten(1).long()
    lower, upper = curve.gather(1, index), curve.gather(1, index + 1)
    relative = torch.lerp(lower, upper, flat).exp()
    level = sigma[:, None] / square_root(relative.square().mean(1, keepdim=True))
    return (relative * level).view_as(brightness_dn)


def loss(net: CorrelatedNet, batch: Mapping[str, torch.Tensor]) -> tuple[torch.Tensor, dict[str, float]]:
    """Sum over members of relative errors and likelihoods.

    Args:
        net: the network.
        batch: ``statistics`` (N, COUNT), ``sigma_dn``, ``white_sigma_dn``, ``correlation`` (N,), ``map_dn`` and
            ``brightness_dn`` (N, 16, 16); ``for_all`` (N,) 1 for samples that train every member, 0 for those that
            train every second one.
    """
    sigma, scale, white, correlation, curve = net.answers(batch["statistics"].float())
    truth = batch["sigma_dn"]
    error = 3 * (sigma - truth).abs() / (truth + 1.5)
    miss = (torch.log1p(sigma.detach().clamp_min(0)) - torch.log1p(truth)).abs()
    likelihood = miss / scale + scale.log()
    noisy = (truth > 0.4).float()
    white_error = (white * truth - batch["white_sigma_dn"]).abs() / (truth + 1.5)
    correlation_error = (correlation - batch["correlation"]).abs() * noisy
    weight = batch["for_all"].expand_as(sigma).clone()
    weight[::2] = 1
    weight = weight / weight.sum(1, keepdim=True).clamp_min(1)
    value = ((error + 0.1 * likelihood + 1.5 * white_error + 0.5 * correlation_error) * weight).sum()
    brightness, cells = batch["brightness_dn"].float(), batch["map_dn"].float()
    for member in curve:
        drawn = cell_map(truth, member, brightness)
        value = value + 0.3 * (((drawn - cells).abs() / (cells + 1.5)).mean((1, 2)) * noisy).mean()
    measured = net(batch["statistics"].float())[0].detach()
    return value, {"sigma_error_dn": float((measured - truth).abs().mean())}
