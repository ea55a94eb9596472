"""The cell-wise network: statistics of cells to a map of the noise, and from the map to the patch.

    reference^2 = sum_cells w own^2                    own = base + 0.5,   I' = sum_cells w I
    carried^2 = reference^2 ((1 - f) + f I / I') ((I + i) / (I' + i))^-q exp(2 s)
    ln sigma_cell = g ln own + (1 - g) ln carried + c
    sigma_patch^2 = mean_cells sigma_cell^2
    ln(1 + sigma) is Laplace distributed about ln(1 + sigma_patch) with scale b

base is Immerkaer's estimate in a cell; w are attention weights, which find the cells that show the noise best. A
sensor's variance is affine in its signal I: f is the photons' share, with which what smooth dark cells show is carried
over to bright and textured ones. A tone curve is steep in the shadows and flat where it is bright, and so noise behind
it falls with brightness: the power q, 0 of a linear camera, about 2 gamma - 2 where noise before the curve is
constant. The gate g is the weight of a cell's
own estimate; s (of the patch) and c (of the cell) are corrections. All of these, and b, come from the network.

Each cell sees its neighbours (two 3 x 3 layers) and a summary of the whole patch: attention heads average the cells'
features, and their *powers* as well: the spectrum of many cells together is known to a per cent, which is what it takes
to tell a texture's fall from the level floor of noise; two heads show how the noise goes with brightness. About 70 000
parameters; any number of cells.
"""

from __future__ import annotations

import torch
import torch.nn.functional as functional
from torch import nn

from pipeline.learning.elementwise import logarithm, square_root
from pipeline.noise.networks.cellwise_features import CHANNELS, MEAN, POWERS, log_power, power

ARCHITECTURE = "sigma-cellwise-2"
WIDTH = 40
HEADS = 4
BASE_OFFSET_DN = 0.5
LIGHT_FLOOR = 0.005  # of the signal where it is black, as a share of mid grey
CURVE_FLOOR = 0.1  # i: noise itself lifts black, where the slope of a curve has no end
STEEPEST = 2.5  # of q
FLAT_START = -3.0  # of its sigmoid: next to no tone curve to begin with
TRACED = 2  # heads
LEVELS = (0.02, 0.15, 0.4, 0.7, 1.0, 1.3, 1.6, 1.97)  # of brightness, mid grey = 1
LEVEL_REACH = 0.3
TRACE_FLOOR = 1e-4
PATCH_CORRECTION = (-8.0, 5.0)  # range of s
CELL_CORRECTION = (-4.0, 4.0)  # range of c
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
            nn.Linear((WIDTH + POWERS) * (HEADS + 1) + 2 * TRACED * len(LEVELS), 2 * WIDTH),
            nn.ReLU(),
            nn.Linear(2 * WIDTH, WIDTH),
            nn.ReLU(),
        )
        self.context = nn.Linear(WIDTH, WIDTH)
        self.join = nn.Conv2d(WIDTH, WIDTH, 3, padding=1)
        self.mix = nn.Conv2d(WIDTH, WIDTH, 1)
        self.cell = nn.Conv2d(WIDTH, 2, 1)
        self.patch = nn.Linear(WIDTH, 3)
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
        selected = (base_dn + BASE_OFFSET_DN).flatten(1)
        light = statistics[:, MEAN].flatten(1) + 1
        traces = self._traces(shares[:, :TRACED], light, selected)
        first = shares[:, 0]
        shares = torch.cat([shares, torch.full_like(shares[:, :1], 1 / shares.shape[2])], dim=1)
        spectra = log_power(shares @ power(statistics.flatten(2)).mT)
        summary = self.summary(torch.cat([(shares @ cells.mT).flatten(1), spectra.flatten(1), traces], dim=1))
        joined = functional.relu(self.join(seen) + self.context(summary)[:, :, None, None])
        mixed = functional.relu(self.mix(joined))
        level, photons, curve = self.patch(summary).unbind(1)
        fall = STEEPEST * torch.sigmoid(curve + FLAT_START)
        carried = self._carried(first, light, selected, torch.sigmoid(photons), fall)
        carried = logarithm(carried) + level.clamp(*PATCH_CORRECTION)[:, None]
        gate, correction = self.cell(mixed).flatten(2).unbind(1)
        blend = torch.lerp(carried, logarithm(selected), torch.sigmoid(gate)) + correction.clamp(*CELL_CORRECTION)
        map_dn = blend.exp().view_as(base_dn)
        sigma_dn = square_root(map_dn.square().mean((1, 2)) + 1e-8)
        far = mixed.flatten(2)
        spread = self.spread(torch.cat([summary, far.mean(2), far.amax(2)], dim=1))[:, 0]
        return sigma_dn, functional.softplus(spread + SCALE_START) + SMALLEST_SCALE, map_dn

    @staticmethod
    def _carried(
        weights: torch.Tensor, light: torch.Tensor, own: torch.Tensor, share: torch.Tensor, fall: torch.Tensor
    ) -> torch.Tensor:
        """The noise of the cells attended to, carried over to all (N, cells) by brightness, DN."""
        light = light + LIGHT_FLOOR
        reference = (weights * own.square()).sum(1, keepdim=True)
        attended = (weights * light).sum(1, keepdim=True)
        relative = light / attended
        curve = logarithm((light + CURVE_FLOOR) / (attended + CURVE_FLOOR)) * fall[:, None]
        return square_root(reference * (1 + share[:, None] * (relative - 1))) * (-0.5 * curve).exp()

    @staticmethod
    def _traces(weights: torch.Tensor, light: torch.Tensor, own: torch.Tensor) -> torch.Tensor:
        """Noise by brightness, as the traced heads see it: ln sigma and ln weight at each level, (N, 4 levels)."""
        levels = torch.tensor(LEVELS, dtype=light.dtype, device=light.device)
        near = (1 - (light[:, None] - levels[:, None]).abs() / LEVEL_REACH).clamp_min(0)
        mass = weights @ near.mT
        power = weights @ (near * own.square()[:, None]).mT
        known = mass + TRACE_FLOOR
        levels_seen = [0.5 * logarithm((power + TRACE_FLOOR) / known) - 1, 0.2 * logarithm(known) + 1]
        return torch.cat(levels_seen, dim=1).flatten(1)


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
