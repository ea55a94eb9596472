"""Affine maps of logits, fitted to known MTFs by least absolute error and drawn towards a start.

With x the logits of N estimates and M their true MTFs, for each strength l

    A, b = argmin  mean sqrt((sigmoid(A x + b) - M)^2 + e^2) + (l |A - A0|^2 + l0 |b|^2) / 16,

by L-BFGS over all samples, e = 0.005. A0 is the mean of the networks whose logits x holds, [I / E, ..., I / E]; the
offset is drawn to 0 a little (l0), since a few scenes alone do not determine it. Strong draws leave the estimator's
errors and weak ones take on those of the scenes fitted on; `pipeline.blur.camera_calibration` cross-validates l. Ours.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

NEAREST = 0.004  # to 0 and 1 that a logit is taken of
ROUNDING = 0.005  # below which an absolute error counts quadratically
OFFSET_STRENGTH = 3e-3
ROUNDS = 150

Floats = NDArray[np.float64]


def sigmoid(logits: Floats) -> Floats:
    """1 / (1 + exp(-x))."""
    return np.asarray(1 / (1 + np.exp(-logits)))


def logit(mtf: NDArray[np.floating]) -> Floats:
    """log(m / (1 - m)), away from 0 and 1."""
    inside = np.clip(np.asarray(mtf, np.float64), NEAREST, 1 - NEAREST)
    return np.asarray(np.log(inside / (1 - inside)))


def fit(logits: Floats, truth: Floats, strengths: Sequence[float]) -> list[tuple[Floats, Floats]]:
    """A and b for each strength; each begins where the one before ended, so the strongest should come first.

    Args:
        logits: (N, V E) of estimated MTFs, network after network.
        truth: (N, V) known MTFs.
        strengths: l, > 0.

    Returns:
        (V, V E) A and (V,) b of each.
    """
    from scipy.optimize import minimize

    count, values = truth.shape
    extended = np.concatenate([logits, np.ones((count, 1))], axis=1)
    start = np.zeros((values, extended.shape[1]))
    networks = logits.shape[1] // values
    start[:, :-1] = np.tile(np.eye(values), networks) / networks
    maps, at = [], start
    for strength in strengths:
        draw = np.full(start.shape[1], strength / values)
        draw[-1] = OFFSET_STRENGTH / values

        def loss(flat: Floats, draw: Floats = draw) -> tuple[float, Floats]:
            weights = flat.reshape(start.shape)
            mtf = sigmoid(extended @ weights.T)
            error, away = mtf - truth, weights - start
            rounded = np.sqrt(error**2 + ROUNDING**2)
            slope = (error / rounded * mtf * (1 - mtf)).T @ extended / truth.size
            return float(rounded.mean() + (draw * away**2).sum()), (slope + 2 * draw * away).ravel()

        at = minimize(loss, at.ravel(), jac=True, method="L-BFGS-B", options={"maxiter": ROUNDS}).x.reshape(start.shape)
        maps.append((at[:, :-1].copy(), at[:, -1].copy()))
    return maps
