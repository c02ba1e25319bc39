"""The response curve in use: counts above dark to exposure and back, with its valid range."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

Floats = NDArray[np.float64]

TABLE_SIZE = 4096


@dataclass(frozen=True)
class Response:
    """The camera's response: a rising curve of exposure over counts above dark.

    Exposure is energy per pixel at the photocathode times the relative gain times the pixel's
    relative sensitivity. Between the nodes a monotone cubic (PCHIP) in both logarithms; below the
    lowest node the chord to the origin; above the highest up to ``limit`` the end's slope.

    Attributes
    ----------
    log_counts, log_exposure : Floats
        The nodes.
    limit : float
        Counts above dark up to which the curve may be used: the noise of the brightest level
        reaches this far.
    """

    log_counts: Floats
    log_exposure: Floats
    limit: float

    @property
    def lowest(self) -> float:
        """Counts above dark of the dimmest level; below it the curve is only a chord."""
        return float(np.exp(self.log_counts[0]))

    @property
    def highest(self) -> float:
        """Counts above dark of the brightest level."""
        return float(np.exp(self.log_counts[-1]))

    @cached_property
    def table(self) -> tuple[Floats, Floats]:
        """Counts above dark and exposure: the lookup table, from the lowest level to the limit."""
        curve = PchipInterpolator(self.log_counts, self.log_exposure)
        at = np.linspace(self.log_counts[0], self.log_counts[-1], TABLE_SIZE)
        log_exposure = np.asarray(curve(at))
        if self.limit > self.highest:
            slope = (log_exposure[-1] - log_exposure[-40]) / (at[-1] - at[-40])
            beyond = np.log(self.limit)
            at = np.append(at, beyond)
            log_exposure = np.append(log_exposure, log_exposure[-1] + slope * (beyond - self.log_counts[-1]))
        return np.exp(at), np.exp(log_exposure)

    @cached_property
    def _slopes(self) -> Floats:
        """Exposure per count (dx/dy) at the entries of the table."""
        counts, exposure = self.table
        return np.asarray(np.gradient(exposure, counts))

    @property
    def _chord(self) -> float:
        counts, exposure = self.table
        return float(exposure[0] / counts[0])

    def exposure(self, counts: Floats) -> Floats:
        """Exposure at counts above dark; NaN above the limit, on the chord below the lowest level."""
        table, exposure = self.table
        found = np.interp(counts, table, exposure, right=np.nan)
        return np.asarray(np.where(counts < table[0], counts * self._chord, found))

    def counts(self, exposure: Floats) -> Floats:
        """Counts above dark at an exposure, the exact inverse of ``exposure``; NaN above the range."""
        counts, table = self.table
        found = np.interp(exposure, table, counts, right=np.nan)
        return np.asarray(np.where(exposure < table[0], exposure / self._chord, found))

    def exposure_per_count(self, counts: Floats) -> Floats:
        """Slope dx/dy of the inverse at counts above dark."""
        table, _ = self.table
        found = np.interp(counts, table, self._slopes)
        return np.asarray(np.where(counts < table[0], self._chord, found))

    def secant(self, counts: Floats, noise: Floats | float = 0.0) -> Floats:
        """Mean slope dx/dy over the reach of the noise, at least 10 % to both sides.

        Photon transfer needs the slope, which a curve through noisy levels gives poorly at a point
        and well over a stretch.
        """
        table, exposure = self.table
        reach = np.maximum(0.1 * counts, np.asarray(noise))
        low, high = np.maximum(counts - reach, table[0]), np.minimum(counts + reach, table[-1])
        rise = np.interp(high, table, exposure) - np.interp(low, table, exposure)
        inside = rise / np.where(high > low, high - low, 1.0)
        return np.asarray(np.where(counts < table[0], self._chord, inside))

    def node_weights(self, counts: Floats) -> Floats:
        """How much each node says at some counts above dark (points x nodes), for its covariance."""
        at = np.log(np.clip(counts, self.lowest, self.highest))
        return np.stack(
            [np.interp(at, self.log_counts, row) for row in np.eye(self.log_counts.size)], axis=-1
        )
