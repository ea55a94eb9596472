"""How much the sum of an autocorrelated series varies beyond that of independent values.

tau^2 = 1 + 2 (rho_1 + rho_2 + ...), the sum of all autocorrelations, is read from a short series by two models; the
greater of both counts, each at the upper end of its interval of one standard error:

- *first order*: tau^2 = (1 + phi) / (1 - phi), phi the lag-1 autocorrelation without the bias of short series (Kendall,
  "Note on bias in the estimation of autocorrelation", Biometrika 1954);
- *scenery and scatter*: a part a of the variance is first-order autoregressive by phi, as what the camera passes, the
  rest is white, as the error of an estimator; rho_j = a phi^j, which lag 1 alone does not show. The spectrum is

      f(w) = (1 - a) + a (1 - phi^2) / |1 - phi exp(-iw)|^2,      tau^2 = f(0) = 1 + 2 a phi / (1 - phi).

  The likelihood of Whittle ("Estimation and information in stationary time series", Arkiv foer Matematik 1953), with
  the total variance fitted and without frequency 0, which holds the mean, is compared on a grid of a and phi; the
  greatest tau^2 whose log-likelihood is at most 1/2 below the best one counts.

Slow parts of less than a twentieth of the variance are taken for white, and phi for at most 0.98. Scenery is looked for
that is alike, for 1 / (1 - phi) frames, over a sixth of the series at most (phi 0.98 of 300 frames, 5 s at 10 frames
per second; 0.93 of 100). What varies more slowly has a greater tau^2 than can be read from the series.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

LARGEST_AUTOCORRELATION = 0.98
SCENERY_AUTOCORRELATIONS = (0.3, 0.5, 0.6, 0.7, 0.8, 0.85, 0.9, 0.93, 0.95, 0.965, LARGEST_AUTOCORRELATION)
SCENERY_SHARES = tuple(0.05 * part for part in range(1, 21))
LEAST_TIMES = 6  # how often a series must hold the 1 / (1 - phi) frames that scenery is alike for
LIKELIHOOD_DROP = 0.5  # one standard error
STANDARD_ERRORS = 1.0
LEAST_POWER = 1e-12


def long_run_variance(series: Floats) -> Floats:
    """Upper estimate of tau^2 of series of any mean and variance.

    Args:
        series: (n, ...) finite values, n at least 10.

    Returns:
        (...) tau^2, 1 to 99; 1 where the series is constant.
    """
    return np.maximum(first_order(series), scenery_and_scatter(series))


def first_order(series: Floats) -> Floats:
    """tau^2 of a first-order autoregressive series, one standard error above its estimate.

    Args:
        series: (n, ...) finite values.

    Returns:
        (...) tau^2, 1 to 99.
    """
    n = len(series)
    raw = lag_1(series - series.mean(axis=0))
    phi = raw + (1 + 3 * np.maximum(raw, 0)) / n  # bias of short series
    phi = phi + STANDARD_ERRORS * np.sqrt(np.maximum(1 - np.clip(phi, 0, 1) ** 2, 0.0) / n)
    phi = np.where(np.ptp(series, axis=0) > 0, np.clip(phi, 0.0, LARGEST_AUTOCORRELATION), 0.0)
    return np.asarray((1 + phi) / (1 - phi))


def scenery_and_scatter(series: Floats) -> Floats:
    """tau^2 of an autoregressive series with white noise added, at the upper end of its likelihood interval.

    Args:
        series: (n, ...) finite values.

    Returns:
        (...) tau^2, 1 to 99.
    """
    n = len(series)
    flat = (series - series.mean(axis=0)).reshape(n, -1)
    power = np.abs(np.fft.rfft(flat, axis=0)[1 : (n + 1) // 2]) ** 2 / n
    phase = np.exp(-2j * np.pi * np.arange(1, len(power) + 1) / n)
    spectra, variances = [np.ones(len(power))], [1.0]
    for phi in SCENERY_AUTOCORRELATIONS:
        if (1 - phi) * n < LEAST_TIMES - 1e-6:
            continue
        slow = (1 - phi**2) / np.abs(1 - phi * phase) ** 2
        spectra += [1 - share + share * slow for share in SCENERY_SHARES]
        variances += [1 + 2 * share * phi / (1 - phi) for share in SCENERY_SHARES]
    models = np.array(spectra)
    scale = np.maximum((1 / models) @ power / len(power), LEAST_POWER)
    likelihood = -np.log(models).sum(axis=1)[:, None] - len(power) * np.log(scale)
    likely = likelihood >= likelihood.max(axis=0) - LIKELIHOOD_DROP
    tau2 = np.where(likely & (np.ptp(flat, axis=0) > 0), np.array(variances)[:, None], 1.0).max(axis=0)
    return np.asarray(tau2.reshape(series.shape[1:]))


def lag_1(centred: Floats, axes: tuple[int, ...] = (0,)) -> Floats:
    """Lag-1 autocorrelation along the first axis.

    Args:
        centred: (n, ...) values without their mean.
        axes: what products and squares are summed over, the first axis among them.

    Returns:
        (...) autocorrelation, of the other axes.
    """
    products, squares = (centred[1:] * centred[:-1]).sum(axis=axes), (centred**2).sum(axis=axes)
    return np.asarray(products / np.maximum(squares, 1e-12))
