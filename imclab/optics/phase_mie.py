"""The phase function of spheres, of one size or of many, as an exact polynomial.

``|S1|**2 + |S2|**2`` of a sphere with N coefficients is a polynomial of degree 2 N in mu. Its values
at the 2 N + 1 Chebyshev points therefore hold all of it, also summed over thousands of sizes: what
would be a sum over sizes at each of 1e5 angles becomes one over a few hundred, and the moments and
the cumulative probability are closed expressions of the Chebyshev coefficients.

Symbols: x size parameter, m relative index n - ik, c_l Chebyshev coefficients of the phase function.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imclab.optics.limits import check, refuse
from imclab.optics.phase_function import PhaseFunction
from imclab.optics.phase_table import DEFAULT_CELLS, PhaseTable, from_density

Array = NDArray[np.float64]

LARGEST_X_OF_ONE, LARGEST_X_OF_MANY = 2e4, 2e3
_MOST_CELLS = 65536


@dataclass(frozen=True, eq=False)
class Mie(PhaseFunction):
    """Phase function of homogeneous spheres for unpolarised light.

    Parameters
    ----------
    x : float or array_like
        Size parameter, 1e-8 to 2e4, or those of a size distribution, to 2e3.
    m : complex
        Relative index n - ik (either sign of k), not 1.
    weights : array_like, optional
        Share of the number of particles of each size; equal when left out.

    Notes
    -----
    The natural table has 16 cells per unit of the largest size parameter, at least 4096, at most
    65536: some five or more across each lobe of the scattering pattern.
    """

    x: ArrayLike
    m: complex
    weights: ArrayLike | None = None

    def __post_init__(self) -> None:
        sizes = np.atleast_1d(np.array(self.x, dtype=np.float64)).ravel()
        shares = (
            np.ones(sizes.size) if self.weights is None else np.array(self.weights, dtype=np.float64).ravel()
        )
        if shares.size != sizes.size or not sizes.size:
            raise refuse("weights", f"{shares.size} for {sizes.size} sizes", "one for each size")
        largest = LARGEST_X_OF_ONE if sizes.size == 1 else LARGEST_X_OF_MANY
        check("x", sizes, 1e-8, largest, unit="(size parameter, for a phase function)")
        check("weights", shares, 0.0, 1e300)
        if shares.sum() == 0.0:
            raise refuse("weights", "only zeros", "at least one that is positive")
        if complex(self.m) == 1.0:
            raise refuse("m", "1", "an index that differs from that of the medium")
        shares /= shares.sum()
        for name, array in (("x", sizes), ("weights", shares)):
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    @cached_property
    def _efficiencies(self) -> Any:
        from imclab.optics.mie import efficiencies

        return efficiencies(self.x, self.m)

    @cached_property
    def _scattered(self) -> Array:
        """Share of the scattered light that comes from each size."""
        cross_section = np.asarray(self.weights) * np.asarray(self.x) ** 2 * self._efficiencies.scattering
        return np.asarray(cross_section / cross_section.sum())

    @cached_property
    def _series(self) -> Array:
        """Chebyshev coefficients c_l of the phase function in 1/sr."""
        from scipy.fft import dct

        from imclab.optics.mie import mean_intensity
        from imclab.optics.mie_kernels import number_of_terms

        degree = 2 * number_of_terms(float(np.max(self.x)))
        cosines = np.cos(np.pi * np.arange(degree + 1) / degree)
        cosines[0], cosines[-1] = 1.0, -1.0
        intensity = mean_intensity(self.x, self.m, cosines, weights=np.asarray(self.weights))
        total = np.sum(np.asarray(self.weights) * np.asarray(self.x) ** 2 * self._efficiencies.scattering)
        coefficients = dct(intensity / (2.0 * np.pi * total), type=1) / degree
        coefficients[[0, -1]] *= 0.5
        return np.asarray(coefficients)

    def density(self, s: Array) -> Array:
        """Phase function in 1/sr at ``s = 1 - mu``."""
        from imclab.optics.mie import phase_function
        from imclab.optics.mie_kernels import chebyshev_sum

        distance = np.asarray(s, dtype=np.float64)
        sizes = np.asarray(self.x)
        if sizes.size == 1:
            return phase_function(float(sizes[0]), self.m, 1.0 - distance)
        values = chebyshev_sum(self._series, np.ascontiguousarray(1.0 - distance).ravel())
        return np.asarray(values).reshape(distance.shape)

    @cached_property
    def _integral(self) -> Array:
        """Chebyshev coefficients of 2 pi times the integral of the phase function from mu = -1."""
        return np.asarray(np.polynomial.chebyshev.chebint(2.0 * np.pi * self._series, lbnd=-1.0))

    def forward_probability(self, s: Array) -> Array:
        """Probability of ``1 - mu'`` at most s, to 1e-14 absolutely."""
        return 1.0 - self.backward_probability(2.0 - np.asarray(s, dtype=np.float64))

    def backward_probability(self, r: Array) -> Array:
        """Probability of ``1 + mu'`` at most r, to 1e-14 absolutely."""
        from imclab.optics.mie_kernels import chebyshev_sum

        cosine = np.asarray(r, dtype=np.float64) - 1.0
        values = chebyshev_sum(self._integral, np.ascontiguousarray(cosine).ravel())
        return np.clip(np.asarray(values).reshape(cosine.shape), 0.0, 1.0)

    @property
    def asymmetry(self) -> float:
        """Mean cosine of the scattering angle, from the coefficients a_n and b_n."""
        return float(self._scattered @ np.atleast_1d(self._efficiencies.asymmetry))

    @cached_property
    def _second_moment(self) -> float:
        from numpy.polynomial import chebyshev

        weighted = chebyshev.chebmul(self._series, [0.25, 0.0, 0.75])  # P2 = T0/4 + 3 T2/4
        return float(2.0 * np.pi * chebyshev.chebval(1.0, chebyshev.chebint(weighted, lbnd=-1.0)))

    @property
    def second_moment(self) -> float:
        """Mean of P2."""
        return self._second_moment

    @property
    def natural_cells(self) -> int:
        """Number of cells that resolves the lobes of the largest sphere."""
        wanted = 1024 * int(np.ceil(16.0 * float(np.max(self.x)) / 1024.0))
        return int(np.clip(wanted, DEFAULT_CELLS, _MOST_CELLS))

    def _tabulate(self, cells: int) -> PhaseTable:
        return from_density(self.density, cells)
