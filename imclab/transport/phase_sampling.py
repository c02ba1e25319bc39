"""Scalar kernels that sample and evaluate a `PhaseTable`: constant time, without branches.

Symbols: ``s = 1 - mu``, with ``mu`` the cosine of the scattering angle. The sine that goes with it is
``sqrt(s (2 - s))``, which keeps its digits at the smallest angles.
"""

from __future__ import annotations

import math

from imclab.optics.phase_table import PhaseTable
from imclab.transport.scalar_kernel import scalar_kernel


@scalar_kernel
def sample(table: PhaseTable, u: float) -> float:
    """Draw ``1 - mu`` from the table.

    Parameters
    ----------
    table : PhaseTable
        The phase function; trusted.
    u : float
        Uniform number in [0, 1). It selects the cell and places the direction inside it, so it should
        carry at least 32 random bits: the share of a cell is right to the spacing of u.

    Returns
    -------
    float
        ``1 - mu`` in [0, 2]. The map from u is not monotone (alias method); the monotone one is
        ``PhaseTable.sample``, of the same distribution.
    """
    rows = table.alias
    scaled = u * rows.shape[0]
    row = min(int(scaled), rows.shape[0] - 1)  # u may have been rounded up to 1
    fraction = scaled - row
    first = fraction < rows[row, 0]
    start = rows[row, 1] if first else rows[row, 3]
    slope = rows[row, 2] if first else rows[row, 4]
    one_minus_mu: float = start + slope * fraction
    return min(max(one_minus_mu, 0.0), 2.0)


@scalar_kernel
def evaluate(table: PhaseTable, one_minus_mu: float) -> float:
    """Return the phase function in 1/sr at ``1 - mu`` in [0, 2]: the density that `sample` draws from."""
    cells = table.density.shape[0]
    forward = math.sqrt(math.sqrt(one_minus_mu))
    backward = 2.0 - math.sqrt(max(2.0 - one_minus_mu, 0.0))
    twice_t = forward if one_minus_mu < 1.0 else backward
    value: float = table.density[min(int(0.5 * cells * twice_t), cells - 1)]
    return value
