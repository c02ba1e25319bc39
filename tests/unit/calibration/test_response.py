"""The joint fit on numbers with a known truth: accuracy, intervals, monotony."""

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from calibration.curve import Response
from calibration.gain import fit_law
from calibration.levels import Levels
from calibration.response import JointFit, fit_jointly

FULL = 4095.0


def levels(true: np.ndarray, *, error: float, rng: np.random.Generator, wiggle: float = 0.0) -> Levels:
    counts = FULL * (1.0 - np.exp(-2.0 * true)) + 0.02 * rng.standard_normal(true.size)
    stated = true * np.exp(error * rng.standard_normal(true.size))
    return Levels(
        counts=np.asarray(counts * (1.0 + wiggle * rng.standard_normal(true.size))),
        counts_stderr=np.full(true.size, 0.02),
        shot_variance=np.zeros(true.size),
        setting=np.zeros(true.size, np.intp),
        level=np.arange(true.size),
        log_energy=np.log(stated),
        gains=(1.0,),
        reference=0,
        saturation=FULL,
    )


def inverse(fit: JointFit, counts: np.ndarray) -> np.ndarray:
    return np.asarray(PchipInterpolator(fit.log_counts, fit.log_exposure)(np.log(counts)))


def test_sixteen_levels_of_a_one_percent_source_give_one_percent() -> None:
    """Rationale: the aim of the calibration. Six seeds; also the stated interval must hold the truth."""
    true = np.geomspace(0.01, 1.3, 16)
    counts = np.linspace(0.05, 0.88, 60) * FULL
    exact = np.log(-np.log1p(-counts / FULL) / 2.0)
    errors, held = [], []
    for seed in range(6):
        fit = fit_jointly(levels(true, error=0.01, rng=np.random.default_rng(seed)))
        rest = inverse(fit, counts) - exact
        spread = np.interp(
            np.log(counts), fit.log_counts, np.sqrt(np.diag(fit.covariance))[: fit.log_counts.size]
        )
        errors.append(np.sqrt(np.mean(rest**2)))
        held.append(np.abs(rest) < 1.96 * spread)
    assert np.mean(errors) < 0.01
    assert 0.85 < np.mean(held) <= 1.0
    assert np.mean(np.abs(rest) < 0.2 * spread) < 0.8  # power: a fifth of the stated error would not hold


def test_the_curve_always_rises() -> None:
    for seed in range(4):
        true = np.geomspace(0.05, 1.0, 8)
        fit = fit_jointly(levels(true, error=0.2, rng=np.random.default_rng(seed), wiggle=0.1))
        assert np.all(np.diff(fit.log_exposure) > 0.0)


def test_exact_levels_are_met() -> None:
    true = np.geomspace(0.01, 1.3, 24)
    fit = fit_jointly(levels(true, error=0.0, rng=np.random.default_rng(1)))
    assert np.max(np.abs(inverse(fit, FULL * (1.0 - np.exp(-2.0 * true[3:-1]))) - np.log(true[3:-1]))) < 2e-3


def test_table_is_its_own_inverse_and_ends_where_the_levels_end() -> None:
    fit = fit_jointly(levels(np.geomspace(0.01, 1.0, 16), error=0.0, rng=np.random.default_rng(2)))
    response = Response(fit.log_counts, fit.log_exposure, float(np.exp(fit.log_counts[-1])) + 40.0)
    counts = np.array([5.0, 60.0, 1000.0, 3000.0, response.limit - 1.0])
    assert np.allclose(response.counts(response.exposure(counts)), counts, rtol=1e-10)
    assert np.isnan(response.exposure(np.array([response.limit + 1.0])))[0]
    assert response.exposure(np.array([0.0]))[0] == 0.0 and response.exposure(np.array([-3.0]))[0] < 0.0


@pytest.mark.parametrize(
    ("name", "true"), [("exponential", lambda v: 0.02 * v), ("power", lambda v: 9.0 * np.log(v))]
)
def test_the_right_law_is_found_and_a_crooked_series_is_not_supported(name: str, true: object) -> None:
    settings = np.linspace(500.0, 1000.0, 8)
    log_gain = true(settings)  # type: ignore[operator]
    covariance = 1e-6 * np.eye(8)
    noise = 1e-3 * np.random.default_rng(1).standard_normal(8)
    law = fit_law(settings, log_gain - log_gain[0] + noise, covariance)
    assert law is not None and law.name == name and law.supported and law.probability > 1e-3
    crooked = log_gain + 0.2 * (-1.0) ** np.arange(8)
    other = fit_law(settings, crooked, covariance)
    assert other is not None and not other.supported and other.probability < 1e-6
