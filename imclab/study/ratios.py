"""Ratios of independent estimates, and how a number with its standard error is written."""

from __future__ import annotations

import math

from imclab.uncertainty import Estimate


def ratio(numerator: Estimate, denominator: Estimate) -> Estimate:
    """Return the ratio of two independent estimates, its error to first order."""
    value = numerator.value / denominator.value
    stderr = math.hypot(numerator.stderr, value * denominator.stderr) / abs(denominator.value)
    return Estimate(value, stderr)


def difference(left: Estimate, right: Estimate) -> Estimate:
    """Return the difference of two independent estimates."""
    return Estimate(left.value - right.value, math.hypot(left.stderr, right.stderr))


def shown(estimate: Estimate, *, percent: bool = False) -> str:
    """Write ``0.1234 ± 0.0012``, or in percent."""
    if percent:
        return f"({100 * estimate.value:.2f} ± {100 * estimate.stderr:.2f}) %"
    digits = 4 if estimate.stderr == 0 else max(0, 1 - math.floor(math.log10(estimate.stderr)))
    return f"{estimate.value:.{digits}f} ± {estimate.stderr:.{digits}f}"
