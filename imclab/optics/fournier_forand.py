"""The phase function of Fournier and Forand: a power law of sizes in anomalous diffraction.

Symbols: n relative index; slope of the number of particles against size; ``q = sin(theta / 2)**2``,
which is half of ``s = 1 - mu``; ``nu = (3 - slope) / 2``; ``delta = 4 q / (3 (n - 1)**2)``. Formulas
after Fournier & Jonasz 1999 (SPIE 3761, 62) and Mobley, Sundman & Boss 2002 (Appl. Opt. 41, 1035).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from imclab.optics.limits import check
from imclab.optics.phase_function import PhaseFunction

Array = NDArray[np.float64]

_SERIES_TERMS = 24
_SERIES_WITHIN = 0.2  # 0.2**22 is below the rounding of the terms that are kept


@dataclass(frozen=True)
class FournierForand(PhaseFunction):
    """Fournier and Forand's phase function.

    Parameters
    ----------
    index : float
        Real refractive index of the particles relative to the water, above 1 and at most 1.5. The
        defaults are those that Mobley et al. 2002 find nearest to Petzold's average particle.
    slope : float
        Slope of the power law of the particle sizes, above 3 and below 5.
    """

    index: float = 1.10
    slope: float = 3.5835

    def __post_init__(self) -> None:
        check("index", self.index, 1.0, 1.5, unit="(relative to the water)", open_low=True)
        check("slope", self.slope, 3.001, 4.999)

    @property
    def _nu(self) -> float:
        return 0.5 * (3.0 - self.slope)

    def _delta(self, q: Array) -> Array:
        return np.asarray(4.0 * q / (3.0 * (self.index - 1.0) ** 2))

    @property
    def _backward_term(self) -> float:
        # (1 - delta180**nu) / ((delta180 - 1) delta180**nu); delta180 is above 5 for every index allowed.
        delta = float(self._delta(np.ones(1))[0])
        power = delta**self._nu
        return float((1.0 - power) / ((delta - 1.0) * power))

    def density(self, s: Array) -> Array:
        """Phase function in 1/sr at ``s = 1 - mu``; infinite at s = 0."""
        nu = self._nu
        q = np.maximum(0.5 * np.asarray(s, dtype=np.float64), 1e-60)
        delta = self._delta(q)
        h = delta - 1.0
        near = np.abs(h) < _SERIES_WITHIN
        away = np.where(near, 1.0, h)
        one_minus_power = -np.expm1(nu * np.log(delta))
        # A = nu (1 - delta) - (1 - delta**nu) and B = delta (1 - delta**nu) - nu (1 - delta) vanish like
        # h**2 at delta = 1; there their binomial series are used.
        a = np.where(near, _second_order(nu, h), (-nu * away - one_minus_power) / away**2)
        b = np.where(near, -_second_order(nu + 1.0, h), (delta * one_minus_power + nu * away) / away**2)
        cosine_square = (1.0 - 2.0 * q) ** 2
        return np.asarray(
            (a + b / q) / (4.0 * np.pi * delta**nu)
            + self._backward_term * (3.0 * cosine_square - 1.0) / (16.0 * np.pi)
        )

    def forward_probability(self, s: Array) -> Array:
        """Probability of ``1 - mu'`` at most s."""
        nu = self._nu
        q = np.maximum(0.5 * np.asarray(s, dtype=np.float64), 1e-60)
        log_delta = np.log(self._delta(q))
        # (1 - delta**(nu+1)) / (1 - delta) and (1 - delta**nu) / (1 - delta), smooth at delta = 1.
        one = _ratio(nu + 1.0, log_delta)
        two = _ratio(nu, log_delta)
        value = (one - two * q) * np.exp(-nu * log_delta)
        return np.asarray(value + 0.5 * self._backward_term * (1.0 - 2.0 * q) * q * (1.0 - q))

    def backward_probability(self, r: Array) -> Array:
        """Probability of ``1 + mu'`` at most r."""
        return np.asarray(1.0 - self.forward_probability(2.0 - np.asarray(r, dtype=np.float64)))


def _ratio(power: float, logarithm: Array) -> Array:
    """``(1 - d**power) / (1 - d)`` for ``d = exp(logarithm)``, without cancellation at d = 1."""
    away = np.where(logarithm == 0.0, 1.0, logarithm)
    return np.where(logarithm == 0.0, power, np.expm1(power * away) / np.expm1(away))


def _second_order(power: float, h: Array) -> Array:
    """``((1 + h)**power - 1 - power h) / h**2`` by its binomial series."""
    coefficient = 0.5 * power * (power - 1.0)
    small = np.clip(h, -_SERIES_WITHIN, _SERIES_WITHIN)
    total = np.zeros_like(small)
    term = np.ones_like(small)
    for k in range(2, _SERIES_TERMS):
        total += coefficient * term
        term = term * small
        coefficient *= (power - k) / (k + 1.0)
    return total
