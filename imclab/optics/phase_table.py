"""A phase function cut into cells, from which the transport both samples and evaluates.

The variable is ``s = 1 - mu`` (``mu`` the cosine of the scattering angle), because ``mu`` itself cannot
hold small angles: ``1 - cos(0.001 deg)`` is 1.5e-10. The cells have equal width in

    t = s**(1/4) / 2              for s <= 1  (forward half)
    t = 1 - (2 - s)**(1/2) / 2    for s >= 1  (backward half)

so that the cell of any direction follows from two square roots, without a search. With n cells the
forward cells are ``4 sqrt(2) (k / n)**2`` rad from the axis (the innermost is 2e-5 deg wide for 4096
cells, the one at 0.01 deg is 0.001 deg wide), the cells around 180 deg are ``2 sqrt(2) / n`` rad wide.
Inside a cell the density is uniform in ``mu``; the probability of every cell is exact.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

DEFAULT_CELLS = 4096

# Gauss-Legendre nodes and weights on [0, 1].
_GAUSS = np.polynomial.legendre.leggauss(8)
_NODES: Array = 0.5 * (1.0 + _GAUSS[0])
_WEIGHTS: Array = 0.5 * _GAUSS[1]


class PhaseTable(NamedTuple):
    """Cells of a phase function in ``s = 1 - mu``; all arrays contiguous and read-only.

    Attributes
    ----------
    edges : ndarray, shape (n + 1,)
        Cell edges in s, from 0 to 2; n is even.
    cumulative : ndarray, shape (n + 1,)
        Probability of a scattering with s below each edge, from 0 to 1.
    density : ndarray, shape (n,)
        Value of the phase function in each cell, 1/sr.
    alias : ndarray, shape (n, 5)
        Walker's alias table for sampling in constant time. A uniform number u selects row
        ``int(n u)`` and leaves the fraction f; the row holds (threshold, start, slope, other start,
        other slope) and s is ``start + slope f`` for f below the threshold, else the other pair. One
        row lies in one cache line, and there is no search and no division.
    """

    edges: Array
    cumulative: Array
    density: Array
    alias: Array

    @property
    def probabilities(self) -> Array:
        """Probability of each cell, shape (n,)."""
        return np.asarray(2.0 * np.pi * self.density * np.diff(self.edges))

    @property
    def asymmetry(self) -> float:
        """Mean cosine of what the table samples."""
        return 1.0 - float(self.probabilities @ (0.5 * (self.edges[1:] + self.edges[:-1])))

    @property
    def second_moment(self) -> float:
        """Mean of the Legendre polynomial P2 of what the table samples."""
        low, high = self.edges[:-1], self.edges[1:]
        mean = float(self.probabilities @ (0.5 * (low + high)))
        mean_square = float(self.probabilities @ ((low * low + low * high + high * high) / 3.0))
        return 1.0 - 3.0 * mean + 1.5 * mean_square

    def evaluate(self, one_minus_mu: ArrayLike) -> Array:
        """Phase function of the table, 1/sr, for an array of ``1 - mu`` in [0, 2]."""
        return np.asarray(self.density[cell_of(one_minus_mu, self.density.size)])

    def sample(self, u: ArrayLike) -> Array:
        """Invert the table's cumulative probability: monotone, s = 0 for u = 0 and s = 2 for u = 1."""
        uniform = np.asarray(u, dtype=np.float64)
        cell = np.searchsorted(self.cumulative, uniform, side="right") - 1
        cell = np.clip(cell, 0, self.density.size - 1)
        low = self.edges[cell]
        inside = (uniform - self.cumulative[cell]) / (2.0 * np.pi * np.maximum(self.density[cell], 1e-300))
        return np.asarray(np.clip(low + inside, low, self.edges[cell + 1]))


def cell_edges(cells: int = DEFAULT_CELLS) -> Array:
    """Return the edges in s of an even number of cells, shape (cells + 1,)."""
    t = np.arange(cells + 1) / cells
    forward = (2.0 * t) ** 4
    backward = 2.0 - (2.0 * (1.0 - t)) ** 2
    return np.where(t <= 0.5, forward, backward)


def cell_of(one_minus_mu: ArrayLike, cells: int) -> NDArray[np.int64]:
    """Return the index of the cell that holds each ``1 - mu``."""
    s = np.clip(np.asarray(one_minus_mu, dtype=np.float64), 0.0, 2.0)
    twice_t = np.where(s < 1.0, np.sqrt(np.sqrt(s)), 2.0 - np.sqrt(2.0 - s))
    return np.minimum((0.5 * cells * twice_t).astype(np.int64), cells - 1)


def gauss_cells(edges: Array) -> tuple[Array, Array]:
    """Return the points and weights, each (cells, 8), of Gauss quadrature inside every cell."""
    widths = np.diff(edges)[:, None]
    return edges[:-1, None] + widths * _NODES, widths * _WEIGHTS


def from_density(density: Callable[[Array], Array], cells: int = DEFAULT_CELLS) -> PhaseTable:
    """Tabulate a smooth density in s by 8-point Gauss quadrature inside every cell.

    Parameters
    ----------
    density : callable
        Phase function in 1/sr for an array of ``s``; need not be normalised.
    cells : int
        Even number of cells.
    """
    edges = cell_edges(cells)
    points, weights = gauss_cells(edges)
    values = density(points.ravel()).reshape(points.shape)
    return from_probabilities(edges, 2.0 * np.pi * np.sum(values * weights, axis=1))


def from_probabilities(edges: Array, probabilities: Array) -> PhaseTable:
    """Build the table from cell edges and the (not necessarily normalised) probability of each cell."""
    total = probabilities.sum()
    share = np.maximum(probabilities, 0.0) / total
    widths = np.diff(edges)
    cumulative = np.concatenate(([0.0], np.cumsum(share)))
    cumulative /= cumulative[-1]
    table = PhaseTable(
        edges=np.ascontiguousarray(edges),
        cumulative=cumulative,
        density=np.ascontiguousarray(share / (2.0 * np.pi * widths)),
        alias=_alias_rows(edges, share),
    )
    for array in table:
        array.flags.writeable = False
    return table


def _alias_rows(edges: Array, share: Array) -> Array:
    """Vose's construction of the alias table, with the position inside the cell folded into each row."""
    count = share.size
    scaled = (share * (count / share.sum())).tolist()
    threshold = [1.0] * count
    other = list(range(count))
    small = [k for k in range(count) if scaled[k] < 1.0]
    large = [k for k in range(count) if scaled[k] >= 1.0]
    while small and large:
        poor, rich = small.pop(), large[-1]
        threshold[poor], other[poor] = scaled[poor], rich
        scaled[rich] -= 1.0 - scaled[poor]
        if scaled[rich] < 1.0:
            small.append(large.pop())
    limit = np.array(threshold)
    partner = np.array(other)
    widths = np.diff(edges)
    slope = widths / np.maximum(limit, 1e-300)
    other_slope = np.where(limit < 1.0, widths[partner] / np.maximum(1.0 - limit, 1e-300), 0.0)
    rows = (limit, edges[:-1], slope, edges[partner] - limit * other_slope, other_slope)
    return np.ascontiguousarray(np.stack(rows, axis=1))
