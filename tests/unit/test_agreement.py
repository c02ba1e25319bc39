from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy import stats

from imclab.agreement import agreement, bland_altman, chi_square_of, judged, pixel_area, pooled_area
from tests.unit.report import made_up

# Two conditions with their own errors, and one that both share: an off-diagonal covariance.
COVARIANCE = np.array([[0.02**2 + 0.03**2, 0.03**2], [0.03**2, 0.01**2 + 0.03**2]])


def drawn_errors(count: int) -> np.ndarray:
    return np.random.default_rng(3).multivariate_normal(np.zeros(2), COVARIANCE, count)


def test_chi_square_is_the_quadratic_form_of_the_inverse_covariance() -> None:
    error = np.array([0.05, -0.02])
    value, freedom = chi_square_of(error, COVARIANCE)
    assert value == pytest.approx(float(error @ np.linalg.inv(COVARIANCE) @ error), rel=1e-10)
    assert freedom == 2


def test_chi_square_follows_its_law_only_with_the_full_covariance() -> None:
    errors = drawn_errors(600)
    full = [chi_square_of(error, COVARIANCE)[0] for error in errors]
    bars_alone = [chi_square_of(error, np.diag(np.diag(COVARIANCE)))[0] for error in errors]
    assert stats.kstest(full, stats.chi2(2).cdf).pvalue > 0.01
    assert stats.kstest(bars_alone, stats.chi2(2).cdf).pvalue < 1e-3  # independent bars: rejected


def test_chi_square_leaves_out_directions_without_uncertainty() -> None:
    shared = np.outer([0.02, 0.04], [0.02, 0.04])  # one common error and nothing else
    value, freedom = chi_square_of([0.02, 0.04], shared)
    assert freedom == 1
    assert value == pytest.approx(1.0)
    assert chi_square_of([0.1], [[0.0]])[1] == 0


def test_pooled_area_equals_the_integral_on_a_grid() -> None:
    error, stderr = np.array([0.01, -0.03, 0.002, 0.05]), np.array([0.02, 0.02, 0.01, 0.03])
    points = stats.norm.cdf(error / stderr)
    grid = (np.arange(200_000) + 0.5) / 200_000
    empirical = (points[:, None] <= grid).mean(axis=0)
    assert float(pooled_area(error, stderr)) == pytest.approx(np.abs(empirical - grid).mean(), abs=1e-5)


def test_pooled_area_is_small_for_honest_errors_and_large_for_understated_ones() -> None:
    noise = np.random.default_rng(1).normal(0.0, 0.02, 400)
    honest = float(pooled_area(noise, np.full(400, 0.02)))
    understated = float(pooled_area(noise, np.full(400, 0.005)))
    assert honest < 0.06  # the 99.9 % quantile for 400 points
    assert understated > 0.15
    assert np.isnan(pooled_area([0.1], [0.0]))


def test_probability_of_all_takes_common_errors_into_account() -> None:
    """With one common error the probability of all is that of the worst; independent, their product."""
    made = made_up.comparison(errors=(0.0, 0.28, 0.28))
    rows = [index for index, outcome in enumerate(made.outcomes) if outcome in judged(made)]
    outcomes = tuple(
        dataclasses.replace(
            outcome, error=dataclasses.replace(outcome.error, value=0.0 if i not in rows else 0.28)
        )
        for i, outcome in enumerate(made.outcomes)
    )
    common, apart = np.zeros((6, 6)), np.zeros((6, 6))
    common[np.ix_(rows, rows)] = 0.03**2
    apart[rows, rows] = 0.03**2
    single = stats.norm.cdf((0.30 - 0.28) / 0.03) - stats.norm.cdf((-0.30 - 0.28) / 0.03)
    for covariance, expected in ((common, single), (apart, single**4)):
        found = agreement(dataclasses.replace(made, outcomes=outcomes, covariance=covariance))
        assert found.probability_all == pytest.approx(expected, abs=4 * 0.5 / np.sqrt(20_000))
        assert found.share_inside == 1.0
    assert abs(single - single**4) > 0.1  # so the two cannot be mistaken for each other


def test_worst_point_and_shares() -> None:
    found = agreement(made_up.comparison(errors=(0.0, 0.03, -0.42)))
    assert found.worst == "diver-1.42"
    assert found.worst_error.value == pytest.approx(-0.42)
    assert found.share_inside == 0.5
    assert found.worst_bound_95 > 0.42
    assert found.probability_each[0] > 0.99
    assert found.probability_each[1] < 0.01


def test_the_same_seed_gives_the_same_numbers() -> None:
    made = made_up.comparison()
    assert agreement(made).probability_all == agreement(made).probability_all


def test_only_reference_conditions_leave_nothing_to_judge() -> None:
    made = made_up.comparison()
    alone = dataclasses.replace(made, outcomes=made.outcomes[:1], covariance=np.zeros((1, 1)))
    found = agreement(alone)
    assert found.conditions == ()
    assert np.isnan(found.share_inside)
    assert np.isnan(found.reduced_chi_square)
    assert found.worst == ""


def test_bland_altman_is_what_the_paper_defines() -> None:
    simulated, measured = np.array([0.4, 0.2, 0.11]), np.array([0.41, 0.19, 0.1])
    found = bland_altman(simulated, measured)
    difference = 2 * (simulated - measured) / (simulated + measured)
    assert found.difference == pytest.approx(difference)
    assert found.bias.value == pytest.approx(difference.mean())
    spread = np.sqrt(((difference - difference.mean()) ** 2).sum() / 2)
    assert found.upper - found.lower == pytest.approx(2 * 1.959964 * spread, rel=1e-6)
    slope = np.polyfit(np.log10((simulated + measured) / 2), difference, 1)[0]
    assert found.trend.value == pytest.approx(slope)


@pytest.mark.parametrize("count", [0, 1, 2])
def test_bland_altman_says_nothing_that_few_points_cannot_tell(count: int) -> None:
    found = bland_altman(np.full(count, 0.4), np.full(count, 0.38))
    assert np.isnan(found.trend.value)
    assert np.isfinite(found.upper) == (count == 2)


def test_pixel_area_measures_a_gain_and_is_blind_to_place() -> None:
    pair = made_up.comparison(size=64).outcomes[0].pair
    rolled = dataclasses.replace(pair, simulated=np.rot90(pair.measured), region=np.ones((64, 64), bool))
    rolled = dataclasses.replace(
        rolled, measured=np.nan_to_num(pair.measured), simulated=np.nan_to_num(rolled.simulated)
    )
    assert pixel_area(rolled) == pytest.approx(0.0, abs=1e-12)
    brighter = dataclasses.replace(rolled, simulated=1.1 * rolled.measured)
    assert pixel_area(brighter) == pytest.approx(0.1, rel=0.02)
