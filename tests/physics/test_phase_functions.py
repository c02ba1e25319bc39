"""Every phase function: normalised, sampled as it is evaluated, with the moments that it states."""

from __future__ import annotations

import numba
import numpy as np
import pytest
from scipy import stats

from imclab.optics import phase
from imclab.optics.size_distribution import LogNormal
from imclab.transport import phase_sampling

DRAWS = 1_000_000


def powder() -> phase.Mie:
    diameters, shares = LogNormal(3e-6, 1.1, count=401).nodes()
    return phase.Mie(np.pi * diameters * 1.3354 / 532e-9, 1.19, shares)


PHASES = {
    "isotropic": phase.Isotropic(),
    "rayleigh": phase.Rayleigh(),
    "water": phase.Rayleigh(0.039),
    "hg": phase.HenyeyGreenstein(0.924),
    "hg-backward": phase.HenyeyGreenstein(-0.7),
    "hg-flat": phase.HenyeyGreenstein(0.0),
    "hg-steep": phase.HenyeyGreenstein(0.9999),
    "two-term": phase.TwoTermHenyeyGreenstein(0.93, -0.4, 0.97),
    "fournier-forand": phase.FournierForand(),
    "fournier-forand-steep": phase.FournierForand(1.3, 4.9),
    "petzold": phase.petzold(),
    "mie": phase.Mie(23.6, 1.19),
    "mie-large": phase.Mie(200.0, 1.59 - 0.001j),
    "powder": powder(),
    "mixture": phase.Mixture((phase.Mie(23.6, 1.19), phase.Rayleigh(0.039)), (3.0, 1.0)),
}


@pytest.fixture(params=PHASES, scope="module")
def case(request: pytest.FixtureRequest) -> phase.PhaseFunction:
    return PHASES[request.param]


@numba.njit
def draw_with_the_kernel(table, u: np.ndarray) -> np.ndarray:
    out = np.empty(u.size)
    for i in range(u.size):
        out[i] = phase_sampling.sample(table, u[i])
    return out


@numba.njit
def evaluate_with_the_kernel(table, s: np.ndarray) -> np.ndarray:
    out = np.empty(s.size)
    for i in range(s.size):
        out[i] = phase_sampling.evaluate(table, s[i])
    return out


def bins_of_equal_probability(function: phase.PhaseFunction, count: int) -> np.ndarray:
    """Edges in s = 1 - mu, among the edges of the table, as near as they allow to equal shares."""
    table = function.table()
    return np.unique(table.edges[np.searchsorted(table.cumulative, np.linspace(0, 1, count + 1)[1:-1])])


def chi_square(function: phase.PhaseFunction, s: np.ndarray) -> float:
    """p-value of the draws against the probabilities that the density itself integrates to."""
    inner = bins_of_equal_probability(function, 200)
    below = np.where(
        inner <= 1, function.forward_probability(inner), 1 - function.backward_probability(2 - inner)
    )
    expected = np.diff(np.concatenate(([0.0], below, [1.0]))) * s.size
    found = np.bincount(np.searchsorted(inner, s, side="right"), minlength=expected.size)
    return float(stats.chisquare(found, expected * (s.size / expected.sum())).pvalue)


def test_density_is_the_slope_of_the_cumulative_probability(case: phase.PhaseFunction) -> None:
    nodes, weights = np.polynomial.legendre.leggauss(64)
    for low, high in ((0.003, 0.0031), (0.1, 0.11), (0.9, 0.95), (1.2, 1.25), (1.97, 1.98)):
        s = low + (high - low) * (1 + nodes) / 2
        integral = 2 * np.pi * (high - low) / 2 * weights @ case.density(s)
        found = np.diff(case.forward_probability(np.array([low, high])))[0]
        assert found == pytest.approx(integral, rel=1e-6, abs=1e-13)  # tables have kinks


def test_probabilities_meet_and_fill_the_sphere(case: phase.PhaseFunction) -> None:
    s = np.array([0.0, 0.3, 1.0, 1.7, 2.0])
    together = case.forward_probability(s) + case.backward_probability(2 - s)
    assert together == pytest.approx(np.ones(5), abs=1e-12)
    assert case.cdf([-1.0, 1.0]) == pytest.approx([0.0, 1.0], abs=1e-12)
    assert np.all(np.diff(case.cdf(np.linspace(-1, 1, 999))) >= -1e-14)
    assert case.cdf(0.0) == pytest.approx(case.backscatter_fraction, abs=1e-12)


def test_table_keeps_the_moments(case: phase.PhaseFunction) -> None:
    table = case.table()
    assert table.asymmetry == pytest.approx(case.asymmetry, abs=2e-7)
    assert table.second_moment == pytest.approx(case.second_moment, abs=4e-7)
    back = np.interp(1.0, table.edges, table.cumulative)
    assert 1 - back == pytest.approx(case.backscatter_fraction, rel=1e-6)


def test_kernel_and_inverse_draw_from_the_density(case: phase.PhaseFunction) -> None:
    drawn = draw_with_the_kernel(case.table(), np.random.default_rng(12).random(DRAWS))
    assert chi_square(case, drawn) > 1e-4
    assert chi_square(case, 1.0 - case.sample(np.random.default_rng(3).random(DRAWS))) > 1e-4
    deviation = np.std(1 - drawn) / np.sqrt(DRAWS)
    assert abs(np.mean(1 - drawn) - case.asymmetry) < 4.5 * deviation + 2e-7


def test_chi_square_rejects_a_sampler_of_even_steps_in_mu() -> None:
    """The power partner: 2000 even steps in mu, as is common, cannot hold a forward peak."""
    function = PHASES["hg"]
    edges = np.linspace(-1.0, 1.0, 2001)
    uniform = np.random.default_rng(5).random(DRAWS)
    assert chi_square(function, 1.0 - np.interp(uniform, function.cdf(edges), edges)) < 1e-12
    assert chi_square(function, 1.0 - phase.HenyeyGreenstein(0.922).sample(uniform)) < 1e-4


def test_kernel_evaluates_what_it_samples(case: phase.PhaseFunction) -> None:
    table = case.table()
    middle = 0.5 * (table.edges[1:] + table.edges[:-1])
    assert np.array_equal(evaluate_with_the_kernel(table, middle), table.density)
    assert np.array_equal(table.evaluate(middle), table.density)
    # The alias rows give back the probability of every cell.
    threshold, start, _, other, other_slope = table.alias.T
    own = np.searchsorted(table.edges, start + 1e-9 * np.diff(table.edges), side="right") - 1
    inside = other + other_slope * 0.5 * (1.0 + threshold)  # the middle of the part above the threshold
    partner = np.clip(np.searchsorted(table.edges, inside, side="right") - 1, 0, threshold.size - 1)
    share = np.bincount(own, threshold, threshold.size) + np.bincount(partner, 1 - threshold, threshold.size)
    assert share / threshold.size == pytest.approx(table.probabilities, rel=1e-6, abs=1e-15)


def test_forward_peaks_are_resolved_below_a_hundredth_of_a_degree(case: phase.PhaseFunction) -> None:
    table = case.table()
    for degrees in (0.01, 0.1, 1.0):
        s = 2 * np.sin(np.radians(degrees) / 2) ** 2
        true = float(case.forward_probability(np.array([s]))[0])
        assert np.interp(s, table.edges, table.cumulative) == pytest.approx(true, rel=2e-3, abs=1e-13)
    within = 2 * np.sin(np.radians(1.0) / 2) ** 2
    drawn = draw_with_the_kernel(table, np.random.default_rng(4).random(DRAWS))
    true = float(case.forward_probability(np.array([within]))[0])
    expected_error = np.sqrt(true * (1 - true) / DRAWS)
    assert abs(np.mean(drawn <= within) - true) < 4.5 * expected_error + 1e-6


@pytest.mark.parametrize("x", [24.0, 200.0, 2000.0])
def test_tables_of_single_spheres(x: float) -> None:
    function = phase.Mie(x, 1.2)
    table = function.table()
    assert table.asymmetry == pytest.approx(function.asymmetry, abs=1e-6)
    glory = 2 * np.sin(np.radians(1.0) / 2) ** 2
    true = float(function.backward_probability(np.array([glory]))[0])
    assert 1 - np.interp(2 - glory, table.edges, table.cumulative) == pytest.approx(true, rel=0.01)


@pytest.mark.parametrize("g", [-1.0, -0.9999, -0.5, 0.0, 0.5, 0.9999, 1.0])
def test_henyey_greenstein_to_the_ends_of_its_range(g: float) -> None:
    function = phase.HenyeyGreenstein(g)
    u = np.concatenate(([0.0, 1e-300, 1e-17], np.linspace(0.001, 0.999, 999), [1.0]))
    s = function.sample_one_minus_mu(u)
    assert np.all((s >= 0) & (s <= 2))
    if abs(g) < 1:
        assert function.cdf(function.sample(u)) == pytest.approx(u, abs=1e-7)  # mu near -1 holds 1e-16
    assert function.table().asymmetry == pytest.approx(g, abs=2e-7)


def test_petzold_integrates_to_what_he_printed() -> None:
    printed = {"AUTEC_8": (0.037, 0.044), "HAOCE_11": (0.219, 0.013), "NUC_2040": (1.824, 0.020)}
    for station, (scattering, backward) in printed.items():
        function = phase.petzold(station)
        assert function.scale == pytest.approx(scattering, rel=0.012)
        assert function.backscatter_fraction == pytest.approx(backward, abs=0.0005)
    assert phase.petzold().asymmetry == pytest.approx(0.9241152, abs=1e-6)


def test_mobleys_fournier_forand_has_petzolds_backscatter() -> None:
    """Mobley, Sundman & Boss 2002: n = 1.10 and slope 3.5835 have the backscatter fraction 0.0183."""
    assert phase.FournierForand(1.10, 3.5835).backscatter_fraction == pytest.approx(0.0183, abs=5e-5)
    near_one = phase.FournierForand(1.1, 3.5835)
    s = 1.5 * 0.01 * (1 + np.array([-1e-9, 0.0, 1e-9]))  # delta = 1, where the formula is 0/0
    assert near_one.density(s)[1] == pytest.approx(near_one.density(s)[0], rel=1e-6)
