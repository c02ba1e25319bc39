"""What every phase function can do: evaluate, cumulate, sample, moments, table.

A phase function ``p(mu)`` is in 1/sr with integral 1 over the sphere; ``mu`` is the cosine of the
scattering angle. Inside, everything is a function of ``s = 1 - mu`` and of its mirror
``r = 1 + mu``, because neither peak survives the rounding of ``mu``.

Symbols: F forward cumulative probability P(1 - mu' <= s); B backward
cumulative probability P(1 + mu' <= r); u uniform number.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imclab.optics.limits import check, refuse
from imclab.optics.phase_table import DEFAULT_CELLS, PhaseTable, cell_edges, from_probabilities, gauss_cells

Array = NDArray[np.float64]


class PhaseFunction(ABC):
    """What every phase function can do.

    A new kind gives ``density``, ``forward_probability`` and ``backward_probability``; the rest
    follows. Directions are cosines of the scattering angle in the public methods ``evaluate``, ``cdf``
    and ``sample``.
    """

    @abstractmethod
    def density(self, s: Array) -> Array:
        """Phase function in 1/sr at ``s = 1 - mu``."""

    @abstractmethod
    def forward_probability(self, s: Array) -> Array:
        """Probability of a scattering with ``1 - mu'`` at most s, exact for the smallest s."""

    @abstractmethod
    def backward_probability(self, r: Array) -> Array:
        """Probability of a scattering with ``1 + mu'`` at most r, exact for the smallest r."""

    def evaluate(self, mu: ArrayLike) -> Array:
        """Return the phase function in 1/sr at the cosines ``mu``, any shape."""
        return self.density(1.0 - _cosines(mu))

    def cdf(self, mu: ArrayLike) -> Array:
        """Return the probability that the cosine of the scattering angle is at most ``mu``."""
        cosine = _cosines(mu)
        backward = self.backward_probability(1.0 + np.minimum(cosine, 0.0))
        forward = self.forward_probability(1.0 - np.maximum(cosine, 0.0))
        return np.where(cosine < 0.0, backward, 1.0 - forward)

    def sample(self, u: ArrayLike) -> Array:
        """Return a cosine for every uniform number u in [0, 1]; ``1 - sample_one_minus_mu(u)``."""
        return 1.0 - self.sample_one_minus_mu(u)

    def sample_one_minus_mu(self, u: ArrayLike) -> Array:
        """Return ``1 - mu`` for every uniform number u, without the rounding of mu near 1.

        By default this is the inverse of the cumulative probability of `table`, so that
        ``cdf(sample(u)) = u`` up to the width of a cell.
        """
        return self.table().sample(1.0 - uniform_numbers(u))

    @property
    def asymmetry(self) -> float:
        """Mean cosine of the scattering angle."""
        return 1.0 - self._moments_of_s[0]

    @property
    def second_moment(self) -> float:
        """Mean of the Legendre polynomial P2 of the cosine of the scattering angle."""
        mean, mean_square = self._moments_of_s
        return 1.0 - 3.0 * mean + 1.5 * mean_square

    @property
    def backscatter_fraction(self) -> float:
        """Probability of a scattering by more than 90 degrees."""
        return float(self.backward_probability(np.ones(1))[0])

    @cached_property
    def _moments_of_s(self) -> tuple[float, float]:
        # <s> = integral of 1 - F and <s^2> = integral of 2 s (1 - F), by parts: F is smooth even where
        # the density is not.
        points, weights = gauss_cells(cell_edges(DEFAULT_CELLS))
        above = np.where(
            points < 1.0, 1.0 - self.forward_probability(points), self.backward_probability(2.0 - points)
        )
        return float(np.sum(weights * above)), float(np.sum(weights * 2.0 * points * above))

    def table(self, cells: int | None = None) -> PhaseTable:
        """Cut the phase function into cells of exact probability; kept for the next call.

        Parameters
        ----------
        cells : int, optional
            Even number of cells; what the phase function needs when left out.
        """
        wanted = self.natural_cells if cells is None else cells
        if wanted < 2 or wanted % 2:
            raise refuse("cells", wanted, "an even number, at least 2")
        kept: dict[int, PhaseTable] = self._tables
        if wanted not in kept:
            kept[wanted] = self._tabulate(wanted)
        return kept[wanted]

    @cached_property
    def _tables(self) -> dict[int, PhaseTable]:
        return {}

    @property
    def natural_cells(self) -> int:
        """Number of cells that resolves what this phase function has to show."""
        return DEFAULT_CELLS

    def _tabulate(self, cells: int) -> PhaseTable:
        edges = cell_edges(cells)
        half = cells // 2
        forward = np.diff(self.forward_probability(edges[: half + 1]))
        backward = -np.diff(self.backward_probability(2.0 - edges[half:]))
        return from_probabilities(edges, np.concatenate((forward, backward)))


def _cosines(mu: ArrayLike) -> Array:
    cosine = np.asarray(mu, dtype=np.float64)
    check("mu", cosine, -1.0, 1.0, unit="(cosine of the scattering angle)")
    return cosine


def uniform_numbers(u: ArrayLike) -> Array:
    """Return u as an array, refused outside 0 to 1."""
    uniform = np.asarray(u, dtype=np.float64)
    check("u", uniform, 0.0, 1.0, unit="(uniform number)")
    return uniform
