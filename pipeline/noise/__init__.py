"""Noise level of an image patch: one estimator per file, all with the same call.

>>> from pipeline import noise
>>> estimate = noise.create("pca").estimate(patches)     # (N, 1, 128, 128) float in [0, 1]
>>> estimate.sigma_dn, estimate.abstained, estimate.reason
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pipeline.registry import Registry

if TYPE_CHECKING:
    from pipeline.noise.base import NoiseEstimator

REGISTRY = Registry(
    kind="noise estimator",
    group="pipeline.noise",
    builtin={
        "pca": "pipeline.noise.pca:PrincipalComponents",
        "bf": "pipeline.noise.bf:BlockAndFilter",
        "wavelet": "pipeline.noise.wavelet:WaveletMedian",
        "cellwise": "pipeline.noise.cellwise:Cellwise",
        "correlated": "pipeline.noise.correlated:Correlated",
        "adaptive": "pipeline.noise.adaptive:Adaptive",
        "cnn": "pipeline.noise.cnn:PixelCnn",
        "immerkaer": "pipeline.noise.immerkaer:Immerkaer",
    },
    method="estimate",
)

DEFAULT = "adaptive"
"""The estimator that the monitor and the command line use: right on white noise and on processed pictures."""


def create(name: str, **options: Any) -> NoiseEstimator:
    """A noise estimator by name.

    Args:
        name: one of ``REGISTRY.names()``.
        options: the estimator's own, as in its class.

    Raises:
        InputError: unknown name or option, an option out of range, or a class without what an estimator has.
    """
    estimator: NoiseEstimator = REGISTRY.create(name, **options)
    return estimator
