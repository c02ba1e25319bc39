"""Full widths at half maximum of a spot and of a pulse, from histograms."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

FloatArray = NDArray[np.float64]

PEAK_WINDOW = 0.6
"""The peak is a fit over radii up to this part of the half width."""
CROSSING_WINDOW = 0.3
"""The crossing is a fit over radii within this part of the half width around it."""
_ROUNDS = 12


def spot_fwhm(edges: FloatArray, energy: FloatArray) -> float:
    """Return twice the radius at which the irradiance is half of that on the axis, m.

    The peak is fitted by a + b r^2 + c r^4 near the axis and the crossing by a parabola around it,
    each over a window that is a part of the half width, found by repetition. A term less in either
    makes a Gaussian 0.4 % too wide.

    Parameters
    ----------
    edges : array (bins + 1)
        Radii, m; the last may be infinite, its bin is not used.
    energy : array (bins)
        Energy in each ring.

    Returns
    -------
    float
        NaN when nothing arrived.
    """
    finite = np.isfinite(edges[1:])
    inner, outer, energy = edges[:-1][finite], edges[1:][finite], energy[finite]
    area = np.pi * (outer**2 - inner**2)
    radius = np.sqrt(0.5 * (inner**2 + outer**2))
    total = energy.sum()
    if not total > 0.0:
        return np.nan
    irradiance = energy / area
    half_width = radius[np.searchsorted(np.cumsum(energy), 0.5 * total)]
    for _ in range(_ROUNDS):
        window = radius <= max(PEAK_WINDOW * half_width, radius[min(3, radius.size - 1)])
        peak = _parabola(radius[window] ** 2, irradiance[window], area[window])[0]
        below = _smooth(irradiance, area, radius, half_width) < 0.5 * peak
        crude = radius[np.argmax(below)] if below.any() else radius[-1]
        near = np.abs(radius - crude) <= max(CROSSING_WINDOW * crude, 2.5 * (outer - inner)[np.argmax(below)])
        refined = crude + _crossing(_parabola(radius[near] - crude, irradiance[near], area[near]), 0.5 * peak)
        new = refined if abs(refined - crude) <= CROSSING_WINDOW * crude else crude
        if abs(new - half_width) <= 1e-6 * new:
            break
        half_width = new
    return float(2.0 * half_width)


def _parabola(x: FloatArray, y: FloatArray, weight: FloatArray) -> tuple[float, float, float]:
    """Return value, slope and half the curvature at 0 by weighted least squares; fewer with few points."""
    terms = min(3, x.size)
    scale = float(np.abs(x).max()) or 1.0
    columns = (x[:, None] / scale) ** np.arange(terms)
    root = np.sqrt(weight / weight.max())
    found = np.linalg.lstsq(columns * root[:, None], y * root, rcond=None)[0] / scale ** np.arange(terms)
    value, slope, bend = np.append(found, np.zeros(3 - terms))
    return float(value), float(slope), float(bend)


def _crossing(parabola: tuple[float, float, float], level: float) -> float:
    """Return where a falling parabola crosses ``level`` next to 0; 0 when it does not fall."""
    value, slope, bend = parabola
    if not slope < 0.0:
        return 0.0
    inside = slope**2 - 4.0 * bend * (value - level)
    if inside <= 0.0:
        return (level - value) / slope
    # the root next to 0, in the form that does not cancel
    return float(2.0 * (level - value) / (slope - np.sqrt(inside)))


def _smooth(irradiance: FloatArray, area: FloatArray, radius: FloatArray, width: float) -> FloatArray:
    """Return the mean irradiance within a tenth of the half width around each radius."""
    low = np.searchsorted(radius, radius - 0.1 * width)
    high = np.searchsorted(radius, radius + 0.1 * width, side="right")
    energy = np.concatenate(([0.0], np.cumsum(irradiance * area)))
    areas = np.concatenate(([0.0], np.cumsum(area)))
    return np.asarray((energy[high] - energy[low]) / (areas[high] - areas[low]))


def pulse_fwhm(delay: FloatArray, weight: FloatArray, sigma: FloatArray) -> float:
    """Return the full width at half maximum of a Gaussian pulse smeared by delays, s.

    Parameters
    ----------
    delay, weight : array (n)
        Delays, s, rising, and the energy that has each.
    sigma : array (n)
        Standard deviation of the pulse, s, with which each delay arrives: that of the laser's pulse, and
        of the bin that the delay stands for.

    Returns
    -------
    float
        Between the crossings of the half maximum next to the highest point; NaN when nothing arrived.
    """
    present = weight > 0.0
    delay, height, sigma = delay[present], weight[present] / sigma[present], sigma[present]
    if not height.size:
        return np.nan

    def power(time: float) -> float:
        return float(height @ np.exp(-0.5 * ((time - delay) / sigma) ** 2))

    # the delays that carry the energy; the far tail does not move the half maximum
    energy = np.cumsum(height * sigma)
    first, last = np.searchsorted(energy, [0.001 * energy[-1], 0.999 * energy[-1]])
    start, end = delay[first] - 5.0 * sigma[first], delay[last] + 5.0 * sigma[last]
    points = int(np.clip((end - start) / (0.1 * sigma[first]), 301, 3001))
    grid = np.linspace(start, end, points)
    profile = np.exp(-0.5 * ((grid[:, None] - delay) / sigma) ** 2) @ height
    top = int(np.clip(np.argmax(profile), 1, points - 2))
    # a parabola through the three highest points places the maximum between them
    before, here, after = profile[top - 1 : top + 2]
    bend = before - 2.0 * here + after
    peak_time = grid[top] + (0.5 * (grid[1] - grid[0]) * (before - after) / bend if bend < 0.0 else 0.0)
    half = 0.5 * power(peak_time)
    left = grid[np.append(0, np.flatnonzero(profile[:top] < half))[-1]]
    right = grid[np.append(top + np.flatnonzero(profile[top:] < half), points - 1)[0]]
    step = 1e-10 * (end - start)
    ends = [
        brentq(lambda t: power(t) - half, *sorted((peak_time, side)), xtol=step)
        if power(side) < half
        else side
        for side in (left, right)
    ]
    return float(ends[1] - ends[0])
