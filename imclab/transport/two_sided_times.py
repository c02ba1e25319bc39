"""When the light arrives that the two-sided estimator joins: times of both sides add."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from imclab.transport.direct_light import DirectLight
from imclab.transport.light_walk import MapAxes
from imclab.transport.setup import Setup

FloatArray = NDArray[np.float64]


def scattered_times(setup: Setup, axes: MapAxes, arriving: FloatArray, seen: FloatArray) -> FloatArray:
    """Return the impulse histogram of light scattered on its way to the target, per packet.

    ``arriving`` and ``seen``, each (2 materials, times, rings), are what falls on the rings and what
    the camera sees of them. The times of the two sides add: a convolution for each material and ring.
    """
    # numpy's transforms: scipy.signal would do the same, but loading it takes as long as half a cached start
    length = arriving.shape[1] + seen.shape[1] - 1
    spectrum = np.fft.rfft(arriving, length, axis=1) * np.fft.rfft(seen, length, axis=1)
    both = np.maximum(np.fft.irfft(spectrum.sum(axis=(0, 2)), length), 0.0)  # rounding may go below
    moment = axes.impulse_start + axes.times[0] + np.arange(both.size) * axes.impulse_width
    place = (moment - setup.time.start) / setup.time.width - 0.5
    place = np.clip(place, -2.0, setup.time.bins + 1.0)  # an early gate lies far from all light
    low = np.floor(place).astype(np.int64)
    times = np.zeros(setup.time.bins)
    for bins, share in ((low, low + 1.0 - place), (low + 1, place - low)):
        inside = (bins >= 0) & (bins < setup.time.bins)
        np.add.at(times, bins[inside], (share * both)[inside])
    return times


def rings_seen(setup: Setup, axes: MapAxes, direct: DirectLight, coverage: FloatArray) -> FloatArray:
    """Return what the camera sees of each ring unscattered, laid out as `CameraTally.impulses`."""
    seen = np.zeros((2, axes.impulse_bins, axes.radii.size))
    if not setup.time.bins:
        return seen
    rows, columns = coverage.shape
    y = (2.0 * (np.arange(rows) + 0.5) / rows - 1.0) * setup.target.half_height
    x = (2.0 * (np.arange(columns) + 0.5) / columns - 1.0) * setup.target.half_width
    radius = np.hypot(x[None, :], y[:, None])
    ring = np.searchsorted(axes.radii, radius, side="right") - 1
    outer = (radius - axes.radii[ring]) / np.diff(axes.radii)[ring]
    place = (direct.return_time - axes.times[0]) / axes.impulse_width
    bin_ = np.floor(place).astype(np.int64)
    later = place - bin_
    known = bin_ < axes.impulse_bins - 1
    for material, share in enumerate((coverage, 1.0 - coverage)):
        energy = share * direct.reach.sum(axis=-1) / np.pi
        for step_time, in_time in ((0, 1.0 - later), (1, later)):
            for step_ring, in_ring in ((0, 1.0 - outer), (1, outer)):
                index = (bin_[known] + step_time, ring[known] + step_ring)
                np.add.at(seen[material], index, (energy * in_time * in_ring)[known])
    return seen
