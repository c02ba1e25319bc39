"""Weighted sums of phase functions: two-term Henyey-Greenstein, and particles in water."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from imclab.optics.limits import check, refuse
from imclab.optics.phase_closed import HenyeyGreenstein
from imclab.optics.phase_function import PhaseFunction
from imclab.optics.phase_table import PhaseTable, cell_edges, from_probabilities

Array = NDArray[np.float64]


class _Weighted(PhaseFunction):
    """A weighted sum of phase functions."""

    @property
    @abstractmethod
    def _terms(self) -> Sequence[tuple[float, PhaseFunction]]:
        """Weights, of sum 1, and the phase functions they belong to."""

    def density(self, s: Array) -> Array:
        """Phase function in 1/sr at ``s = 1 - mu``."""
        return np.asarray(sum(w * p.density(s) for w, p in self._terms))

    def forward_probability(self, s: Array) -> Array:
        """Probability of ``1 - mu'`` at most s."""
        return np.asarray(sum(w * p.forward_probability(s) for w, p in self._terms))

    def backward_probability(self, r: Array) -> Array:
        """Probability of ``1 + mu'`` at most r."""
        return np.asarray(sum(w * p.backward_probability(r) for w, p in self._terms))

    @property
    def asymmetry(self) -> float:
        """Mean cosine of the scattering angle."""
        return sum(w * p.asymmetry for w, p in self._terms)

    @property
    def second_moment(self) -> float:
        """Mean of P2."""
        return sum(w * p.second_moment for w, p in self._terms)

    @property
    def natural_cells(self) -> int:
        """Cells of the most structured term."""
        return max(p.natural_cells for _, p in self._terms)

    def _tabulate(self, cells: int) -> PhaseTable:
        probabilities = sum(w * p.table(cells).probabilities for w, p in self._terms)
        return from_probabilities(cell_edges(cells), np.asarray(probabilities))


@dataclass(frozen=True)
class TwoTermHenyeyGreenstein(_Weighted):
    """``weight`` of Henyey-Greenstein with g1 and the rest with g2 (Kattawar 1975).

    Parameters
    ----------
    g1, g2 : float
        Asymmetries of the two terms, -1 to 1.
    weight : float
        Share of the first term, 0 to 1.
    """

    g1: float
    g2: float
    weight: float

    def __post_init__(self) -> None:
        check("g1", self.g1, -1.0, 1.0)
        check("g2", self.g2, -1.0, 1.0)
        check("weight", self.weight, 0.0, 1.0)

    @property
    def _terms(self) -> Sequence[tuple[float, PhaseFunction]]:
        return (
            (self.weight, HenyeyGreenstein(self.g1)),
            (1.0 - self.weight, HenyeyGreenstein(self.g2)),
        )


@dataclass(frozen=True)
class Mixture(_Weighted):
    """Several phase functions in the proportion of what they scatter.

    Parameters
    ----------
    components : sequence of PhaseFunction
        For example particles and the water itself.
    weights : sequence of float
        Their scattering coefficients, or other non-negative numbers in that proportion.
    """

    components: Sequence[PhaseFunction]
    weights: Sequence[float]

    def __post_init__(self) -> None:
        weights = np.asarray(self.weights, dtype=np.float64)
        if weights.shape != (len(self.components),) or not weights.size:
            raise refuse("weights", f"{weights.size} for {len(self.components)} components", "one for each")
        check("weights", weights, 0.0, 1e300)
        if weights.sum() == 0.0:
            raise refuse("weights", "only zeros", "at least one that is positive")
        object.__setattr__(self, "components", tuple(self.components))
        object.__setattr__(self, "weights", tuple(float(w) for w in weights / weights.sum()))

    @property
    def _terms(self) -> Sequence[tuple[float, PhaseFunction]]:
        return tuple(zip(self.weights, self.components, strict=True))
