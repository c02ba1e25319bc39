from __future__ import annotations

import numpy as np
import pytest

from imclab.transport.widths import pulse_fwhm, spot_fwhm

FWHM = 2.0 * np.sqrt(2.0 * np.log(2.0))


def rings(sigma: float, edges: np.ndarray) -> np.ndarray:
    inside = -np.expm1(-0.5 * (edges[:-1] / sigma) ** 2)
    outside = -np.expm1(-0.5 * (edges[1:] / sigma) ** 2)
    return np.asarray(outside - inside)


def test_spot_of_a_gaussian() -> None:
    edges = np.append(np.linspace(0.0, 0.1, 400), np.inf)
    for sigma in (0.002, 0.01, 0.025):
        # Bins of an eighth of the narrowest half width leave 0.1 %; a fit with a term less, 0.4 %.
        assert spot_fwhm(edges, rings(sigma, edges)) == pytest.approx(FWHM * sigma, rel=1e-3)


def test_a_narrow_peak_on_a_broad_ground_has_the_width_of_the_peak() -> None:
    edges = np.append(np.linspace(0.0, 0.1, 1000), np.inf)
    energy = 0.1 * rings(0.004, edges) + 0.9 * rings(0.05, edges)
    peak, ground = 0.1 / 0.004**2, 0.9 / 0.05**2

    def irradiance(r: float) -> float:
        return float(peak * np.exp(-0.5 * (r / 0.004) ** 2) + ground * np.exp(-0.5 * (r / 0.05) ** 2))

    width = spot_fwhm(edges, energy)
    assert irradiance(0.5 * width) == pytest.approx(0.5 * (peak + ground), rel=0.03)


def test_nothing_has_no_width() -> None:
    assert np.isnan(spot_fwhm(np.array([0.0, 1.0, 2.0, np.inf]), np.zeros(3)))
    assert np.isnan(pulse_fwhm(np.zeros(3), np.zeros(3), np.ones(3)))


def test_a_pulse_without_delay_keeps_its_width() -> None:
    width = pulse_fwhm(np.array([1e-9]), np.array([0.3]), np.array([2e-9]))
    assert width == pytest.approx(FWHM * 2e-9, rel=1e-4)


def test_even_delays_much_longer_than_the_pulse_give_their_own_length() -> None:
    delays = np.linspace(0.0, 1e-9, 400)
    width = pulse_fwhm(delays, np.ones(400), np.full(400, 1e-11))
    assert width == pytest.approx(1e-9, rel=0.01)


def test_normal_delays_add_in_squares() -> None:
    delays = np.linspace(-5e-9, 5e-9, 2001)
    weights = np.exp(-0.5 * (delays / 1e-9) ** 2)
    width = pulse_fwhm(delays, weights, np.full(2001, 2e-9))
    assert width == pytest.approx(FWHM * np.sqrt(5.0) * 1e-9, rel=1e-4)
