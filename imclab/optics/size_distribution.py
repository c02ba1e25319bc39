"""How large the particles are: one size, log-normal, a power law (Junge), or a measured table.

Each distribution gives ``nodes()``: diameters in m and the share of the NUMBER of particles that each
stands for. A continuous distribution is cut into equal steps of ln d (trapezoid); 4001 of them give
mean cross sections to 1e-9 and the backscatter of smooth distributions to 1e-7.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imclab.optics.limits import check, refuse

Array = NDArray[np.float64]

SMALLEST_DIAMETER, LARGEST_DIAMETER = 1e-10, 1e-2
DEFAULT_NODES = 4001


class SizeDistribution(ABC):
    """What every distribution can do."""

    @abstractmethod
    def nodes(self) -> tuple[Array, Array]:
        """Return diameters in m, increasing, and the share of the number of particles of each."""


def _check_diameter(name: str, value: ArrayLike) -> None:
    check(name, value, SMALLEST_DIAMETER, LARGEST_DIAMETER, unit="m")


def _trapezoid(diameters: Array, per_log: Array) -> tuple[Array, Array]:
    weights = per_log.copy()
    weights[[0, -1]] *= 0.5
    return diameters, weights / weights.sum()


@dataclass(frozen=True)
class SingleSize(SizeDistribution):
    """All particles of one diameter in m."""

    diameter: float

    def __post_init__(self) -> None:
        _check_diameter("diameter", self.diameter)

    def nodes(self) -> tuple[Array, Array]:
        """Return the one diameter."""
        return np.array([self.diameter]), np.ones(1)


@dataclass(frozen=True)
class LogNormal(SizeDistribution):
    """The logarithm of the diameter is normal, cut at five standard deviations.

    Parameters
    ----------
    diameter : float
        Median of the number distribution, m.
    sigma : float
        Geometric standard deviation, 1.001 to 5: 68 % lie within median/sigma to median*sigma.
    count : int
        Number of nodes.
    """

    diameter: float
    sigma: float
    count: int = DEFAULT_NODES

    def __post_init__(self) -> None:
        _check_diameter("diameter", self.diameter)
        check("sigma", self.sigma, 1.001, 5.0, unit="(geometric standard deviation)")
        check("count", self.count, 3, 1e6)

    def nodes(self) -> tuple[Array, Array]:
        """Return equal steps of ln d and their shares."""
        deviations = np.linspace(-5.0, 5.0, self.count)
        return _trapezoid(self.diameter * self.sigma**deviations, np.exp(-0.5 * deviations**2))


@dataclass(frozen=True)
class Junge(SizeDistribution):
    """A power law: the number of particles per diameter falls as ``d**-slope`` between two diameters.

    Parameters
    ----------
    slope : float
        1 to 8; near 4 in the sea.
    smallest, largest : float
        Ends of the power law in m.
    count : int
        Number of nodes.
    """

    slope: float
    smallest: float
    largest: float
    count: int = DEFAULT_NODES

    def __post_init__(self) -> None:
        check("slope", self.slope, 1.0, 8.0)
        _check_diameter("smallest", self.smallest)
        _check_diameter("largest", self.largest)
        check("count", self.count, 3, 1e6)
        if not self.smallest < self.largest:
            raise refuse("largest", f"{self.largest:g} m", f"more than smallest, {self.smallest:g} m")

    def nodes(self) -> tuple[Array, Array]:
        """Return equal steps of ln d and their shares."""
        diameters = np.geomspace(self.smallest, self.largest, self.count)
        return _trapezoid(diameters, (diameters / self.smallest) ** (1.0 - self.slope))


@dataclass(frozen=True, eq=False)
class MeasuredSizes(SizeDistribution):
    """A measured table: number of particles per step of ln d at some diameters, linear in between.

    Parameters
    ----------
    diameters : array_like
        In m, strictly increasing.
    numbers : array_like
        Number per ln d there (per bin, for bins of equal ratio), in any unit; none negative.
    count : int
        Number of nodes.
    """

    diameters: ArrayLike
    numbers: ArrayLike
    count: int = DEFAULT_NODES

    def __post_init__(self) -> None:
        diameters = np.array(self.diameters, dtype=np.float64)
        numbers = np.array(self.numbers, dtype=np.float64)
        if diameters.ndim != 1 or diameters.shape != numbers.shape or diameters.size < 2:
            came = f"shapes {diameters.shape} and {numbers.shape}"
            raise refuse("size table", came, "two columns of equal length, 2 rows or more")
        _check_diameter("diameters", diameters)
        if np.any(np.diff(diameters) <= 0.0):
            raise refuse("diameters", "a step back or a repetition", "strictly increasing diameters")
        check("numbers", numbers, 0.0, 1e300)
        if numbers.sum() == 0.0:
            raise refuse("numbers", "only zeros", "at least one that is positive")
        for name, array in (("diameters", diameters), ("numbers", numbers)):
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    def nodes(self) -> tuple[Array, Array]:
        """Return equal steps of ln d and their shares."""
        known, numbers = np.asarray(self.diameters), np.asarray(self.numbers)
        diameters = np.geomspace(known[0], known[-1], self.count)
        return _trapezoid(diameters, np.interp(np.log(diameters), np.log(known), numbers))
