"""Sums kept in a few groups of batches, for errors of quantities that are no plain means.

A full width at half maximum, or a quotient of sums, is computed from all groups and again with each
group left out; the spread of those is its standard error (jackknife).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from imclab.transport.runner import Tally

FloatArray = NDArray[np.float64]

GROUPS = 32


class GroupLedger:
    """Sums of batches in groups: batch i goes into group i modulo GROUPS, so memory stays constant.

    Means are quotients: sums over the number of packets that took part in the sampling (``sampled``,
    a tally of one number), times the share of packets that do, which is known. That leaves out the
    noise of how many do, and makes energy balance exact.

    Parameters
    ----------
    exact : mapping
        What is computed per packet, added to the means.
    sampled_share : float
        Known share of packets that take part in the sampling.
    stop_at : str
        Name of the tally that stops a run: the largest relative error in its first column.
    """

    def __init__(self, exact: Tally, *, sampled_share: float, stop_at: str) -> None:
        self._exact = exact
        self._sampled_share = sampled_share
        self._stop_at = stop_at
        self._sums: dict[str, FloatArray] = {}
        self._totals: dict[str, FloatArray] = {}
        self._counts = np.zeros(GROUPS)
        self._batches = 0

    def enter(self, tally: Tally, count: int) -> None:
        """Enter the sums of one batch; the packets that took part in it are in its tally ``sampled``."""
        group = self._batches % GROUPS
        for name, sums in tally.items():
            if name not in self._sums:
                self._sums[name] = np.zeros((GROUPS, *sums.shape))
                self._totals[name] = np.zeros(sums.shape)
            self._sums[name][group] += sums
            self._totals[name] += sums
        self._counts[group] += tally["sampled"][0]
        self._batches += 1

    def relative_error(self) -> float:
        """Return the largest relative standard error in the tally that stops a run."""
        exact = self._exact[self._stop_at][..., 0]
        if self._sampled_share == 0.0:
            return 0.0
        used = np.flatnonzero(self._counts)
        if used.size < 2:
            return np.inf
        counts = self._counts[used]
        sums = self._sums[self._stop_at][used][..., 0]
        mean = sums.sum(axis=0) / counts.sum()
        spread = np.sum((sums - counts[:, None] * mean) ** 2, axis=0) * used.size / (used.size - 1)
        stderr = self._sampled_share * np.sqrt(spread) / counts.sum()
        whole = self._sampled_share * mean + exact
        known = whole > 0.0
        return float(np.max(stderr[known] / whole[known])) if known.any() else np.inf

    def jackknife(self, quantity: Callable[[Tally], FloatArray]) -> tuple[FloatArray, FloatArray]:
        """Return a quantity of the means per packet, and its standard error.

        Groups may differ in size: Busing, Meijer and van der Leeden 1999, "Delete-m jackknife for
        unequal m", Statistics and Computing 9, 3, eqs. 4 to 6.
        """
        used = np.flatnonzero(self._counts)
        total = self._counts.sum()
        value = quantity(self._means(None))
        if self._sampled_share == 0.0:
            return value, np.zeros_like(value)
        if used.size < 2:
            return value, np.full_like(value, np.inf)
        ratio = (total / self._counts[used]).reshape(-1, *(1,) * value.ndim)
        without = np.array([quantity(self._means(group)) for group in used.tolist()])
        pseudo = ratio * value - (ratio - 1.0) * without
        centre = used.size * value - np.sum((1.0 - 1.0 / ratio) * without, axis=0)
        return value, np.sqrt(np.mean((pseudo - centre) ** 2 / (ratio - 1.0), axis=0))

    def _means(self, left_out: int | None) -> Tally:
        count = self._counts.sum() - (0.0 if left_out is None else self._counts[left_out])
        means: dict[str, FloatArray] = {}
        for name, total in self._totals.items():
            sums = total if left_out is None else total - self._sums[name][left_out]
            means[name] = self._exact[name] + (sums * (self._sampled_share / count) if count else 0.0)
        return means
