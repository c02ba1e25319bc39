"""Two-sided estimator: light on the target from the laser's side joined with walks from the camera.

For targets that send light back with the same radiance everywhere (Lambertian, diffuse law). The
picture is a sum of parts:

- unscattered both ways: computed by quadrature;
- scattered on the way to the target only: walks from the laser (`light_walk`), seen unscattered;
- scattered on the way back: walks from the camera (`camera_walk`), which end on the target lit by both;
- backscatter that has not met the target: walks from the camera joined with the beam.

Light scattered on the target's two sides meets batch by batch, and both sides of a batch are
independent, so the mean of their product is exact and batches give its error.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from imclab.transport.backscatter_walk import backscatter_walks, peak_angle
from imclab.transport.camera_walk import camera_walks
from imclab.transport.direct_light import DirectLight, coverage_of, direct_light, rules_for
from imclab.transport.light_walk import LightMaps, MapAxes, light_walks
from imclab.transport.runner import Estimator, Tally
from imclab.transport.setup import PULSE_REACH, Setup
from imclab.transport.smooth_map import smooth_map
from imclab.transport.target_radiance import gate_table, gated_radiance, map_axes

FloatArray = NDArray[np.float64]

BATCH_SIZE = 20_000
FEWEST_CELLS = 96
"""Cells along each side that the walks see at least; pixels are sums of cells."""
ROW_STEP = 4


def make(setup: Setup) -> Estimator:
    """Return the two-sided estimator of a set-up with diffuse surfaces."""
    receiver = setup.receiver
    fine = max(1, math.ceil(FEWEST_CELLS / min(receiver.rows, receiver.columns)))
    coverage = coverage_of(setup.target.mask, receiver.rows * fine, receiver.columns * fine)
    latest = setup.gate.closes + PULSE_REACH * setup.gate.sigma
    axes = map_axes(setup, latest)
    direct = direct_light(setup, rules_for(setup), coverage)
    exact = {"target": _pixels(direct.picture, fine), "backscatter": _pixels(0.0 * direct.picture, fine)}
    if setup.time.bins:
        exact["time"] = direct.times
    scatters = setup.water.scattering > 0.0
    peak, veil = peak_angle(setup), smooth_map(setup)
    table = gate_table(setup, axes, direct)
    unscattered = _seen_unscattered(setup, axes, direct, coverage)

    def batch(seed: int, first_history: int, count: int) -> Tally:
        picture, backscatter = np.zeros_like(coverage), np.zeros(veil.shape)
        times = np.zeros(setup.time.bins)
        if scatters:
            run = (np.uint64(seed), np.uint64(first_history), count)
            sums = light_walks(setup, axes, latest, *run)
            maps = LightMaps(*(array / max(count, 1) for array in sums))
            radiance, seen = gated_radiance(setup, axes, table, direct, coverage, maps)
            camera = camera_walks(setup, axes, direct, coverage, radiance, ROW_STEP, *run)
            picture = count * seen + camera.picture
            backscatter_walks(setup, peak, latest, veil.tents, *run, backscatter, times)
            if setup.time.bins:
                seen_rings = unscattered + camera.impulses / max(count, 1)
                times += camera.times + count * _scattered_times(setup, axes, maps.impulses, seen_rings)
        tally = {"target": _pixels(picture, fine), "backscatter": veil.picture(backscatter)}
        return tally | {"time": times} if setup.time.bins else tally

    return Estimator("two-sided", batch, BATCH_SIZE, exact, ())


def _pixels(cells: FloatArray, fine: int) -> FloatArray:
    """Sum cells over pixels."""
    rows, columns = cells.shape[0] // fine, cells.shape[1] // fine
    return np.asarray(cells.reshape(rows, fine, columns, fine).sum(axis=(1, 3)))


def _scattered_times(setup: Setup, axes: MapAxes, arriving: FloatArray, seen: FloatArray) -> FloatArray:
    """Return the impulse histogram of light scattered on its way to the target, per packet.

    ``arriving`` and ``seen``, each (2 materials, times, rings), are what falls on the rings and what
    the camera sees of them. The times of the two sides add: a convolution for each material and ring.
    """
    from scipy.signal import fftconvolve

    both = fftconvolve(arriving, seen, axes=1).sum(axis=(0, 2))
    place = (np.arange(both.size) * axes.impulse_width - setup.time.start) / setup.time.width - 0.5
    low = np.floor(place).astype(np.int64)
    times = np.zeros(setup.time.bins)
    for bins, share in ((low, low + 1.0 - place), (low + 1, place - low)):
        inside = (bins >= 0) & (bins < setup.time.bins)
        np.add.at(times, bins[inside], (share * both)[inside])
    return times


def _seen_unscattered(setup: Setup, axes: MapAxes, direct: DirectLight, coverage: FloatArray) -> FloatArray:
    """Return what the camera sees of each ring unscattered, laid out as `CameraTally.impulses`."""
    seen = np.zeros((2, axes.impulse_bins, axes.radii.size))
    if not axes.impulse_bins:
        return seen
    rows, columns = coverage.shape
    y = (2.0 * (np.arange(rows) + 0.5) / rows - 1.0) * setup.target.half_height
    x = (2.0 * (np.arange(columns) + 0.5) / columns - 1.0) * setup.target.half_width
    radius = np.hypot(x[None, :], y[:, None])
    ring = np.searchsorted(axes.radii, radius, side="right") - 1
    outer = (radius - axes.radii[ring]) / np.diff(axes.radii)[ring]
    place = direct.return_time / axes.impulse_width
    bin_ = np.floor(place).astype(np.int64)
    later = place - bin_
    known = bin_ < axes.impulse_bins - 1
    for material, share in enumerate((coverage, 1.0 - coverage)):
        energy = share * direct.reach / np.pi
        for step_time, in_time in ((0, 1.0 - later), (1, later)):
            for step_ring, in_ring in ((0, 1.0 - outer), (1, outer)):
                index = (bin_[known] + step_time, ring[known] + step_ring)
                np.add.at(seen[material], index, (energy * in_time * in_ring)[known])
    return seen
