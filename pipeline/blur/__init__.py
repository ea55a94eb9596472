"""Blur estimators: the MTF of a patch from its content. Source (estimators by name) on top, one per file.

from pipeline import blur
answer = blur.create("pmp", mode="fast", kernel_size=31).estimate(patches)
"""

from __future__ import annotations

from typing import Any

from pipeline.blur.base import BlurEstimate, BlurEstimator
from pipeline.registry import Registry

REGISTRY = Registry(
    "blur estimator",
    "pipeline.blur",
    {
        "cnn": "pipeline.blur.cnn:Cnn",
        "fused": "pipeline.blur.fused:Fused",
        "gbb": "pipeline.blur.gbb:GraphBlindDeblurring",
        "pmp": "pipeline.blur.pmp:PatchwiseMinimalPixels",
        "spectral": "pipeline.blur.spectral:Spectral",
    },
    "estimate",
)


def create(name: str, **options: Any) -> BlurEstimator:
    """Make an estimator by its registered name, with its own options.

    Raises:
        InputError: unknown name or option, or a class without what an estimator has.
    """
    made: BlurEstimator = REGISTRY.create(name, **options)
    return made


__all__ = ["REGISTRY", "BlurEstimate", "BlurEstimator", "create"]
