from __future__ import annotations

import numba
import numpy as np
from scipy.stats import qmc

from imclab.transport import even_points


@numba.njit
def _points(seed, first, count):
    point = even_points.first_point(seed, first, 7)
    words = np.empty((count, even_points.DIMENSIONS), np.uint32)
    uniform = np.empty((count, even_points.DIMENSIONS))
    for i in range(count):
        even_points.advance(point, i)
        for dimension in range(even_points.DIMENSIONS):
            words[i, dimension] = point[dimension]
            uniform[i, dimension] = even_points.coordinate(point, dimension)
    return words, uniform


def points(first: int = 0, count: int = 1024, seed: int = 3):
    return _points(np.uint64(seed), np.uint64(first), count)


def test_points_are_those_of_sobol_but_for_the_shift() -> None:
    """scipy has the same sequence; the shift is that of the first point, which is 0 there."""
    words, uniform = points()
    theirs = qmc.Sobol(even_points.DIMENSIONS, scramble=False, bits=32).random(1024)
    assert np.array_equal(words ^ words[0], (theirs * 2.0**32).astype(np.uint32))
    assert uniform.min() > 0.0
    assert uniform.max() < 1.0


def test_batches_have_shifts_of_their_own() -> None:
    shifts = np.array([points(first, 1)[0][0] for first in range(0, 4000, 100)])
    assert len(np.unique(shifts)) == shifts.size
    assert np.array_equal(points(100, 64)[0], points(100, 64)[0])
    assert not np.array_equal(points(100, 64, seed=4)[0], points(100, 64)[0])


def test_means_have_no_bias_and_spread_less_than_those_of_independent_points() -> None:
    """Product of six squares, mean 3^-6; independent points would spread three times as much."""
    means = np.array([np.mean(np.prod(points(first, 1024)[1][:, :6] ** 2, axis=1)) for first in range(200)])
    error = means.std(ddof=1) / np.sqrt(200)
    assert abs(means.mean() - 3.0**-6) < 4.0 * error
    independent = np.sqrt((5.0**-6 - 9.0**-6) / 1024)
    assert 3.0 * means.std() < independent
    assert abs(1.03 * means.mean() - 3.0**-6) > 4.0 * error
