from __future__ import annotations

import math

import numba
import numpy as np
import pytest

from imclab.optics import phase
from imclab.transport import scattering
from tests import judging, oracles_transport


@numba.njit
def _deviations(law, u):
    values = np.empty(u.size)
    for i in range(u.size):
        values[i] = scattering.sample_deviation(law, u[i])
    return values


@numba.njit
def _densities(law, deviations):
    values = np.empty(deviations.size)
    for i in range(deviations.size):
        values[i] = scattering.phase_density(law, deviations[i])
    return values


@numba.njit
def _turned(directions, deviation, azimuth):
    turned = np.empty_like(directions)
    for i in range(len(directions)):
        d = directions[i]
        turned[i] = scattering.turn((d[0], d[1], d[2]), deviation, math.sin(azimuth[i]), math.cos(azimuth[i]))
    return turned


@numba.njit
def _wander(count):
    direction = (0.0, 0.0, 1.0)
    for i in range(count):
        direction = scattering.turn(direction, 1.0 + 0.9 * math.sin(i), math.sin(0.7 * i), math.cos(0.7 * i))
    return direction


@pytest.mark.parametrize("g", [-0.95, -0.3, 0.0, 1e-9, 0.6, 0.924, 0.99])
def test_closed_form_equals_the_textbook(g: float) -> None:
    u = np.random.default_rng(1).uniform(0, 1, 2000)
    literal = np.array([1.0 - oracles_transport.henyey_greenstein_cosine(g, value) for value in u])
    mine = _deviations(scattering.HenyeyGreensteinLaw(g), u)
    if abs(g) > 1e-6:  # the textbook's own formula loses its digits toward g = 0
        np.testing.assert_allclose(mine, literal, rtol=1e-9, atol=1e-13)
    np.testing.assert_allclose(mine, phase.HenyeyGreenstein(g).sample_one_minus_mu(1.0 - u), rtol=1e-9)


@pytest.mark.parametrize("g", [1.0, -1.0, 0.9999, -0.9999])
def test_closed_form_at_the_ends(g: float) -> None:
    u = np.array([2.0**-33, 0.5, 1.0 - 2.0**-33])
    values = _deviations(scattering.HenyeyGreensteinLaw(g), u)
    assert np.isfinite(values).all()
    assert ((values >= 0.0) & (values <= 2.0)).all()
    if abs(g) == 1.0:
        np.testing.assert_allclose(values, 1.0 - g, atol=1e-12)


@pytest.mark.parametrize("law", [phase.HenyeyGreenstein(0.8), phase.FournierForand(), phase.Rayleigh(0.039)])
def test_samples_follow_the_density(law: phase.PhaseFunction) -> None:
    table = law.table()
    samples = _deviations(table, np.random.default_rng(2).uniform(0, 1, 400_000))
    edges = np.concatenate(([0.0], np.geomspace(1e-5, 2.0, 40)))
    expected = np.diff(law.cdf(1.0 - edges[::-1]))[::-1] * samples.size
    counts = np.histogram(samples, edges)[0]
    assert not judging.reject_chi2(counts, expected)
    assert judging.reject_chi2(np.histogram(1.05 * samples, edges)[0], expected)
    middle = np.array([0.01, 0.3, 1.0, 1.9])
    np.testing.assert_allclose(_densities(table, middle), law.evaluate(1.0 - middle), rtol=0.02)


@pytest.mark.parametrize("g", [-0.9, 0.0, 0.924])
def test_closed_form_density_is_that_of_the_optics(g: float) -> None:
    deviations = np.array([0.0, 1e-6, 0.1, 1.0, 2.0])
    np.testing.assert_allclose(
        _densities(scattering.HenyeyGreensteinLaw(g), deviations),
        phase.HenyeyGreenstein(g).density(deviations),
        rtol=1e-12,
    )


def test_turning_keeps_the_angle_and_spreads_the_azimuth() -> None:
    rng = np.random.default_rng(3)
    directions = rng.standard_normal((2000, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    directions[:6] = [(0, 0, 1), (0, 0, -1), (1, 0, 0), (0, 1, 0), (-1, 0, 0), (1e-9, 0, -1)]
    azimuth = rng.uniform(0, 2 * np.pi, 2000)
    turned = _turned(directions, 0.3, azimuth)
    np.testing.assert_allclose(np.sum(directions * turned, axis=1), 0.7, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(turned, axis=1), 1.0, atol=1e-12)
    one = np.tile([0.6, 0.0, 0.8], (2000, 1))
    mean = _turned(one, 0.3, np.linspace(0, 2 * np.pi, 2000, endpoint=False)).mean(axis=0)
    np.testing.assert_allclose(mean, 0.7 * one[0], atol=1e-12)
    literal = oracles_transport.turn_by_equation_19(one[0], 0.3, 1.0)
    assert literal @ one[0] == pytest.approx(0.7)


def test_ten_thousand_turns_keep_the_length() -> None:
    assert np.linalg.norm(_wander(10_000)) == pytest.approx(1.0, abs=1e-12)
