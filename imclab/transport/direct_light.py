"""What is computed instead of sampled: the unscattered light on the target and in the picture.

Integrals over the laser's spot use Gauss-Hermite points, those over the aperture a product rule for
the disc, those over a cell of the picture 2 × 2 Gauss points.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imclab.transport.beam_field import beam_irradiance
from imclab.transport.gathering import gate_share, time_bin
from imclab.transport.kernel_cache import cached_kernel, device
from imclab.transport.light_walk import diffuse_albedo
from imclab.transport.setup import Setup

FloatArray = NDArray[np.float64]

_GAUSS_2 = 0.5 / math.sqrt(3.0)
MOST_PARTS = 64
BEAM_REACH = 7.0
"""Standard deviations of the beam beyond which its light is nothing: cells there are not cut."""


class Rules(NamedTuple):
    """Quadrature points: of the spot (standard normal) and of the aperture (metres), with weights."""

    spot: FloatArray
    spot_weights: FloatArray
    aperture: FloatArray
    aperture_weights: FloatArray


class DirectLight(NamedTuple):
    """Unscattered light, per joule of pulse.

    Attributes
    ----------
    lit : array (2 materials, rows, columns)
        Irradiance of the target times diffuse albedo, 1/m².
    time : array (rows, columns)
        When it arrives there, s.
    reach : array (rows, columns, nodes)
        Energy that the aperture gathers unscattered from a cell of unit radiance, m² sr, parted among
        the first nodes of camera time: the ways to the points of a wide aperture differ.
    return_time : array (rows, columns)
        Mean time from cell to aperture, s.
    picture : array (rows, columns)
        Gated energy of each cell, unscattered both ways.
    times : array (impulse bins)
        The same, before the gate, by time of arrival.
    """

    lit: FloatArray
    time: FloatArray
    reach: FloatArray
    return_time: FloatArray
    picture: FloatArray
    times: FloatArray


def disc_rule(radius: float, radial: int, around: int) -> tuple[FloatArray, FloatArray]:
    """Return points (n, 2) and weights (n) that integrate over a disc: Gauss in r², even in angle."""
    nodes, weights = np.polynomial.legendre.leggauss(radial)
    radii = radius * np.sqrt(0.5 * (nodes + 1.0))
    angles = 2.0 * np.pi * (np.arange(around) + 0.5) / around
    points = np.stack([np.outer(radii, np.cos(angles)), np.outer(radii, np.sin(angles))], axis=-1)
    areas = np.repeat(0.5 * weights * np.pi * radius * radius / around, around)
    return np.ascontiguousarray(points.reshape(-1, 2)), areas


def rules_for(setup: Setup) -> Rules:
    """Choose rules fine enough for the scene's spot and aperture."""
    spread = setup.target.distance * setup.beam.divergence_sigma
    order = 3 if setup.beam.spot_sigma < 0.05 * spread else 9
    nodes, weights = np.polynomial.hermite_e.hermegauss(order)
    weights = weights / weights.sum()
    grid_x, grid_y = np.meshgrid(nodes, nodes)
    spot = np.stack([grid_x.ravel(), grid_y.ravel()], axis=-1)
    receiver = setup.receiver
    small = receiver.radius < 0.03 * (setup.target.distance - receiver.z)
    unlimited = receiver.cos_half_view < 0.1
    aperture, areas = disc_rule(receiver.radius, *((2, 5) if small and unlimited else (8, 17)))
    return Rules(np.ascontiguousarray(spot), np.outer(weights, weights).ravel(), aperture, areas)


def nodes_reached(setup: Setup, times: FloatArray) -> int:
    """Return how many nodes of camera time light from the target to the aperture can need."""
    target, receiver = setup.target, setup.receiver
    across = math.hypot(
        target.half_width + abs(receiver.x) + receiver.radius,
        target.half_height + abs(receiver.y) + receiver.radius,
    )
    longest = math.hypot(across, target.distance - receiver.z) / setup.water.group_velocity
    return min(int(np.searchsorted(times, longest)) + 1, times.size)


def finer(setup: Setup, shape: tuple[int, int]) -> int:
    """Return into how many parts along each side cells in the beam are cut: two to a standard deviation."""
    beam, target = setup.beam, setup.target
    width = math.hypot(beam.spot_sigma, target.distance * beam.divergence_sigma)
    cell = max(2.0 * target.half_height / shape[0], 2.0 * target.half_width / shape[1])
    return min(max(math.ceil(2.0 * cell / max(width, 1e-12)), 1), MOST_PARTS)


@cached_kernel
def direct_light(
    setup: Any, rules: Rules, coverage: Any, times_back: Any, nodes: int, parts: int
) -> DirectLight:
    """Compute the unscattered light for a grid of cells over the target, of which a share is figure.

    ``times_back`` are the nodes of camera time (see `MapAxes`), ``nodes`` how many of them are needed,
    ``parts`` is that of `finer`.
    """
    rows, columns = coverage.shape
    lit = np.zeros((2, rows, columns))
    time, reach = np.zeros((rows, columns)), np.zeros((rows, columns, nodes))
    return_time, picture = np.zeros((rows, columns)), np.zeros((rows, columns))
    times = np.zeros(setup.time.bins)
    target = setup.target
    cell = 4.0 * target.half_width * target.half_height / (rows * columns)
    width = math.hypot(setup.beam.spot_sigma, target.distance * setup.beam.divergence_sigma)
    in_beam = BEAM_REACH * width + math.hypot(
        2.0 * target.half_width / columns, 2.0 * target.half_height / rows
    )
    for row in range(rows):
        for column in range(columns):
            middle_x = (2.0 * (column + 0.5) / columns - 1.0) * target.half_width
            middle_y = (2.0 * (row + 0.5) / rows - 1.0) * target.half_height
            cut = parts if math.hypot(middle_x, middle_y) < in_beam else 1
            share = 0.25 / (cut * cut)
            for corner in range(4 * cut * cut):
                part, quarter = corner // 4, corner % 4
                inside_x = (part % cut + 0.5 + _GAUSS_2 * (2 * (quarter % 2) - 1)) / cut
                inside_y = (part // cut + 0.5 + _GAUSS_2 * (2 * (quarter // 2) - 1)) / cut
                x = (2.0 * (column + inside_x) / columns - 1.0) * target.half_width
                y = (2.0 * (row + inside_y) / rows - 1.0) * target.half_height
                figure, ground, arrival = _irradiance(setup, rules, x, y)
                lit[0, row, column] += share * figure
                lit[1, row, column] += share * ground
                time[row, column] += share * arrival
                by_time = reach[row, column]
                seen, back, gated = _gathered(
                    setup, rules, (x, y), arrival, times_back, share * cell, by_time
                )
                return_time[row, column] += share * back
                radiance = ground + coverage[row, column] * (figure - ground)
                radiance *= share * cell / math.pi
                picture[row, column] += radiance * gated
                bin_ = time_bin(setup.time, arrival + back)
                if bin_ >= 0:
                    times[bin_] += radiance * seen
    return DirectLight(lit, time, reach, return_time, picture, times)


@device
def _irradiance(setup: Any, rules: Any, x: Any, y: Any) -> Any:
    """Return irradiance times diffuse albedo of figure and ground at a point, and the mean time."""
    target, water, z = setup.target, setup.water, setup.target.distance
    figure = ground = total = moment = 0.0
    for i in range(rules.spot.shape[0]):
        value, direction, way = beam_irradiance(setup.beam, (x, y, z), rules.spot[i, 0], rules.spot[i, 1])
        value *= rules.spot_weights[i] * direction[2] * math.exp(-water.attenuation * way)
        figure += value * diffuse_albedo(target.figure, direction[2])
        ground += value * diffuse_albedo(target.ground, direction[2])
        total += value
        moment += value * way
    mean_way = moment / total if total > 0.0 else math.sqrt(x * x + y * y + z * z)
    return figure, ground, mean_way / water.group_velocity


@device
def _gathered(
    setup: Any, rules: Any, place: Any, arrival: Any, times_back: Any, cell: Any, parts: Any
) -> Any:
    """Return the aperture's integral for a point of unit radiance, its mean time, the gated integral.

    The integral times ``cell`` (m²) is also added to ``parts``, by node of camera time.
    """
    receiver, water = setup.receiver, setup.water
    depth = setup.target.distance - receiver.z
    x, y = place
    seen = moment = gated = 0.0
    for i in range(rules.aperture.shape[0]):
        dx = x - receiver.x - rules.aperture[i, 0]
        dy = y - receiver.y - rules.aperture[i, 1]
        square = dx * dx + dy * dy + depth * depth
        way = math.sqrt(square)
        if depth < receiver.cos_half_view * way:
            continue
        value = rules.aperture_weights[i] * depth * depth / (square * square)
        value *= math.exp(-water.attenuation * way)
        seen += value
        moment += value * way
        _part_in_time(times_back, way / water.group_velocity, value * cell, parts)
        gated += value * gate_share(setup.gate, arrival + way / water.group_velocity)
    straight = math.sqrt((x - receiver.x) ** 2 + (y - receiver.y) ** 2 + depth * depth)
    mean_way = moment / seen if seen > 0.0 else straight
    return seen, mean_way / water.group_velocity, gated


@device
def _part_in_time(times: Any, time: Any, value: Any, parts: Any) -> None:
    """Add a value to the two nodes around a time, so that linear interpolation is made up for.

    What is later than the last node comes when the gate has closed: it counts nowhere.
    """
    last = times.shape[0] - 1
    if last == 0 or time <= times[0]:
        parts[0] += value
    elif time < times[last]:
        node = np.searchsorted(times, time, side="right") - 1
        later = (time - times[node]) / (times[node + 1] - times[node])
        parts[node] += value * (1.0 - later)
        parts[node + 1] += value * later


def coverage_of(mask: NDArray[np.uint8], rows: int, columns: int) -> FloatArray:
    """Return the share of figure in each cell of a grid laid over the mask, exact for any sizes."""
    shares = _overlap(rows, mask.shape[0]) @ mask.astype(np.float64) @ _overlap(columns, mask.shape[1]).T
    return np.ascontiguousarray(np.clip(shares, 0.0, 1.0))


def _overlap(cells: int, pixels: int) -> FloatArray:
    cell, pixel = np.arange(cells)[:, None], np.arange(pixels)[None, :]
    high = np.minimum((cell + 1) * pixels / cells, pixel + 1)
    low = np.maximum(cell * pixels / cells, pixel)
    return np.asarray(np.clip(high - low, 0.0, None) * cells / pixels)
