"""Estimates with their uncertainty budgets, after the GUM and ASME V&V 20-2009.

Every relative quantity here is compared through its comparison error E = simulation / experiment - 1
and its validation uncertainty u_val, the root sum of squares of the budget's independent parts.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

COVERAGE_95 = 1.959963984540054  # of a normal distribution


@dataclass(frozen=True)
class Estimate:
    """A value with its standard uncertainty."""

    value: float
    stderr: float

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of a normal distribution."""
        half = COVERAGE_95 * self.stderr
        return self.value - half, self.value + half


@dataclass(frozen=True)
class ComparisonError:
    """Simulated over measured, less one, with the budget of its uncertainty.

    Attributes
    ----------
    value : float
        E = simulated / measured - 1.
    budget : mapping
        Relative standard uncertainty of each source; independent of one another.
    bound : float
        The claim to be judged, 0.30 in the paper.
    """

    value: float
    budget: Mapping[str, float]
    bound: float = 0.30

    @property
    def u_val(self) -> float:
        """Validation uncertainty: root sum of squares of the budget."""
        return math.sqrt(sum(u * u for u in self.budget.values()))

    @property
    def shares(self) -> dict[str, float]:
        """Share of each source in u_val squared; they sum to one."""
        total = self.u_val**2
        return {name: (u * u / total if total > 0 else 0.0) for name, u in self.budget.items()}

    @property
    def probability_inside(self) -> float:
        """Probability that the true relative error lies inside the bound (normal distribution)."""
        if self.u_val == 0.0:
            return float(abs(self.value) <= self.bound)
        scale = self.u_val * math.sqrt(2.0)
        above = math.erf((self.bound - self.value) / scale)
        below = math.erf((-self.bound - self.value) / scale)
        return 0.5 * (above - below)

    @property
    def verdict(self) -> str:
        """What the numbers say, in one of three ways (V&V 20, section 6)."""
        if abs(self.value) <= COVERAGE_95 * self.u_val:
            return "agrees within its uncertainty"
        if self.probability_inside >= 0.95:
            return "differs, inside the bound"
        if self.probability_inside <= 0.05:
            return "differs, outside the bound"
        return "differs, perhaps outside the bound"
