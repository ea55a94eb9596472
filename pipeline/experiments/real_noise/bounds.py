"""How much noise there is at most in pictures of real cameras that have no estimate because of a codec."""

from __future__ import annotations

import numpy as np
import pandas as pd

from pipeline.condition.summary import most_noise_dn, summarise_noise
from pipeline.noise.base import NoiseEstimate


def picture_bounds(patches: pd.DataFrame) -> pd.DataFrame:
    """Pictures without an estimate because of a codec, and how much noise there is at most in them.

    Every picture is taken for a frame of its patches (`pipeline.condition.summary`), the noisy ones and the means.

    Args:
        patches: `pipeline.noise.real_noise.COLUMNS`, of one estimator.

    Returns:
        two rows, ``of`` noisy photographs and of their means: ``pictures``, ``bounded`` of them, and of these the
        medians over pictures of the bound and of the cleaned truth (0 for means), ``bound_dn`` and ``true_dn``, and
        ``held_fraction``, with the truth, the median over a picture's patches, below the bound; NaN without any.
    """
    rows = []
    for kind, prefix in (("photographs", ""), ("means", "mean_picture_")):
        each = [_bounded(group, prefix) for _, group in patches.groupby("picture", sort=False)]
        known = np.array([pair for pair in each if pair is not None]).reshape(-1, 2)
        bound, true = known.T
        row = {"of": kind, "pictures": len(each), "bounded": len(known)}
        nan = float("nan")
        medians = (np.median(bound), np.median(true), np.mean(true <= bound)) if len(known) else (nan, nan, nan)
        rows.append(row | dict(zip(("bound_dn", "true_dn", "held_fraction"), map(float, medians), strict=True)))
    return pd.DataFrame(rows)


def _bounded(patches: pd.DataFrame, prefix: str) -> tuple[float, float] | None:
    """Bound and truth of a picture that has no estimate; None where it has one, or no bound."""
    sigma_dn, reason = patches[f"{prefix}sigma_dn"].to_numpy(), patches[f"{prefix}reason"].to_numpy()
    estimate = NoiseEstimate(
        sigma_dn, sigma_dn, sigma_dn, reason != "", reason, at_most_dn=patches[f"{prefix}at_most_dn"].to_numpy()
    )
    bound = most_noise_dn(estimate)
    if np.isfinite(summarise_noise(estimate).value) or np.isnan(bound):
        return None
    return bound, 0.0 if prefix else float(patches["cleaned_sigma_dn"].median())
