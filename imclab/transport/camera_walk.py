"""Walks from the camera: light of the target that the water has scattered on its way back.

The water is the same everywhere across, so a walk that leaves an aperture point a in a direction can
be moved sideways without changing its probability: begun at a + d, it looks at the pixel moved by d and
ends on the target moved by d. One walk therefore serves every pixel whose line of sight, in the walk's
first direction, comes from the aperture disc: thousands of pixels at the price of one walk and one
addition each. The mean is exact; see `docs/estimators.md`.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imclab.transport.direct_light import DirectLight
from imclab.transport.even_points import advance, coordinate, first_point
from imclab.transport.gathering import time_bin
from imclab.transport.kernel_cache import cached_kernel, device
from imclab.transport.light_walk import (
    MOST_EVENTS,
    ROULETTE_CHANCE,
    ROULETTE_WEIGHT,
    MapAxes,
    ring_of,
)
from imclab.transport.random import uniforms
from imclab.transport.scattering import sample_deviation, turn

CAMERA_STREAM = 21
FIRST_FLIGHT = 0.3
"""Attenuation by which the first flight is drawn, over the water's.

What is scattered at a depth s reaches the target with exp(−c (depth − s)), so all depths count much the
same: 0.3 instead of 1 halves the variance at optical depth 4 and changes little at 0.42."""
EVEN_COLLISIONS = 3
"""Collisions whose numbers are spread evenly over a batch, three for each; the line of sight and the first
flight take the other three."""


class CameraTally(NamedTuple):
    """Sums over walks: the picture of scattered target light, and what the time histogram needs.

    Attributes
    ----------
    picture : float32 array (rows, columns)
    impulses : array (2 materials, impulse bins, rings)
        Energy gathered from a target of unit diffuse irradiance in each ring, by camera time.
    times : array (impulse bins of the set-up)
        Light of the target lit without scattering, by time of arrival.
    """

    picture: NDArray[np.float64]
    impulses: NDArray[np.float64]
    times: NDArray[np.float64]


@device
def span(centre: Any, radius: Any, half_size: Any, pitch: Any, inside: Any) -> Any:
    """Return first and last index (exclusive) of points (i + inside) pitch − half_size within a radius."""
    low = math.ceil((centre - radius + half_size) / pitch - inside)
    high = math.floor((centre + radius + half_size) / pitch - inside) + 1.0
    most = 2.0 * half_size / pitch + 0.5
    return int(min(max(low, 0.0), most)), int(min(max(high, 0.0), most))


@device
def _add_moved(
    setup: Any, radiance: Any, picture: Any, centre: Any, inside: Any, moved: Any, node: Any, energy: Any
) -> None:
    """Add the target's radiance, seen ``moved`` across, to all pixels that share one walk.

    ``centre`` is where the walk's first direction through the middle of the aperture meets the object
    plane, ``inside`` the place in a cell (0 to 1) that is looked at, ``node`` that of the camera time.
    ``radiance`` (rows · times · columns) and ``picture`` (rows · columns) are flat and counted by unsigned
    numbers: a signed one might be negative, and checking that kept the loop from vectorising (2 times).
    """
    target, radius = setup.target, setup.receiver.radius
    rows, columns, times = picture.shape[0], picture.shape[1], radiance.shape[1]
    pitch_x, pitch_y = 2.0 * target.half_width / columns, 2.0 * target.half_height / rows
    shift_y, shift_x = math.floor(inside[1] + moved[1] / pitch_y), math.floor(inside[0] + moved[0] / pitch_x)
    if abs(shift_y) >= rows or abs(shift_x) >= columns:
        return
    down, right = int(shift_y), int(shift_x)
    top, bottom = span(centre[1], radius, target.half_height, pitch_y, inside[1])
    seen, source, part = picture.ravel(), radiance.ravel(), np.float32(energy)
    for row in range(max(top, -down), min(bottom, rows - down)):
        height = (row + inside[1]) * pitch_y - target.half_height - centre[1]
        half = math.sqrt(max(radius * radius - height * height, 0.0))
        left, end = span(centre[0], half, target.half_width, pitch_x, inside[0])
        left, end = max(left, -right), min(end, columns - right)
        here = np.uint64(row * columns + left)
        there = np.uint64(((row + down) * times + node) * columns + left + right)
        for k in range(np.uint64(max(end - left, 0))):
            seen[here + k] += part * source[there + k]


@device
def _time_node(times: Any, time: Any, u: Any) -> Any:
    """Choose one of the two nodes around a time, so that the mean over ``u`` interpolates linearly.

    −1 after the last.
    """
    last = times.shape[0] - 1
    if last == 0 or time <= times[0]:
        return 0
    if time >= times[last]:
        return -1
    node = np.searchsorted(times, time, side="right") - 1
    return node + 1 if u < (time - times[node]) / (times[node + 1] - times[node]) else node


@device
def _score_times(
    setup: Any, axes: Any, direct: Any, coverage: Any, tally: Any, places: Any, energy: Any, time: Any
) -> None:
    """Enter one landing, seen by one point of the aperture, into the time tallies.

    ``places`` are (x, y) of the point looked at and of the landing.
    """
    target = setup.target
    (x, y), (x_land, y_land) = places
    if abs(x) >= target.half_width or abs(y) >= target.half_height:
        return
    if abs(x_land) >= target.half_width or abs(y_land) >= target.half_height:
        return
    rows, columns = coverage.shape
    row = int((y_land / target.half_height + 1.0) * 0.5 * rows)
    column = int((x_land / target.half_width + 1.0) * 0.5 * columns)
    figure = energy * coverage[row, column] / math.pi
    ground = energy * (1.0 - coverage[row, column]) / math.pi
    bin_ = time_bin(setup.time, direct.time[row, column] + time)
    if bin_ >= 0:
        tally.times[bin_] += figure * direct.lit[0, row, column] + ground * direct.lit[1, row, column]
    place = (time - axes.times[0]) / axes.impulse_width
    if place < axes.impulse_bins - 1:
        bin_ = int(place)
        ring, outer = ring_of(axes.radii, math.sqrt(x_land * x_land + y_land * y_land))
        later = place - bin_
        for step in range(2):
            share = later if step else 1.0 - later
            tally.impulses[0, bin_ + step, ring] += figure * share * (1.0 - outer)
            tally.impulses[0, bin_ + step, ring + 1] += figure * share * outer
            tally.impulses[1, bin_ + step, ring] += ground * share * (1.0 - outer)
            tally.impulses[1, bin_ + step, ring + 1] += ground * share * outer


@cached_kernel
def camera_walks(
    setup: Any,
    axes: MapAxes,
    direct: DirectLight,
    coverage: Any,
    radiance: Any,
    seed: Any,
    first: Any,
    count: int,
) -> CameraTally:
    """Return sums over ``count`` walks: the picture of light scattered between target and camera.

    Parameters
    ----------
    setup : Setup
    axes : MapAxes
    direct : DirectLight
    coverage : array (rows, columns)
        Share of figure in each cell.
    radiance : float32 array (rows, times, columns)
        Gated radiance of the target for each camera time, 1/(m² sr) per joule of pulse.
    """
    water, target, receiver = setup.water, setup.target, setup.receiver
    rows, columns = coverage.shape
    tally = CameraTally(
        np.zeros((rows, columns), dtype=np.float32),
        np.zeros((2, axes.impulse_bins, axes.radii.shape[0])),
        np.zeros(setup.time.bins),
    )
    reach = target.distance - receiver.z
    wide, high = 2.0 * (target.half_width + receiver.radius), 2.0 * (target.half_height + receiver.radius)
    cell = 4.0 * target.half_width * target.half_height / (rows * columns)
    disc_cells = math.pi * receiver.radius**2 / cell
    mean_free_path = 1.0 / max(water.attenuation, 1e-30)
    rate = max(FIRST_FLIGHT * water.attenuation, 1e-30)
    farthest = math.inf
    if axes.times.shape[0] > 1:
        farthest = axes.times[-1] * water.group_velocity
    even = first_point(seed, first, CAMERA_STREAM + 2)
    for i in range(count):
        advance(even, i)
        history = first + np.uint64(i)
        inside_x, inside_y, u_radius, u_angle = uniforms(seed, history, 0, CAMERA_STREAM)
        centre = (wide * (coordinate(even, 0) - 0.5), high * (coordinate(even, 1) - 0.5))
        slope_x, slope_y = (centre[0] - receiver.x) / reach, (centre[1] - receiver.y) / reach
        cosine = 1.0 / math.sqrt(1.0 + slope_x * slope_x + slope_y * slope_y)
        if cosine < receiver.cos_half_view:
            continue
        direction = (slope_x * cosine, slope_y * cosine, cosine)
        into = -math.expm1(-rate * reach / cosine)
        free = -math.log1p(-coordinate(even, 2) * into) / rate
        weight = cell * cosine**4 * wide * high / (reach * reach)
        weight *= into * water.attenuation / rate * math.exp((rate - water.attenuation) * free)
        floor = ROULETTE_WEIGHT * weight
        inside = (inside_x, inside_y)
        radius, angle = receiver.radius * math.sqrt(u_radius), 2.0 * math.pi * u_angle
        looked_at = (centre[0] + radius * math.cos(angle), centre[1] + radius * math.sin(angle))
        x, y, z, path = 0.0, 0.0, receiver.z, 0.0
        for event in range(2, MOST_EVENTS):
            x, y, z = x + free * direction[0], y + free * direction[1], z + free * direction[2]
            path += free
            weight *= water.albedo
            u_scatter, u_azimuth, u_node, u_free = uniforms(seed, history, event, CAMERA_STREAM)
            if event < 2 + EVEN_COLLISIONS:
                u_scatter, u_azimuth = coordinate(even, 3 * event - 3), coordinate(even, 3 * event - 2)
                u_free = coordinate(even, 3 * event - 1)
            angle = 2.0 * math.pi * u_azimuth
            deviation = sample_deviation(setup.phase, u_scatter)
            direction = turn(direction, deviation, math.sin(angle), math.cos(angle))
            if weight < floor:
                dice, _, _, _ = uniforms(seed, history, event, CAMERA_STREAM + 1)
                if weight == 0.0 or dice > ROULETTE_CHANCE:
                    break
                weight /= ROULETTE_CHANCE
            # not the way ahead but the shortest: a grazing walk may yet be turned toward the target
            if path + (target.distance - z) > farthest:
                break
            way = 1e30
            if direction[2] > 0.0:
                way = (target.distance - z) / direction[2]
                time = (path + way) / water.group_velocity
                node = _time_node(axes.times, time, u_node)
                moved = (x + way * direction[0] - slope_x * reach, y + way * direction[1] - slope_y * reach)
                energy = weight * math.exp(-water.attenuation * way)
                if node >= 0:
                    _add_moved(setup, radiance, tally.picture, centre, inside, moved, node, energy)
                if node >= 0 and setup.time.bins > 0:
                    landing = (looked_at[0] + moved[0], looked_at[1] + moved[1])
                    _score_times(
                        setup, axes, direct, coverage, tally, (looked_at, landing), energy * disc_cells, time
                    )
            elif direction[2] < 0.0:
                way = -z / direction[2]
            free = -math.log(u_free) * mean_free_path
            if free >= way:
                break
    return tally
