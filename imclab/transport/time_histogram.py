"""From the arrival times of the pulse's peak to the power that arrives: the pulse's own length added."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from imclab.scene import Scene
from imclab.transport.setup import Setup, pulse_sigma, time_window

FloatArray = NDArray[np.float64]


def time_edges(scene: Scene, setup: Setup, bins: int) -> FloatArray:
    """Return the edges of the result's time bins, s."""
    start, end = time_window(scene, setup.gate, setup.water.group_velocity)
    return np.linspace(start, end, bins + 1)


def pulse_spread(scene: Scene, setup: Setup, edges: FloatArray) -> FloatArray:
    """Return the matrix (bins, impulse bins) that spreads arrivals of the peak over the pulse.

    Arrivals are even inside an impulse bin [a, b], so the share of the pulse before an edge e is the
    mean of the normal distribution's integral over it: sigma / (b - a) (H((e - a)/sigma) -
    H((e - b)/sigma)) with H(v) = v Phi(v) + phi(v).
    """
    sigma = pulse_sigma(scene)
    impulse = setup.time.start + setup.time.width * np.arange(setup.time.bins + 1)
    place = (edges[:, None] - impulse[None, :]) / sigma
    integral = place * ndtr(place) + np.exp(-0.5 * place**2) / np.sqrt(2.0 * np.pi)
    before = -np.diff(integral, axis=1) * (sigma / setup.time.width)
    return np.diff(before, axis=0)
