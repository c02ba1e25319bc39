from __future__ import annotations

import numpy as np
import pytest

from tests import judging


def test_families_of_normal_numbers_are_rejected_as_often_as_stated() -> None:
    draws = np.random.default_rng(1).standard_normal((20_000, 25))
    share = np.mean([judging.reject(row, level=0.05) for row in draws])
    assert share == pytest.approx(0.05, abs=4 * np.sqrt(0.05 * 0.95 / 20_000))


def test_errors_from_few_batches_need_the_wider_threshold() -> None:
    batches = np.random.default_rng(2).standard_normal((20_000, 8))
    z = judging.z_of(batches.mean(axis=1), batches.std(axis=1, ddof=1) / np.sqrt(8), 0.0)
    aware = np.mean([judging.reject(one, level=0.05, degrees=7) for one in z])
    naive = np.mean([judging.reject(one, level=0.05) for one in z])
    assert aware == pytest.approx(0.05, abs=0.007)
    assert naive > 0.07


def test_a_shift_of_six_errors_and_what_is_no_number_are_rejected() -> None:
    assert judging.reject([0.1, 6.0])
    assert judging.reject([0.1, np.nan])
    assert judging.reject(judging.z_of(1.0, 0.0, 2.0))
    assert not judging.reject(judging.z_of(1.0, 0.0, 1.0))


def test_chi2_accepts_the_true_law_and_rejects_a_wrong_one() -> None:
    rng = np.random.default_rng(3)
    expected = np.full(50, 200.0)
    assert np.mean([judging.reject_chi2(rng.poisson(expected), expected) for _ in range(500)]) < 0.01
    tilted = expected * np.linspace(0.8, 1.2, 50)
    assert judging.reject_chi2(rng.poisson(tilted), expected)


def test_chi2_joins_cells_that_expect_little() -> None:
    assert not judging.reject_chi2([0, 1, 0, 100], [0.1, 0.1, 0.1, 100.7])


def test_coverage_of_normal_numbers() -> None:
    draws = np.random.default_rng(4).standard_normal(100_000)
    assert judging.coverage(draws, 1.0, 0.0) == pytest.approx(0.6827, abs=0.005)
    assert judging.coverage(draws, 1.0, 0.0, errors=2.0) == pytest.approx(0.9545, abs=0.003)
