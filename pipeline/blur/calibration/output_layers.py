"""The output layers of an estimator's networks, trained further for one camera, beside a map of their estimates.

A map of a camera (`pipeline.blur.camera_calibration`) sees only the MTFs that networks estimate. Their hidden units z
know more of a patch: its noise, and by which details an estimate came about. Both output layers of each network,

    logit(m) = V relu(U z + u) + v        (256 units each, 16 values),

are trained further together with the map, on the camera's own sharp patches, blurred and with white noise of 0 to 30 DN
(`pipeline.blur.calibration.samples`). With M' by the map alone and M" by the map of these layers, and with several
patches p that the same kernel blurs, of M, they have the least

    mean_p |M"_p - M|  +  |mean_p M"_p - M|.

Alone, the first term is least where every patch keeps to what is likely when it tells little; patches of a frame then
err alike, and no number of them mends it. The second one lets their errors differ. The answer is

    logit(M) = (1 - w) logit(M') + w logit(M"),

where w, of {0, 1/4, 1/2, 3/4, 1}, is the one with which the median of a kernel's patches is nearest to M on scenes that
were held out of both. Layers that begin anew, of 32 or 64 units, follow the few scenes of a camera: on scenes held out
they gained half as much or nothing. With a single scene there is none to hold out, and no correction. Ours.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from pipeline.blur.base import HiddenUnits
from pipeline.blur.calibration.affine_logits import NEAREST, Floats, sigmoid
from pipeline.learning.inference import inference
from pipeline.streams import stream

if TYPE_CHECKING:
    import torch

STEPS = 1000
BATCH = 16  # kernels, with all their patches
MOST_PASSES = 40
"""Over the kernels, in fewer steps where they are few; 2,400 samples are passed 13 to 18 times in all steps."""

LEARNING_RATE = 3e-4
WEIGHTS = (0.0, 0.25, 0.5, 0.75, 1.0)
DECIMALS = 6


@dataclass(frozen=True)
class OutputLayers:
    """The last two layers of E networks; what they give is logits of the MTF.

    Attributes:
        first: (E, K, F) U.
        first_offset: (E, K) u.
        second: (E, 16, K) V.
        second_offset: (E, 16) v.
    """

    first: NDArray[np.float64]
    first_offset: NDArray[np.float64]
    second: NDArray[np.float64]
    second_offset: NDArray[np.float64]


@dataclass(frozen=True)
class Correction(OutputLayers):
    """Output layers of one camera, and the map of their estimates.

    Attributes:
        matrix: (16, 16 E) of the map.
        offset: (16,).
        weight: w, beside the map alone.
    """

    matrix: NDArray[np.float64]
    offset: NDArray[np.float64]
    weight: float

    def __call__(self, mapped: Floats, hidden: HiddenUnits) -> Floats:
        """Logits (N, 16) of M.

        Args:
            mapped: (N, 16) logits of M'.
            hidden: of the same patches.
        """
        return (1 - self.weight) * mapped + self.weight * self.logits(hidden)

    def logits(self, hidden: HiddenUnits) -> Floats:
        """Logits (N, 16) of M"."""
        import torch

        weights = (self.first, self.first_offset, self.second, self.second_offset, self.matrix, self.offset)
        given = (np.asarray(values, np.float64) for values in (hidden.units, hidden.second_share, *weights))
        with inference():
            units, share, *tensors = map(torch.from_numpy, given)
            return np.asarray(_forward(units, share, tensors).numpy())

    def content(self) -> dict[str, Any]:
        """Everything in it, as JSON can hold it."""
        return {part.name: np.asarray(getattr(self, part.name)).tolist() for part in fields(self)}

    @classmethod
    def from_content(cls, content: Any, values: int) -> Self:
        """The correction that `content` gave.

        Args:
            content: of it.
            values: 16.

        Raises:
            KeyError, TypeError, ValueError: not such a content.
        """
        arrays: dict[str, Any] = {part.name: np.array(content[part.name], float) for part in fields(cls)}
        networks, units = arrays["first_offset"].shape
        expected = {
            "first": (networks, units, arrays["first"].shape[-1]),
            "second": (networks, values, units),
            "second_offset": (networks, values),
            "matrix": (values, values * networks),
            "offset": (values,),
            "weight": (),
        }
        for name, shape in expected.items():
            if arrays[name].shape != shape:
                raise ValueError(f"correction.{name} of shape {arrays[name].shape}, expected {shape}")
        if not all(np.isfinite(array).all() for array in arrays.values()):
            raise ValueError("correction: values that are not finite")
        return cls(**(arrays | {"weight": float(arrays["weight"])}))


@dataclass(frozen=True)
class Part:
    """Samples to train on and to hold out, all without noise or all with it.

    Attributes:
        hidden: of N samples.
        mapped: (N, 16) logits by maps that were fitted on other scenes.
        known: (N, 16) true MTFs.
    """

    hidden: HiddenUnits
    mapped: Floats
    known: Floats


Map = tuple[Floats, Floats]


def fit(
    layers: OutputLayers,
    parts: Sequence[Part],
    groups: NDArray[np.int_],
    kernels: NDArray[np.int_],
    maps: Sequence[Map],
    seed: int,
) -> tuple[Correction | None, list[Floats]]:
    """The correction of a camera, or none where it does no good on scenes held out.

    Args:
        layers: of the networks.
        parts: of the same patches and kernels in the same order.
        groups: (N,) the fold of each sample; at least two.
        kernels: (N,) number of the kernel that blurred each sample.
        maps: to begin with: of each group one that was fitted on the others, then that of the camera.
        seed: of the batches.

    Returns:
        the correction, and the logits (N, 16) of every part by corrections that its scene was held out of.
    """
    corrected = [np.empty_like(part.mapped) for part in parts]
    for group, start in zip(np.unique(groups), maps[:-1], strict=True):
        out = groups == group
        made = _trained(layers, start, parts, ~out, kernels, seed)
        for logits, part in zip(corrected, parts, strict=True):
            logits[out] = made.logits(part.hidden.part(out))

    def held_out(weight: float) -> list[Floats]:
        return [(1 - weight) * part.mapped + weight * logits for part, logits in zip(parts, corrected, strict=True)]

    together = _together(groups, kernels)

    def error(weight: float) -> float:
        each = zip(parts, held_out(weight), strict=True)
        return float(np.mean([_error_of_medians(sigmoid(logits), part.known, together) for part, logits in each]))

    weight = min(WEIGHTS, key=error)
    if not weight:
        return None, held_out(0.0)
    made = _trained(layers, maps[-1], parts, np.ones(len(groups), bool), kernels, seed)
    rounded = {part.name: np.round(getattr(made, part.name), DECIMALS) for part in fields(made)}
    return Correction(**(rounded | {"weight": weight})), held_out(weight)


def _together(*labels: NDArray[np.int_]) -> NDArray[np.int_]:
    """(K, P) the samples that have all labels in common, K sets; -1 where a set has fewer than P of them.

    Args:
        labels: (N,) each.
    """
    _, number = np.unique(np.stack(labels), axis=1, return_inverse=True)
    number = number.ravel()
    order = np.argsort(number, kind="stable")
    sizes = np.bincount(number)
    rank = np.arange(len(number)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    table = np.full((len(sizes), int(sizes.max())), -1)
    table[number[order], rank] = order
    return table


def _error_of_medians(mtf: Floats, known: Floats, together: NDArray[np.int_]) -> float:
    """Mean absolute error of the medians over the samples of each set.

    Args:
        mtf: (N, 16) estimates.
        known: (N, 16).
        together: sets; see `_together`.
    """
    members = np.where((together >= 0)[..., None], mtf[together], np.nan)
    return float(np.abs(np.nanmedian(members, axis=1) - known[together[:, 0]]).mean())


def _trained(
    layers: OutputLayers,
    start: Map,
    parts: Sequence[Part],
    kept: NDArray[np.bool_],
    kernels: NDArray[np.int_],
    seed: int,
) -> Correction:
    """Layers and map, trained on the samples kept, at weight 1."""
    import torch

    from pipeline.learning.descent import descend

    def joined(arrays: Sequence[NDArray[np.floating]]) -> torch.Tensor:
        return torch.from_numpy(np.concatenate([array[kept] for array in arrays]).astype(np.float32))

    units, share = (joined([getattr(part.hidden, name) for part in parts]) for name in ("units", "second_share"))
    known = joined([part.known for part in parts])
    names = [layer.name for layer in fields(layers)]
    values = [getattr(layers, name) for name in names] + list(start)
    sets = _together(np.repeat(np.arange(len(parts)), kept.sum()), np.tile(kernels[kept], len(parts)))
    generator = stream(seed, "camera correction batches")

    def loss() -> torch.Tensor:
        batch = torch.from_numpy(sets[generator.integers(0, len(sets), BATCH)])
        present = (batch >= 0)[..., None]
        error = torch.sigmoid(_forward(units[batch.ravel()], share[batch.ravel()], weights)) - known[batch.ravel()]
        error = (error.unflatten(0, batch.shape) * present) / present.sum(1, keepdim=True)
        return (error.abs().sum(1) + error.sum(1).abs()).mean()

    with torch.inference_mode(False), torch.enable_grad(), torch.autocast("cpu", enabled=False):
        weights = [torch.nn.Parameter(torch.from_numpy(np.asarray(value, np.float32))) for value in values]
        descend(weights, loss, steps=min(STEPS, -(-MOST_PASSES * len(sets) // BATCH)), learning_rate=LEARNING_RATE)
    made = dict(zip([*names, "matrix", "offset"], (part.detach().double().numpy() for part in weights), strict=True))
    return Correction(**made, weight=1.0)


def _forward(units: torch.Tensor, share: torch.Tensor, weights: Sequence[torch.Tensor]) -> torch.Tensor:
    """Logits (N, 16) of M" from hidden units (N, E, F) and the second network's share (N,)."""
    import torch

    first, first_offset, second, second_offset, matrix, offset = weights
    seen = torch.relu(torch.einsum("nef,ekf->nek", units, first) + first_offset)
    mtf = torch.sigmoid(torch.einsum("nek,evk->nev", seen, second) + second_offset)
    joint = (1 - share[:, None]) * mtf[:, 0] + share[:, None] * mtf[:, -1]
    estimates = torch.cat([joint[:, None], mtf[:, 1:]], dim=1).flatten(1).clamp(NEAREST, 1 - NEAREST)
    return (estimates / (1 - estimates)).log() @ matrix.T + offset
