"""Light on the target, direct and scattered, joined into its gated radiance for every camera time."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from imclab.transport.direct_light import DirectLight
from imclab.transport.gathering import gate_share
from imclab.transport.kernel_cache import cached_kernel
from imclab.transport.light_walk import MapAxes, ring_of
from imclab.transport.setup import Setup

FloatArray = NDArray[np.float64]

MOST_TIMES = 64
STEPS_PER_SIGMA = 24.0
TABLE_STEPS_PER_SIGMA = 64.0
RINGS_PER_BEAM = 48.0
RING_GROWTH = 0.03
COARSE_CELLS = 24
MOST_IMPULSE_BINS = 2000


def map_axes(setup: Setup, latest: float) -> MapAxes:
    """Lay the nodes of the maps: rings as fine as the beam, camera times as fine as the pulse.

    Linear interpolation between nodes is wrong by h²/8 of the second derivative: 1e-4 of the
    scattered light with `RINGS_PER_BEAM` nodes per standard deviation of the beam (light spread by the
    water has no finer structure), and at most 1e-4 of the gate's share with `STEPS_PER_SIGMA`.
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
    return MapAxes(radius, _tent_areas(radius), times, COARSE_CELLS, *_impulse_axis(setup, latest))


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


def _camera_times(setup: Setup, latest: float) -> FloatArray:
    """Nodes of camera time from the shortest way back: evenly, or in growing steps when the gate is long."""
    target, water = setup.target, setup.water
    shortest = (target.distance - setup.receiver.z) / water.group_velocity
    longest = latest - target.distance / water.group_velocity
    if not math.isfinite(latest) or longest <= shortest:
        return np.array([shortest])
    first, length = setup.gate.sigma / STEPS_PER_SIGMA, longest - shortest
    growth = 1.0
    while _covered(first, growth) < length:
        growth *= 1.005
    times = shortest + np.concatenate(([0.0], np.cumsum(first * growth ** np.arange(MOST_TIMES - 1))))
    return np.asarray(times[: int(np.searchsorted(times, longest)) + 1])


def _covered(first: float, growth: float) -> float:
    steps = MOST_TIMES - 1
    return first * steps if growth == 1.0 else first * (growth**steps - 1.0) / (growth - 1.0)


def gate_matrix(setup: Setup, axes: MapAxes) -> FloatArray:
    """Return the gate's share (times, impulse bins) of light on the target, for each camera time."""
    if not math.isfinite(setup.gate.opens):
        return np.ones((axes.times.size, axes.impulse_bins))
    arrival = axes.impulse_start + axes.impulse_width * np.arange(axes.impulse_bins)
    total = (axes.times[:, None] + arrival[None, :]).ravel()
    return np.asarray(_shares_at(setup, total).reshape(axes.times.size, axes.impulse_bins))


def gate_table(setup: Setup, axes: MapAxes, direct: DirectLight) -> tuple[float, float, FloatArray]:
    """Return start, step and shares of the gate, tabulated over all arrivals of direct light."""
    if not math.isfinite(setup.gate.opens):
        return 0.0, 1.0, np.ones(0)
    step = setup.gate.sigma / TABLE_STEPS_PER_SIGMA
    start = float(direct.time.min() + axes.times[0]) - step
    count = int((direct.time.max() + axes.times[-1] - start) / step) + 3
    return start, step, _shares_at(setup, start + step * np.arange(count))


@cached_kernel
def _shares_at(setup: Any, arrivals: Any) -> Any:
    shares = np.empty(arrivals.shape[0])
    for i in range(arrivals.shape[0]):
        shares[i] = gate_share(setup.gate, arrivals[i])
    return shares


@cached_kernel
def gated_radiance(
    setup: Any, axes: MapAxes, table: Any, direct: DirectLight, coverage: Any, rings: Any, late: Any
) -> Any:
    """Return the gated radiance (times, rows, columns), float32, and the picture of scattered light.

    ``table`` is that of `gate_table`; ``rings`` (2, times, rings) and ``late`` (2, times, cells, cells)
    are the gated light on the target per packet; the picture is of light scattered on its way to the
    target and seen unscattered.
    """
    rows, columns = coverage.shape
    target, times = setup.target, axes.times
    start, step, shares = table
    radiance = np.empty((times.shape[0], rows, columns), dtype=np.float32)
    picture = np.zeros((rows, columns))
    ring, outer = np.empty(columns, dtype=np.int64), np.empty(columns)
    figure, ground = np.empty(columns), np.empty(columns)
    straight, place = np.empty(columns), np.empty(columns)
    scattered, previous = np.empty(columns), np.empty(columns)
    last_seen = np.searchsorted(times, direct.return_time.max()) + 1
    for row in range(rows):
        y = (2.0 * (row + 0.5) / rows - 1.0) * target.half_height
        coarse_row = int((row + 0.5) / rows * axes.cells)
        for column in range(columns):
            x = (2.0 * (column + 0.5) / columns - 1.0) * target.half_width
            ring[column], outer[column] = ring_of(axes.radii, math.sqrt(x * x + y * y))
            figure[column] = coverage[row, column] / math.pi
            ground[column] = (1.0 - coverage[row, column]) / math.pi
            straight[column] = figure[column] * direct.lit[0, row, column]
            straight[column] += ground[column] * direct.lit[1, row, column]
            scattered[column] = previous[column] = 0.0
        for n in range(times.shape[0]):
            for column in range(columns):
                coarse_column = int((column + 0.5) / columns * axes.cells)
                inner, outside = ring[column], outer[column]
                on_figure = rings[0, n, inner] + outside * (rings[0, n, inner + 1] - rings[0, n, inner])
                on_ground = rings[1, n, inner] + outside * (rings[1, n, inner + 1] - rings[1, n, inner])
                on_figure += late[0, n, coarse_row, coarse_column]
                on_ground += late[1, n, coarse_row, coarse_column]
                place[column] = figure[column] * on_figure + ground[column] * on_ground
            for column in range(columns):
                share = 1.0
                if shares.shape[0] > 0:
                    moment = (direct.time[row, column] + times[n] - start) / step
                    index = int(moment)
                    share = shares[index] + (moment - index) * (shares[index + 1] - shares[index])
                radiance[n, row, column] = straight[column] * share + place[column]
            if n <= last_seen:
                before, width = times[max(n - 1, 0)], times[n] - times[max(n - 1, 0)]
                for column in range(columns):
                    later = 1.0
                    if n > 0:
                        later = min(max((direct.return_time[row, column] - before) / width, 0.0), 1.0)
                    scattered[column] += later * (place[column] - previous[column])
                    previous[column] = place[column]
        for column in range(columns):
            picture[row, column] = scattered[column] * direct.reach[row, column]
    return radiance, picture
