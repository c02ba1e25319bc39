"""Estimates with their uncertainty budgets, after the GUM and ASME V&V 20-2009.

A source of uncertainty is a table of *effects*: row j holds what one independent unit-variance cause
does to each condition, as a relative change. Covariance is then effects.T @ effects, and an error
that many conditions share (a calibration, the reference condition) is shared in the covariance too.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

COVERAGE_95 = 1.959963984540054  # of a normal distribution

Effects = NDArray[np.float64]


@dataclass(frozen=True)
class Estimate:
    """A value with its standard uncertainty, known with so many degrees of freedom."""

    value: float
    stderr: float
    dof: float = math.inf

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval by Student's t, which few repeats widen (GUM, annex G)."""
        half = coverage_factor(self.dof) * self.stderr
        return self.value - half, self.value + half


def coverage_factor(dof: float) -> float:
    """Return how many standard uncertainties hold 95 % on both sides."""
    from scipy.special import stdtrit

    return float(stdtrit(dof, 0.975)) if math.isfinite(dof) else COVERAGE_95


def effective_dof(budget: Mapping[str, float], dof: Mapping[str, float]) -> float:
    """Return the degrees of freedom of a sum of sources (Welch-Satterthwaite, GUM G.4.1).

    Parameters
    ----------
    budget : mapping
        Standard uncertainty by source.
    dof : mapping
        Degrees of freedom by source; infinite for sources that it does not name.
    """
    variance = sum(u * u for u in budget.values())
    spread = sum(u**4 / dof[name] for name, u in budget.items() if name in dof)
    return variance**2 / spread if spread > 0.0 else math.inf


@dataclass(frozen=True)
class ComparisonError:
    """Simulated over measured, less one, with the budget of its uncertainty.

    Attributes
    ----------
    value : float
        E = simulated / measured - 1.
    budget : mapping
        Relative standard uncertainty by source; the sources are independent of one another.
    bound : float
        The claim to be judged; the paper's is 0.30.
    dof : float
        Degrees of freedom of u_val.
    """

    value: float
    budget: Mapping[str, float]
    bound: float = 0.30
    dof: float = math.inf

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
        return 0.5 * (
            math.erf((self.bound - self.value) / scale) - math.erf((-self.bound - self.value) / scale)
        )

    @property
    def verdict(self) -> str:
        """What the numbers say, in one of four ways (V&V 20, section 6)."""
        if abs(self.value) <= coverage_factor(self.dof) * self.u_val:
            return "agrees within its uncertainty"
        if self.probability_inside >= 0.95:
            return "differs, inside the bound"
        if self.probability_inside <= 0.05:
            return "differs, outside the bound"
        return "differs, perhaps outside the bound"


def covariance(sources: Mapping[str, Effects]) -> NDArray[np.float64]:
    """Return the covariance (conditions, conditions) of all sources together."""
    return np.asarray(sum(effects.T @ effects for effects in sources.values()))


def budget(sources: Mapping[str, Effects], condition: int) -> dict[str, float]:
    """Return the standard uncertainty of one condition by source."""
    return {name: float(np.sqrt((effects[:, condition] ** 2).sum())) for name, effects in sources.items()}
