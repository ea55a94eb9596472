"""Average precision as a function of ISO and exposure time: the paper's regression (supplement).

With x the ISO setting and y the exposure time in milliseconds,

    AP(x, y) = c1 x y + c2 x + c3 y + c4 sqrt(y) + c5 + c6 / (x y) + c7 / x + c8 / y        [percent]

fitted by (weighted) least squares. Standard deviations follow from the covariance of linear least squares: scaled by
chi2 / (n - terms) where the errors of the data are unknown, as the paper's are (its printed deviations come out to four
digits from its 42 cells and its chi2), and as they are where an error is given for each value. Values of one sweep rest
on the same frames and err together; where resampled values are given as well, their covariance S takes the place of
independent errors,

    cov(c) = A S A^T,    c = A AP

p-values of single terms still take residuals for independent.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.curves.monotonic import ROUNDING_PERCENT
from pipeline.errors import InputError, did_you_mean

Floats = NDArray[np.float64]

TERMS: dict[str, Callable[[Floats, Floats], Floats]] = {
    "c1": lambda x, y: x * y,
    "c2": lambda x, y: x,
    "c3": lambda x, y: y,
    "c4": lambda x, y: np.sqrt(y),
    "c5": lambda x, y: np.ones_like(x),
    "c6": lambda x, y: 1.0 / (x * y),
    "c7": lambda x, y: 1.0 / x,
    "c8": lambda x, y: 1.0 / y,
}
"""Coefficient -> what it multiplies."""
FORMULAS = dict(zip(TERMS, ("x y", "x", "y", "sqrt(y)", "1", "1 / (x y)", "1 / x", "1 / y"), strict=True))
"""Coefficient -> the same in words."""


@dataclass(frozen=True)
class Fit:
    """A fitted regression.

    Attributes:
        terms: names of the coefficients, (k,).
        value: (k,) coefficients.
        covariance: (k, k) of the coefficients.
        chi2: sum of squared residuals, each divided by its error if errors were given.
        r2: share of the (weighted) variance that is explained; NaN where all data are alike (`alike`).
        degrees: of freedom, n - k.
        iso: (n,) of the data.
        exposure_ms: (n,).
        ap_percent: (n,).
        residual: (n,) data - fit, percent.
    """

    terms: tuple[str, ...]
    value: Floats
    covariance: Floats
    chi2: float
    r2: float
    degrees: int
    iso: Floats
    exposure_ms: Floats
    ap_percent: Floats
    residual: Floats

    @property
    def std_dev(self) -> Floats:
        """(k,) standard deviations of the coefficients; NaN without a degree of freedom."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    @property
    def adjusted_r2(self) -> float:
        """1 - (1 - R2) (n - 1) / (n - k): R2 with a price on every term; NaN without a degree of freedom."""
        return 1.0 - (1.0 - self.r2) * (len(self.iso) - 1) / self.degrees if self.degrees else float("nan")

    def predict(self, iso: ArrayLike, exposure_ms: ArrayLike) -> tuple[Floats, Floats]:
        """The fitted average precision and its standard deviation, percent, in the common shape of the arguments.

        The form is the paper's and has no bounds: values below 0 or above 100 % are misfit. With errors or resamples
        given, the standard deviation is that of sampling, given the form: it leaves out lack of fit, which `residual`
        shows and which may be larger.

        Args:
            iso: (...) within the range of the data.
            exposure_ms: (...) likewise.

        Raises:
            InputError: outside the range of the data, where a sum of such terms means nothing.
        """
        x, y = np.broadcast_arrays(np.asarray(iso, dtype=float), np.asarray(exposure_ms, dtype=float))
        for name, given, known in (("iso", x, self.iso), ("exposure_ms", y, self.exposure_ms)):
            outside = ~((given >= known.min()) & (given <= known.max()))
            if outside.any():
                raise InputError(
                    f"{name}: {given[outside][0]:g} is outside of {known.min():g} .. {known.max():g}, where the fit has"
                    " data; it is not extrapolated"
                )
        rows = design(x.ravel(), y.ravel(), self.terms)
        variance = np.einsum("nk,kl,nl->n", rows, self.covariance, rows)
        return (rows @ self.value).reshape(x.shape), np.sqrt(np.maximum(variance, 0.0)).reshape(x.shape)


@dataclass(frozen=True)
class LeftOut:
    """What a term is worth: the fit without it.

    Attributes:
        term: the coefficient left out.
        chi2, r2, adjusted_r2: of the fit without it.
        largest_change: largest change of a fitted value, percent points.
        f: (chi2 without - chi2 with) / (chi2 with / degrees), the partial F statistic.
        p_value: chance of an F as large if the term were zero and errors were normal. Both are NaN without a degree of
            freedom, or where all data are alike.
    """

    term: str
    chi2: float
    r2: float
    adjusted_r2: float
    largest_change: float
    f: float
    p_value: float


def design(iso: ArrayLike, exposure_ms: ArrayLike, terms: Sequence[str] = tuple(TERMS)) -> Floats:
    """What the coefficients multiply.

    Args:
        iso: (n,) positive.
        exposure_ms: (n,) positive.
        terms: which coefficients.

    Returns:
        (n, k).

    Raises:
        InputError: a number that is not positive, lengths that differ, no term, or an unknown one.
    """
    x, y = np.asarray(iso, dtype=float), np.asarray(exposure_ms, dtype=float)
    if x.ndim != 1 or x.shape != y.shape:
        raise InputError(f"iso and exposure_ms: expected two lists of one length, not shapes {x.shape} and {y.shape}")
    for name, values in (("iso", x), ("exposure_ms", y)):
        if not (np.isfinite(values) & (values > 0)).all():
            raise InputError(f"{name}: expected positive numbers; the terms divide by them")
    if not len(terms):
        raise InputError(f"terms: expected at least one of {', '.join(TERMS)}")
    for term in terms:
        if term not in TERMS:
            raise InputError(f"unknown term '{term}'; {did_you_mean(term, TERMS)}")
    return np.stack([TERMS[term](x, y) for term in terms], axis=1)


def evaluate(coefficients: ArrayLike, iso: ArrayLike, exposure_ms: ArrayLike) -> Floats:
    """Average precision in percent (n,) for given c1..c8, at any positive (n,) ISO and (n,) exposure in milliseconds.

    Raises:
        InputError: not eight coefficients, or see `design`.
    """
    values = np.asarray(coefficients, dtype=float)
    if values.shape != (len(TERMS),):
        raise InputError(f"coefficients: expected c1 .. c8, not shape {values.shape}")
    result: Floats = design(iso, exposure_ms) @ values
    return result


def fit(
    iso: ArrayLike,
    exposure_ms: ArrayLike,
    ap_percent: ArrayLike,
    error_percent: ArrayLike | None = None,
    terms: Sequence[str] = tuple(TERMS),
    draws_percent: ArrayLike | None = None,
) -> Fit:
    """Fit the regression.

    Args:
        iso: (n,) positive.
        exposure_ms: (n,) positive.
        ap_percent: (n,) average precisions.
        error_percent: (n,) standard deviation of each, positive; None for equal, unknown errors.
        terms: which coefficients.
        draws_percent: (n, B) average precisions of B resamples of all data at once, for the covariance of the
            coefficients; where a value scatters less than its error says, the rest counts as independent. Resamples
            that lack a value are left out. Only beside errors.

    Raises:
        InputError: see `design`; fewer values than terms, values that are not finite, errors that are not positive,
            draws without errors or of another number of values, or data that cannot tell the terms apart (say, a
            single ISO).
    """
    from scipy.linalg import qr, solve_triangular

    rows, data = design(iso, exposure_ms, terms), np.asarray(ap_percent, dtype=float)
    count, size = rows.shape
    if data.shape != (count,) or not np.isfinite(data).all():
        raise InputError(f"ap_percent: expected {count} finite numbers; leave out cells without a value")
    if count < size:
        raise InputError(f"{count} values cannot determine {size} coefficients; expected at least as many")
    weight = np.ones(count)
    if draws_percent is not None and error_percent is None:
        raise InputError("draws_percent: expected error_percent beside it")
    if error_percent is not None:
        errors = np.asarray(error_percent, dtype=float)
        if errors.shape != (count,) or not (np.isfinite(errors) & (errors > 0)).all():
            raise InputError(f"error_percent: expected {count} positive numbers")
        weight = 1.0 / errors
    # Columns span eight decades (x y against 1 / (x y)); scaled to unit length they are solved without loss.
    weighted = rows * weight[:, None]
    scale = np.linalg.norm(weighted, axis=0)
    q, r = qr(weighted / scale, mode="economic")
    if np.abs(np.diag(r)).min() < 1e-10:
        raise InputError("iso, exposure_ms: these settings cannot tell the terms apart; vary both over more values")
    value = solve_triangular(r, q.T @ (data * weight)) / scale
    inverse = solve_triangular(r, np.eye(size)) / scale[:, None]
    residual = data - rows @ value
    chi2 = float(np.sum((residual * weight) ** 2))
    degrees = count - size
    spread = 1.0 if error_percent is not None else (chi2 / degrees if degrees else np.nan)
    covariance = inverse @ inverse.T * spread
    if draws_percent is not None:
        operator = solve_triangular(r, (q * weight[:, None]).T) / scale[:, None]
        covariance = operator @ _common(np.asarray(draws_percent, dtype=float), 1.0 / weight) @ operator.T
    centre = np.average(data, weights=weight**2)
    total = float(np.sum(((data - centre) * weight) ** 2))
    return Fit(
        terms=tuple(terms),
        value=value,
        covariance=covariance,
        chi2=chi2,
        r2=float("nan") if alike(data) else 1.0 - chi2 / total,
        degrees=degrees,
        iso=np.asarray(iso, dtype=float),
        exposure_ms=np.asarray(exposure_ms, dtype=float),
        ap_percent=data,
        residual=residual,
    )


def alike(ap_percent: Floats) -> bool:
    """Whether values (n,), at least one, are the same but for rounding, of which chi2 then consists alone."""
    return bool(np.ptp(ap_percent) <= ROUNDING_PERCENT)


def _common(draws: Floats, errors: Floats) -> Floats:
    """Covariance (n, n) of values whose resamples (n, B) belong together, their errors at least `errors` (n,)."""
    if draws.ndim != 2 or len(draws) != len(errors):
        raise InputError(f"draws_percent: expected {len(errors)} rows of resamples, not shape {draws.shape}")
    known = draws[:, np.isfinite(draws).all(axis=0)]
    if known.shape[1] < 2:
        return np.diag(errors**2)
    covariance = np.cov(known)
    return np.asarray(covariance + np.diag(np.maximum(errors**2 - np.diag(covariance), 0.0)))


def leave_one_out(
    iso: ArrayLike, exposure_ms: ArrayLike, ap_percent: ArrayLike, error_percent: ArrayLike | None = None
) -> list[LeftOut]:
    """The fit without each of its terms in turn, for the arguments of `fit`; most missed first."""
    from scipy.stats import f as f_distribution

    whole = fit(iso, exposure_ms, ap_percent, error_percent)
    rows = []
    for left in whole.terms:
        part = fit(iso, exposure_ms, ap_percent, error_percent, [term for term in whole.terms if term != left])
        excess = part.chi2 - whole.chi2
        ratio = p_value = float("nan")  # as many values as coefficients: what a term is worth cannot be told
        if whole.degrees and not alike(whole.ap_percent):
            ratio = excess * whole.degrees / whole.chi2 if whole.chi2 > 0 else float("inf")
            p_value = float(f_distribution.sf(ratio, 1, whole.degrees))
        change = float(np.abs(part.residual - whole.residual).max())
        rows.append(LeftOut(left, part.chi2, part.r2, part.adjusted_r2, change, ratio, p_value))
    return sorted(rows, key=lambda row: -row.chi2)
