"""The fusion gate: joins the MTFs of the spectral network, GBB and PMP by weights that depend on all three.

    logit M = sum over e of w_e logit M_e + c,      e in {spectral, GBB, PMP},   sum w_e = 1

for each direction and frequency; one small network, shared by all of them, computes the weights (a softmax), the offset
c and a factor on the spectral network's Laplace scale. It sees the logits of the three with their neighbours in
frequency and the other direction, how far GBB and PMP are from the spectral network, its scale, the blur's strength,
the frequency and the noise. Errors of the three are nearly independent, so what they agree on is likely right.

Several networks that differ in their initial weights are averaged. Ours.
"""

from __future__ import annotations

import torch
import torch.nn.functional as functional
from torch import nn

from pipeline.blur.calibration.affine_logits import NEAREST
from pipeline.camera.mtf import FREQUENCIES

ARCHITECTURE = "mtf-fusion-1"
MEMBERS = ("spectral", "gbb", "pmp")
HIDDEN = 12
NETWORKS = 3
INPUTS = 23
INPUT_SCALE = 0.5
OFFSET_SCALE = 0.5
SPECTRAL_START = 1.0  # initial bias of its weight: the softmax begins with it in front
SMALLEST_SCALE = 0.002
SIGMA_KNEE_DN = 2.0


def logit(mtf: torch.Tensor) -> torch.Tensor:
    """log(m / (1 - m)), away from 0 and 1."""
    inside = mtf.clamp(NEAREST, 1 - NEAREST)
    return torch.log(inside / (1 - inside))


def _neighbours(values: torch.Tensor) -> torch.Tensor:
    """(N, 2, 8) -> (N, 2, 8, 4): the value, those at the next lower and higher frequency, the other direction's."""
    lower = torch.cat([values[..., :1], values[..., :-1]], dim=-1)
    higher = torch.cat([values[..., 1:], values[..., -1:]], dim=-1)
    return torch.stack([values, lower, higher, values.flip(1)], dim=-1)


def inputs(members: torch.Tensor, scale: torch.Tensor, sigma_dn: torch.Tensor) -> torch.Tensor:
    """What the gate sees of every value.

    Args:
        members: (N, 3, 2, 8) MTF by spectral network, GBB and PMP.
        scale: (N, 2, 8) Laplace scale of the first.
        sigma_dn: (N,) noise that the spectral network reads, DN.

    Returns:
        (N, 2, 8, `INPUTS`).
    """
    shape = scale.shape
    spectral, *others = logit(members).unbind(1)

    def spread(values: torch.Tensor) -> torch.Tensor:
        return values.reshape(-1, 1, 1, 1).expand(*shape, 1)

    frequency = torch.as_tensor(FREQUENCIES / FREQUENCIES[-1], dtype=scale.dtype).expand(shape)[..., None]
    parts = [
        _neighbours(spectral),
        scale.clamp_min(1e-4).log()[..., None] + 4,
        spread(members[:, 0].mean((1, 2))),
        frequency,
        frequency**2,
        spread((1 + sigma_dn / SIGMA_KNEE_DN).log()),
    ]
    for index, other in enumerate(others):
        difference = (members[:, 1 + index] - members[:, 0]).abs().mean((1, 2))
        parts += [_neighbours(other), (other - spectral).abs()[..., None], spread(10 * difference)]
    parts.append((others[0] - others[1]).abs()[..., None])
    agreement = (members[:, 1] - members[:, 2]).abs().mean((1, 2))
    parts.append(spread(10 * agreement))
    return torch.cat(parts, dim=-1) * INPUT_SCALE


class FusionGate(nn.Module):
    """See the module."""

    def __init__(self) -> None:
        super().__init__()
        self.networks = nn.ModuleList(
            nn.Sequential(nn.Linear(INPUTS, HIDDEN), nn.Tanh(), nn.Linear(HIDDEN, len(MEMBERS) + 2))
            for _ in range(NETWORKS)
        )

    def begin(self) -> None:
        """Set the last layers so that the gate begins as a fixed average with the spectral network in front."""
        with torch.no_grad():
            for network in self.networks:
                last = network[2]  # type: ignore[index]
                last.weight.zero_()
                last.bias.zero_()
                last.bias[0] = SPECTRAL_START

    def every(
        self, members: torch.Tensor, scale: torch.Tensor, sigma_dn: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Answers of each network: logits of the MTF and Laplace scales, both (networks, N, 2, 8)."""
        seen, logits = inputs(members, scale, sigma_dn), logit(members).movedim(1, -1)
        outputs = torch.stack([network(seen) for network in self.networks])
        weights = torch.softmax(outputs[..., : len(MEMBERS)], dim=-1)
        fused = (weights * logits).sum(-1) + OFFSET_SCALE * outputs[..., -2]
        return fused, scale * functional.softplus(outputs[..., -1] + 0.5413) + SMALLEST_SCALE

    def forward(
        self, members: torch.Tensor, scale: torch.Tensor, sigma_dn: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """The fused MTF (N, 2, 8) in (0, 1) and its Laplace scale; arguments as for `inputs`."""
        fused, wide = self.every(members, scale, sigma_dn)
        return torch.sigmoid(fused.mean(0)), wide.mean(0)
