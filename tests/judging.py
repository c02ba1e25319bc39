"""Statistics of the tests: Z of differences, corrected for many tests, coverage, and chi squared.

A statistical test asks ``reject(z)``: it says no when the largest of many Z is one that would come about
by chance less often than ``LEVEL``. Each such test has a power partner: a wrong model that is rejected.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

LEVEL = 1e-3
"""Chance that a right model is rejected, for a whole family of comparisons (Bonferroni, Sidak)."""


def z_of(
    value: ArrayLike, stderr: ArrayLike, truth: ArrayLike, truth_stderr: ArrayLike = 0.0
) -> NDArray[np.float64]:
    """Return differences in units of their standard errors; 0 where both are exactly equal."""
    difference = np.asarray(value, dtype=float) - np.asarray(truth, dtype=float)
    error = np.hypot(stderr, truth_stderr)
    with np.errstate(divide="ignore", invalid="ignore"):
        z = difference / error
    return np.where(difference == 0.0, 0.0, z)


@lru_cache
def threshold(count: int, *, level: float = LEVEL, degrees: float = np.inf) -> float:
    """Return the |Z| that the largest of ``count`` exceeds with probability ``level``.

    ``degrees`` are those of freedom of the standard errors: errors from few batches have tails.
    """
    each = -np.expm1(np.log1p(-level) / count)
    if np.isinf(degrees):
        return float(stats.norm.isf(each / 2.0))
    return float(stats.t.isf(each / 2.0, degrees))


def reject(z: ArrayLike, *, level: float = LEVEL, degrees: float = np.inf) -> bool:
    """Tell whether the differences are too large for chance; anything not finite is."""
    values = np.abs(np.atleast_1d(np.asarray(z, dtype=float)))
    if not np.isfinite(values).all():
        return True
    return bool(values.max() > threshold(values.size, level=level, degrees=degrees))


def reject_chi2(observed: ArrayLike, expected: ArrayLike, *, level: float = LEVEL) -> bool:
    """Tell whether counts differ from expected ones by more than chance (Pearson).

    Cells that expect fewer than ten are joined with their neighbours.
    """
    cells: list[tuple[float, float]] = []
    seen, wanted = 0.0, 0.0
    for count, expectation in zip(np.ravel(observed), np.ravel(expected), strict=True):
        seen, wanted = seen + count, wanted + expectation
        if wanted >= 10.0:
            cells.append((seen, wanted))
            seen, wanted = 0.0, 0.0
    if cells:
        last_seen, last_wanted = cells.pop()
        cells.append((last_seen + seen, last_wanted + wanted))
    counts = np.array(cells)
    chi2 = float(np.sum((counts[:, 0] - counts[:, 1]) ** 2 / counts[:, 1]))
    return bool(stats.chi2.sf(chi2, len(cells) - 1) < level)


def coverage(value: ArrayLike, stderr: ArrayLike, truth: ArrayLike, *, errors: float = 1.0) -> float:
    """Return the share of values that lie within so many standard errors of the truth."""
    return float(np.mean(np.abs(z_of(value, stderr, truth)) <= errors))
