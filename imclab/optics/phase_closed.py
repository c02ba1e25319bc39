"""Phase functions with a closed form and an exact inverse: isotropic, Henyey-Greenstein, Rayleigh.

Symbols: g asymmetry (mean cosine), ``s = 1 - mu``, ``r = 1 + mu``, ``v = 1 - u`` of a uniform number u.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imclab.optics.limits import check
from imclab.optics.phase_function import PhaseFunction, uniform_numbers

Array = NDArray[np.float64]

_TINY = 1e-100  # its cube is still a number


@dataclass(frozen=True)
class Isotropic(PhaseFunction):
    """The same in every direction: ``1 / (4 pi)``."""

    def density(self, s: Array) -> Array:
        """Phase function in 1/sr at ``s = 1 - mu``."""
        return np.full(np.shape(s), 0.25 / np.pi)

    def forward_probability(self, s: Array) -> Array:
        """Probability of ``1 - mu'`` at most s."""
        return 0.5 * s

    def backward_probability(self, r: Array) -> Array:
        """Probability of ``1 + mu'`` at most r."""
        return 0.5 * r

    def sample_one_minus_mu(self, u: ArrayLike) -> Array:
        """Return ``1 - mu`` for every uniform number u; exact."""
        return 2.0 * (1.0 - uniform_numbers(u))


@dataclass(frozen=True)
class HenyeyGreenstein(PhaseFunction):
    """Henyey and Greenstein's phase function (1941), eq. 2 of their paper.

    Parameters
    ----------
    g : float
        Asymmetry, -1 to 1. At exactly 1 or -1 all light keeps or reverses its direction.
    """

    g: float

    def __post_init__(self) -> None:
        check("g", self.g, -1.0, 1.0)

    def density(self, s: Array) -> Array:
        """Phase function in 1/sr at ``s = 1 - mu``."""
        if abs(self.g) == 1.0:
            return np.where(np.asarray(s) == 1.0 - self.g, np.inf, 0.0)
        return np.asarray((1.0 - self.g) * (1.0 + self.g) / (4.0 * np.pi * _distance(self.g, s) ** 3))

    def forward_probability(self, s: Array) -> Array:
        """Probability of ``1 - mu'`` at most s."""
        return _probability_within(s, self.g)

    def backward_probability(self, r: Array) -> Array:
        """Probability of ``1 + mu'`` at most r."""
        return _probability_within(r, -self.g)

    def sample_one_minus_mu(self, u: ArrayLike) -> Array:
        """Return ``1 - mu`` for every uniform number u; the exact inverse of the cumulative probability."""
        g, v = self.g, 1.0 - uniform_numbers(u)
        if abs(g) == 1.0:
            return np.full(v.shape, 1.0 - g)
        d = 1.0 + g - 2.0 * g * v
        return np.asarray(np.minimum((1.0 - g) ** 2 * v * (1.0 + g + d) / (d * d), 2.0))

    @property
    def asymmetry(self) -> float:
        """Mean cosine of the scattering angle: g."""
        return self.g

    @property
    def second_moment(self) -> float:
        """Mean of P2: g squared."""
        return self.g**2


def _distance(g: float, s: Array) -> Array:
    """``sqrt(1 + g**2 - 2 g mu)`` at ``s = 1 - mu``, without cancellation for either sign of g."""
    square = (1.0 - g) ** 2 + 2.0 * g * s if g >= 0.0 else (1.0 + g) ** 2 - 2.0 * g * (2.0 - s)
    return np.maximum(np.sqrt(square), _TINY)


def _probability_within(s: Array, g: float) -> Array:
    """``(1 - g**2) / (2 g) (1 / (1 - g) - 1 / w)``, w the `_distance`, freed from cancellation."""
    if g == 1.0:
        return np.where(np.asarray(s) > 0.0, 1.0, 0.0)
    w = _distance(g, s)
    return np.asarray((1.0 + g) * s / (w * (w + 1.0 - g)))


@dataclass(frozen=True)
class Rayleigh(PhaseFunction):
    """Scattering by what is much smaller than the wavelength, and by pure water.

    ``p = (1 + f mu^2) / (4 pi (1 + f / 3))`` with ``f = (1 - d) / (1 + d)`` (Zhang, Hu & He 2009).

    Parameters
    ----------
    depolarisation : float
        Depolarisation ratio d at 90 degrees, 0 to 1; pure water has 0.039.
    """

    depolarisation: float = 0.0

    def __post_init__(self) -> None:
        check("depolarisation", self.depolarisation, 0.0, 1.0)

    @property
    def _f(self) -> float:
        return (1.0 - self.depolarisation) / (1.0 + self.depolarisation)

    def density(self, s: Array) -> Array:
        """Phase function in 1/sr at ``s = 1 - mu``."""
        return np.asarray((1.0 + self._f * (1.0 - s) ** 2) / (4.0 * np.pi * (1.0 + self._f / 3.0)))

    def forward_probability(self, s: Array) -> Array:
        """Probability of ``1 - mu'`` at most s."""
        f = self._f
        return np.asarray(s * (1.0 + f * (1.0 - s + s * s / 3.0)) / (2.0 * (1.0 + f / 3.0)))

    def backward_probability(self, r: Array) -> Array:
        """Probability of ``1 + mu'`` at most r: the same, by symmetry."""
        return self.forward_probability(r)

    def sample_one_minus_mu(self, u: ArrayLike) -> Array:
        """Return ``1 - mu`` for every uniform number u; the exact inverse (Cardano's hyperbolic form)."""
        f = self._f
        if f < 1e-12:
            return 2.0 * (1.0 - uniform_numbers(u))
        c = (2.0 * uniform_numbers(u) - 1.0) * (1.0 + f / 3.0)
        root = np.sqrt(f)
        return np.asarray(np.clip(1.0 - 2.0 / root * np.sinh(np.arcsinh(1.5 * c * root) / 3.0), 0.0, 2.0))

    @property
    def asymmetry(self) -> float:
        """Mean cosine of the scattering angle: 0."""
        return 0.0

    @property
    def second_moment(self) -> float:
        """Mean of P2."""
        return 2.0 * self._f / (15.0 * (1.0 + self._f / 3.0))
