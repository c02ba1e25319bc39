"""Do the two energy curves agree as a whole? Statistics over all conditions with their covariance.

Points of one curve are not independent: one calibration error moves them all, and the reference
condition's own error is common to all that are divided by it. Everything here therefore works with
the covariance of the relative errors, never with the error bars alone.

Symbols: E relative error simulated/measured - 1, C its covariance, u standard uncertainty (root of
the diagonal of C), n number of judged conditions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special, stats

from imclab.comparison import Comparison, Outcome, Pair
from imclab.uncertainty import COVERAGE_95, Estimate

FloatArray = NDArray[np.float64]

DRAWS = 20_000
"""Monte Carlo draws of the errors; a probability of 0.95 is then known to 0.0015."""

_RANK_TOLERANCE = 1e-10


@dataclass(frozen=True, kw_only=True)
class BlandAltman:
    """Difference against mean of two methods (Bland and Altman, Lancet 327 (1986) 307).

    Differences are relative to the mean of both, as is usual where the spread grows with the size.

    Attributes
    ----------
    mean, difference : array (n)
        (simulated + measured) / 2, and (simulated - measured) over it.
    bias : Estimate
        Mean difference and its standard error from the scatter of the points.
    lower, upper : float
        Limits of agreement, bias -+ 1.96 standard deviations; NaN for fewer than two points.
    trend : Estimate
        Change of the difference per decade of the mean; NaN for fewer than three points.
    """

    mean: FloatArray
    difference: FloatArray
    bias: Estimate
    lower: float
    upper: float
    trend: Estimate


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """What all judged conditions say together.

    Attributes
    ----------
    conditions : tuple of str
        Those that are judged: all but the reference conditions.
    chi_square : float
        E' C^-1 E over the directions in which C is not zero.
    degrees_of_freedom : int
        Number of those directions.
    chi_square_probability : float
        Of a larger chi-square when the two curves agree.
    area : float
        Area between the distribution of u_i = Phi(E_i / u_i) and the uniform one (u-pooling of
        Ferson and Oberkampf): 0 when errors scatter as stated, at most 0.5.
    area_probability : float
        Of a larger area when errors follow C.
    bound : float
        The claim: abs(E) <= bound at every condition.
    share_inside : float
        Share of conditions whose E lies inside the bound.
    probability_each : tuple of float
        Per condition, that its true relative error lies inside the bound.
    probability_all : float
        That all of them do, with their common errors taken into account.
    worst : str
        The condition with the largest abs(E).
    worst_error : Estimate
        Its E.
    worst_bound_95 : float
        The largest of all true abs(E) lies below this with 95 % probability.
    bland_altman : BlandAltman
    """

    conditions: tuple[str, ...]
    chi_square: float
    degrees_of_freedom: int
    chi_square_probability: float
    area: float
    area_probability: float
    bound: float
    share_inside: float
    probability_each: tuple[float, ...]
    probability_all: float
    worst: str
    worst_error: Estimate
    worst_bound_95: float
    bland_altman: BlandAltman

    @property
    def reduced_chi_square(self) -> float:
        """Chi-square per degree of freedom; near 1 when scatter and stated uncertainty match."""
        return self.chi_square / self.degrees_of_freedom if self.degrees_of_freedom else math.nan


def judged(comparison: Comparison) -> tuple[Outcome, ...]:
    """Return the outcomes of all conditions that are not a reference themselves."""
    return tuple(comparison.outcomes[row] for row in _judged_rows(comparison))


def _judged_rows(comparison: Comparison) -> list[int]:
    outcomes = enumerate(comparison.outcomes)
    return [row for row, outcome in outcomes if outcome.reference != outcome.pair.name]


def agreement(comparison: Comparison, *, draws: int = DRAWS, seed: int = 0) -> Agreement:
    """Judge both curves as a whole.

    Parameters
    ----------
    comparison : Comparison
    draws, seed : int
        Of the Monte Carlo propagation of the covariance.

    Returns
    -------
    Agreement
        With NaN where nothing can be judged (every condition is a reference).
    """
    rows = _judged_rows(comparison)
    if not rows:
        return _nothing_to_judge()
    outcomes = judged(comparison)
    names = tuple(outcome.pair.name for outcome in outcomes)
    error = np.array([outcome.error.value for outcome in outcomes])
    bound = np.array([outcome.error.bound for outcome in outcomes])
    covariance = np.asarray(comparison.covariance, dtype=np.float64)[np.ix_(rows, rows)]
    scale = np.sqrt(np.diag(covariance))
    chi_square, freedom = chi_square_of(error, covariance)
    noise = _draw(covariance, draws, np.random.default_rng(seed))
    inside = np.abs(error + noise) <= bound
    area = float(pooled_area(error, scale))
    larger = float((pooled_area(noise, scale) >= area).mean())
    worst = int(np.argmax(np.abs(error)))
    return Agreement(
        conditions=names,
        chi_square=chi_square,
        degrees_of_freedom=freedom,
        chi_square_probability=float(stats.chi2.sf(chi_square, freedom)) if freedom else math.nan,
        area=area,
        area_probability=larger if math.isfinite(area) else math.nan,
        bound=float(bound.min()),
        share_inside=float((np.abs(error) <= bound).mean()),
        probability_each=tuple(float(share) for share in inside.mean(axis=0)),
        probability_all=float(inside.all(axis=1).mean()),
        worst=names[worst],
        worst_error=Estimate(float(error[worst]), float(scale[worst])),
        worst_bound_95=float(np.quantile(np.abs(error + noise).max(axis=1), 0.95)),
        bland_altman=bland_altman(
            [outcome.simulated_ratio.value for outcome in outcomes],
            [outcome.measured_ratio.value for outcome in outcomes],
        ),
    )


_UNKNOWN = Estimate(math.nan, math.nan)


def _nothing_to_judge() -> Agreement:
    return Agreement(
        conditions=(),
        chi_square=math.nan,
        degrees_of_freedom=0,
        chi_square_probability=math.nan,
        area=math.nan,
        area_probability=math.nan,
        bound=math.nan,
        share_inside=math.nan,
        probability_each=(),
        probability_all=math.nan,
        worst="",
        worst_error=_UNKNOWN,
        worst_bound_95=math.nan,
        bland_altman=bland_altman([], []),
    )


def chi_square_of(error: ArrayLike, covariance: ArrayLike) -> tuple[float, int]:
    """Return chi-square and degrees of freedom of correlated errors.

    Directions in which the covariance vanishes (two conditions with nothing but common errors) carry
    no statement and are left out; a covariance that is zero altogether leaves none.
    """
    error, covariance = np.atleast_1d(np.asarray(error, float)), np.atleast_2d(np.asarray(covariance, float))
    scale = np.sqrt(np.diag(covariance))
    known = scale > 0
    if not known.any():
        return math.nan, 0
    correlation = covariance[np.ix_(known, known)] / np.outer(scale[known], scale[known])
    values, vectors = np.linalg.eigh(correlation)
    kept = values > _RANK_TOLERANCE * values.max()
    components = vectors.T[kept] @ (error[known] / scale[known])
    return float((components**2 / values[kept]).sum()), int(kept.sum())


def pooled_area(error: ArrayLike, stderr: ArrayLike) -> FloatArray:
    """Area between the pooled distribution of Phi(E/u) and the uniform distribution on [0, 1].

    Exact: between two neighbouring points the empirical distribution keeps one level, and the
    integral of ``|t - level|`` is ``(t - level)|t - level| / 2``.

    Parameters
    ----------
    error : array (..., n)
        One curve, or many.
    stderr : array (n)
        Points without an uncertainty are left out.

    Returns
    -------
    array (...)
        NaN when no point has an uncertainty.
    """
    error, stderr = np.asarray(error, float), np.asarray(stderr, float)
    known = stderr > 0
    if not known.any():
        return np.full(error.shape[:-1], np.nan)
    points = np.sort(special.ndtr(error[..., known] / stderr[known]), axis=-1)
    ends = np.broadcast_to([0.0, 1.0], (*points.shape[:-1], 2))
    points = np.concatenate([ends[..., :1], points, ends[..., 1:]], axis=-1)
    level = np.arange(points.shape[-1] - 1) / (points.shape[-1] - 2)
    after, before = points[..., 1:] - level, points[..., :-1] - level
    return np.asarray((after * np.abs(after) - before * np.abs(before)).sum(axis=-1) / 2)


def pixel_area(pair: Pair) -> float:
    """Area metric of the two pictures' pixel energies, as a share of the measured mean.

    Wasserstein distance between the distributions of simulated and measured energy over the pixels
    of the region (V&V 10.1): blind to where the light falls, so registration does not enter.
    """
    measured, simulated = pair.measured[pair.region], pair.simulated[pair.region]
    level = float(np.abs(measured.mean())) if measured.size else 0.0
    return float(stats.wasserstein_distance(simulated, measured) / level) if level else math.nan


def bland_altman(simulated: ArrayLike, measured: ArrayLike) -> BlandAltman:
    """Difference against mean of two curves, relative to the mean; see `BlandAltman`."""
    simulated, measured = np.asarray(simulated, float), np.asarray(measured, float)
    mean = (simulated + measured) / 2
    difference = (simulated - measured) / mean
    count = difference.size
    bias = float(difference.mean()) if count else math.nan
    spread = float(difference.std(ddof=1)) if count > 1 else math.nan
    return BlandAltman(
        mean=mean,
        difference=difference,
        bias=Estimate(bias, spread / math.sqrt(count) if count else math.nan),
        lower=bias - COVERAGE_95 * spread,
        upper=bias + COVERAGE_95 * spread,
        trend=_trend(np.log10(mean), difference),
    )


def _trend(x: FloatArray, y: FloatArray) -> Estimate:
    if x.size < 3 or np.ptp(x) == 0:
        return _UNKNOWN
    line = stats.linregress(x, y)
    return Estimate(float(line.slope), float(line.stderr))


def _draw(covariance: FloatArray, draws: int, rng: np.random.Generator) -> FloatArray:
    """Draw errors of a covariance that may be singular; shape (draws, n)."""
    values, vectors = np.linalg.eigh(covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    return np.asarray(rng.standard_normal((draws, values.size)) @ root.T)
