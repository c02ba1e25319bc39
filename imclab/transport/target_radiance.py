"""Light on the target, direct and scattered, joined into its gated radiance for every camera time."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from imclab.transport.direct_light import DirectLight
from imclab.transport.gathering import gate_share
from imclab.transport.kernel_cache import cached_kernel, device
from imclab.transport.light_walk import MapAxes, ring_of
from imclab.transport.setup import Setup

FloatArray = NDArray[np.float64]

MOST_TIMES = 256
STEPS_PER_SIGMA = 24.0
STEP_GROWTH, FEWEST_STEPS_PER_SIGMA = 1.03, 6.0
"""Late camera times are rare: steps between their nodes grow, to a sixth of a standard deviation."""
TABLE_STEPS_PER_SIGMA = 64.0
RINGS_PER_BEAM = 48.0
RING_GROWTH = 0.03
COARSE_CELLS = 8
"""Cells along each side of the map of light that comes back, faint and smooth: linear between nodes."""
MOST_IMPULSE_BINS = 2000


def map_axes(setup: Setup, latest: float) -> MapAxes:
    """Lay the nodes of the maps: rings as fine as the beam, camera times as fine as the pulse.

    Linear interpolation between nodes is wrong by h²/8 of the second derivative: 1e-4 of the
    scattered light with `RINGS_PER_BEAM` nodes per standard deviation of the beam (light spread by the
    water has no finer structure), and of the gate's share 1e-4 with `STEPS_PER_SIGMA`, 1e-3 for the rare
    late camera times; for pulses so short that `MOST_TIMES` do not reach, more (1 % for 50 ps at 14 ns).
    """
    target, beam = setup.target, setup.beam
    corner = math.hypot(target.half_width, target.half_height)
    width = math.hypot(beam.spot_sigma, target.distance * beam.divergence_sigma)
    finest = max(width / RINGS_PER_BEAM, 1e-4 * corner)
    radii = [0.0]
    while radii[-1] <= corner:
        radii.append(radii[-1] + max(finest, RING_GROWTH * radii[-1]))
    radius = np.array(radii)
    times = _camera_times(setup, latest)
    inner_areas = _tent_areas_inside(radius, target.half_width, target.half_height)
    impulses = _impulse_axis(setup, latest)
    return MapAxes(radius, _tent_areas(radius), inner_areas, times, COARSE_CELLS, *impulses)


def _impulse_axis(setup: Setup, latest: float) -> tuple[float, float, int]:
    """Return start, step and number of the times of arrival on the target.

    As fine as gate and histogram want; without either all light is at one time.
    """
    start = setup.target.distance / setup.water.group_velocity
    end, step = latest, setup.gate.sigma / STEPS_PER_SIGMA
    if setup.time.bins:
        end = setup.time.start + setup.time.width * setup.time.bins
        step = min(step, setup.time.width) if math.isfinite(latest) else setup.time.width
    if not math.isfinite(end) or end <= start:
        return start, 1e30, 2
    step = max(step, (end - start) / MOST_IMPULSE_BINS)
    return start, step, math.ceil((end - start) / step) + 2


def _tent_areas(radius: FloatArray) -> FloatArray:
    """Integrate each tent function over the plane."""
    low, high = radius[:-1], radius[1:]
    cubes, squares, width = (high**3 - low**3) / 3.0, (high**2 - low**2) / 2.0, high - low
    areas = np.zeros_like(radius)
    areas[1:] += 2.0 * np.pi * (cubes - low * squares) / width
    areas[:-1] += 2.0 * np.pi * (high * squares - cubes) / width
    return areas


def _tent_areas_inside(radius: FloatArray, half_width: float, half_height: float) -> FloatArray:
    """Integrate each tent function over a rectangle around the rings' centre, eight points to an interval."""
    nodes, weights = np.polynomial.legendre.leggauss(8)
    part = 0.5 * (nodes + 1.0)
    width = np.diff(radius)[:, None]
    r = radius[:-1, None] + width * part
    to_side = np.arccos(np.minimum(half_width / r, 1.0))
    to_edge = np.arcsin(np.minimum(half_height / r, 1.0))
    ring = 4.0 * r * np.maximum(to_edge - to_side, 0.0) * 0.5 * weights * width
    areas = np.zeros_like(radius)
    areas[1:] += np.sum(ring * part, axis=1)
    areas[:-1] += np.sum(ring * (1.0 - part), axis=1)
    return np.maximum(areas, 1e-300)


def _camera_times(setup: Setup, latest: float) -> FloatArray:
    """Nodes of camera time from the shortest way back: evenly, or in growing steps when the gate is long."""
    target, water = setup.target, setup.water
    shortest = (target.distance - setup.receiver.z) / water.group_velocity
    longest = latest - target.distance / water.group_velocity
    if not math.isfinite(latest) or longest <= shortest:
        return np.array([shortest])
    first, length = setup.gate.sigma / STEPS_PER_SIGMA, longest - shortest
    steps = np.minimum(
        first * STEP_GROWTH ** np.arange(MOST_TIMES - 1), setup.gate.sigma / FEWEST_STEPS_PER_SIGMA
    )
    growth = 1.0
    while steps.sum() < length:  # a short pulse and a long gate: coarser than wanted
        growth *= 1.005
        steps = first * growth ** np.arange(MOST_TIMES - 1)
    times = shortest + np.concatenate(([0.0], np.cumsum(steps)))
    return np.asarray(times[: int(np.searchsorted(times, longest)) + 1])


def gate_matrix(setup: Setup, axes: MapAxes) -> FloatArray:
    """Return the gate's share (times, impulse bins) of light on the target, for each camera time."""
    if not math.isfinite(setup.gate.opens):
        return np.ones((axes.times.size, axes.impulse_bins))
    arrival = axes.impulse_start + axes.impulse_width * np.arange(axes.impulse_bins)
    total = (axes.times[:, None] + arrival[None, :]).ravel()
    return np.asarray(_shares_at(setup, total).reshape(axes.times.size, axes.impulse_bins))


def gate_table(setup: Setup, axes: MapAxes, direct: DirectLight) -> tuple[float, float, FloatArray]:
    """Return start, step and the gate's shares (arrivals, times) of direct light, by its arrival there.

    The arrivals are even steps over those that occur on the target, two at least.
    """
    start, last = float(direct.time.min()), float(direct.time.max())
    step = setup.gate.sigma / TABLE_STEPS_PER_SIGMA
    count = int((last - start) / step) + 2
    if not math.isfinite(setup.gate.opens):
        return start, step, np.ones((count, axes.times.size), dtype=np.float32)
    arrivals = start + step * np.arange(count)
    total = (arrivals[:, None] + axes.times[None, :]).ravel()
    return start, step, _shares_at(setup, total).reshape(count, -1).astype(np.float32)


@cached_kernel
def _shares_at(setup: Any, arrivals: Any) -> Any:
    shares = np.empty(arrivals.shape[0])
    for i in range(arrivals.shape[0]):
        shares[i] = gate_share(setup.gate, arrivals[i])
    return shares


@device
def _times_last(table: Any) -> Any:
    """Return a table (materials, times, places) as float32 (materials, places · times)."""
    materials, times, places = table.shape
    turned = np.empty((materials, places * times), dtype=np.float32)
    for material in range(materials):
        for place in range(places):
            for n in range(times):
                turned[material, place * times + n] = table[material, n, place]
    return turned


@device
def _add_between(line: Any, table: Any, place: Any, amount: Any) -> None:
    """Add ``amount`` times a table (places · line's length) to a line, linear between places."""
    inner = int(place)
    times, outer, part = line.shape[0], np.float32(place - inner), np.float32(amount)
    here, beyond = np.uint64(inner * times), np.uint64((inner + 1) * times)
    for n in range(np.uint64(times)):
        line[n] += part * (table[here + n] + outer * (table[beyond + n] - table[here + n]))


@cached_kernel
def gated_radiance(
    setup: Any, axes: MapAxes, table: Any, direct: DirectLight, coverage: Any, rings: Any, late: Any
) -> Any:
    """Return the gated radiance (rows, times, columns), float32, and the picture of scattered light.

    ``table`` is that of `gate_table`; ``rings`` (2, times, rings) and ``late`` (2, times, nodes, nodes)
    are the gated light on the target per packet; the picture is of light scattered on its way to the
    target and seen unscattered. All tables are turned so that times stand side by side: that loop
    vectorises (2 times as fast as one over columns, which has to gather).
    """
    rows, columns = coverage.shape
    target, times, nodes = setup.target, axes.times.shape[0], direct.reach.shape[2]
    start, step, shares = table
    radiance = np.empty((rows, times, columns), dtype=np.float32)
    picture = np.zeros((rows, columns))
    side = axes.cells + 1
    by_ring, by_node = _times_last(rings), _times_last(late.reshape(2, times, side * side))
    returned = np.empty((2, side * times), dtype=np.float32)
    gate = shares.ravel()
    touched = late.any()
    line = np.empty(times, dtype=np.float32)
    for row in range(rows):
        y = (2.0 * (row + 0.5) / rows - 1.0) * target.half_height
        down = (row + 0.5) / rows * axes.cells
        for material in range(2):
            returned[material] = 0.0
            _add_between(returned[material], by_node[material], down, 1.0)
        for column in range(columns):
            x = (2.0 * (column + 0.5) / columns - 1.0) * target.half_width
            ring, outer = ring_of(axes.radii, math.sqrt(x * x + y * y))
            figure = coverage[row, column] / math.pi
            ground = (1.0 - coverage[row, column]) / math.pi
            line[:] = 0.0
            _add_between(line, by_ring[0], ring + outer, figure)
            _add_between(line, by_ring[1], ring + outer, ground)
            if touched:
                across = (column + 0.5) / columns * axes.cells
                _add_between(line, returned[0], across, figure)
                _add_between(line, returned[1], across, ground)
            for n in range(nodes):
                picture[row, column] += direct.reach[row, column, n] * line[n]
            straight = figure * direct.lit[0, row, column] + ground * direct.lit[1, row, column]
            _add_between(line, gate, (direct.time[row, column] - start) / step, straight)
            for n in range(times):
                radiance[row, n, column] = line[n]
    return radiance, picture
