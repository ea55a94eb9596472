"""The cell-wise network: statistics of cells to a map of the noise, and from the map to the patch.

    sigma_cell  = (base + 0.5) exp(c)               c: the network's correction, base: Immerkaer's estimate
    sigma_patch = sqrt(sum_cells w sigma_cell^2)    w: its weights, positive, of unit sum
    ln(1 + sigma) is Laplace distributed about ln(1 + sigma_patch) with scale b, which the network gives as well

Each cell sees its neighbours (two 3 x 3 layers) and summaries of the whole patch: attention heads average the cells'
features with weights of their own, so that a wall full of texture can be judged by what a smooth piece of sky shows.
They average the cells' *powers* as well: the spectrum of many cells together is known to a per cent, which is what it
takes to tell a texture's fall from the level floor of noise. About 68 000 parameters; any number of cells.
"""

from __future__ import annotations

import torch
import torch.nn.functional as functional
from torch import nn

from pipeline.noise.cellwise_features import CHANNELS, POWERS, log_power, power

ARCHITECTURE = "sigma-cellwise-1"
WIDTH = 40
HEADS = 4
BASE_OFFSET_DN = 0.5
CORRECTION = (-8.0, 5.0)  # range of c
SMALLEST_SCALE = 0.003
SCALE_START = -3.0  # of softplus: a scale of about 0.05 to begin with


class CellwiseNet(nn.Module):
    """See the module."""

    def __init__(self) -> None:
        super().__init__()
        self.enter = nn.Conv2d(CHANNELS, WIDTH, 1)
        self.near = nn.Conv2d(WIDTH, WIDTH, 3, padding=1)
        self.attention = nn.Conv2d(WIDTH, HEADS, 1)
        self.summary = nn.Sequential(
            nn.Linear((WIDTH + POWERS) * (HEADS + 1), 2 * WIDTH), nn.ReLU(), nn.Linear(2 * WIDTH, WIDTH), nn.ReLU()
        )
        self.context = nn.Linear(WIDTH, WIDTH)
        self.join = nn.Conv2d(WIDTH, WIDTH, 3, padding=1)
        self.mix = nn.Conv2d(WIDTH, WIDTH, 1)
        self.cell = nn.Conv2d(WIDTH, 2, 1)
        self.spread = nn.Linear(3 * WIDTH, 1)

    def forward(
        self, statistics: torch.Tensor, base_dn: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """The answer for the statistics of `cellwise_features.features`.

        Args:
            statistics: (N, CHANNELS, h, w).
            base_dn: (N, h, w).

        Returns:
            sigma_dn: (N,) of the patch; scale: (N,) b > 0; map_dn: (N, h, w) of the cells.
        """
        seen = functional.relu(self.near(functional.relu(self.enter(statistics))))
        cells = seen.flatten(2)
        shares = torch.softmax(self.attention(seen).flatten(2), dim=2)
        shares = torch.cat([shares, torch.full_like(shares[:, :1], 1 / shares.shape[2])], dim=1)
        spectra = log_power(shares @ power(statistics.flatten(2)).mT)
        summary = self.summary(torch.cat([(shares @ cells.mT).flatten(1), spectra.flatten(1)], dim=1))
        joined = functional.relu(self.join(seen) + self.context(summary)[:, :, None, None])
        mixed = functional.relu(self.mix(joined))
        correction, score = self.cell(mixed).unbind(1)
        map_dn = (base_dn + BASE_OFFSET_DN) * torch.exp(correction.clamp(*CORRECTION))
        weights = torch.softmax(score.flatten(1), dim=1)
        sigma_dn = ((weights * map_dn.flatten(1).square()).sum(1) + 1e-8).sqrt()
        far = mixed.flatten(2)
        spread = self.spread(torch.cat([summary, far.mean(2), far.amax(2)], dim=1))[:, 0]
        return sigma_dn, functional.softplus(spread + SCALE_START) + SMALLEST_SCALE, map_dn


def loss(
    sigma_dn: torch.Tensor,
    scale: torch.Tensor,
    map_dn: torch.Tensor,
    truth_dn: torch.Tensor,
    truth_map_dn: torch.Tensor,
) -> torch.Tensor:
    """What training minimises.

        3 |s - s'| / (s' + 2)  +  mean_cells |m - m'| / (m' + 2)  +  0.1 (|t - t'| / b + ln b)

    with t = ln(1 + s). The first two are errors relative above 2 DN and absolute below; the last fits the scale only
    (s is held there), so that an uncertain patch is not allowed to be a wrong one.
    """
    patch = ((sigma_dn - truth_dn).abs() / (truth_dn + 2)).mean()
    cells = ((map_dn - truth_map_dn).abs() / (truth_map_dn + 2)).mean()
    miss = (torch.log1p(sigma_dn.detach()) - torch.log1p(truth_dn)).abs()
    return 3 * patch + cells + 0.1 * (miss / scale + scale.log()).mean()
