"""Budgets, covariances and verdicts."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm
from scipy.stats import t as student

from imclab.uncertainty import ComparisonError, Estimate, budget, covariance, effective_dof


def test_interval_is_that_of_a_normal_distribution() -> None:
    low, high = Estimate(10.0, 2.0).interval
    assert (low, high) == pytest.approx(norm(10, 2).interval(0.95), rel=1e-12)


def test_few_repeats_widen_the_interval() -> None:
    low, high = Estimate(10.0, 2.0, dof=5).interval
    assert (low, high) == pytest.approx(student(5, 10, 2).interval(0.95), rel=1e-12)


def test_effective_degrees_of_freedom_follow_welch_and_satterthwaite() -> None:
    assert effective_dof({"a": 0.1}, {"a": 7}) == pytest.approx(7)
    assert effective_dof({"a": 0.1, "b": 0.1}, {"a": 7, "b": 7}) == pytest.approx(14)
    assert effective_dof({"a": 0.1}, {}) == np.inf


def test_validation_uncertainty_is_the_root_sum_of_squares() -> None:
    error = ComparisonError(0.1, {"a": 0.03, "b": 0.04})
    assert error.u_val == pytest.approx(0.05)
    assert error.shares == pytest.approx({"a": 0.36, "b": 0.64})


@pytest.mark.parametrize("value", [-0.4, 0.0, 0.25, 0.3, 0.6])
def test_probability_inside_is_that_of_a_normal_distribution(value: float) -> None:
    error = ComparisonError(value, {"a": 0.07})
    wanted = norm.cdf(0.3, value, 0.07) - norm.cdf(-0.3, value, 0.07)
    assert error.probability_inside == pytest.approx(wanted, abs=1e-12)


def test_probability_without_uncertainty_is_yes_or_no() -> None:
    assert ComparisonError(0.29, {}).probability_inside == 1.0
    assert ComparisonError(0.31, {}).probability_inside == 0.0


@pytest.mark.parametrize(
    ("value", "spread", "says"),
    [
        (0.05, 0.03, "agrees within its uncertainty"),
        (0.20, 0.03, "differs, inside the bound"),
        (0.29, 0.03, "differs, perhaps outside the bound"),
        (0.50, 0.03, "differs, outside the bound"),
    ],
)
def test_verdict(value: float, spread: float, says: str) -> None:
    assert ComparisonError(value, {"a": spread}).verdict == says


def test_an_effect_shared_by_conditions_is_shared_in_the_covariance() -> None:
    sources = {"own": np.diag([0.1, 0.2]), "shared": np.array([[0.3, 0.3]])}
    assert covariance(sources) == pytest.approx(np.array([[0.10, 0.09], [0.09, 0.13]]))
    assert budget(sources, 1) == pytest.approx({"own": 0.2, "shared": 0.3})
