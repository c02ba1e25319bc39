"""Walks from the camera joined with the beam: light that comes back without having met the target.

Every stretch of a walk is joined once with the unscattered beam, at a place drawn for the join alone.
The beam's irradiance grows as 1/r² toward the laser, and a receiver on the laser looks right through
that place; the join is therefore drawn evenly in the angle seen from the laser, in the logarithm of
distance, and with the attenuation, weighted by the mean of the three densities (balance heuristic,
Veach 1997, section 9.2), so that no join weighs much more than another.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from imclab.transport.beam_field import beam_irradiance
from imclab.transport.gathering import gate_share, time_bin
from imclab.transport.kernel_cache import cached_kernel, device
from imclab.transport.random import uniforms
from imclab.transport.scattering import phase_density, sample_deviation, turn

BACKSCATTER_STREAM = 31
ROULETTE_WEIGHT = 0.02
ROULETTE_CHANCE = 0.2
MOST_EVENTS = 100_000
TURN_TO_LASER = 0.25
"""Chance of drawing a scattered direction around the way back to the laser instead of the flight's.

Where light is turned back far from the laser and then scattered ahead, the join sees the forward peak
of the phase function after a rare event; drawing toward the laser makes the event frequent."""


@device
def deviation_of(u: Any, v: Any) -> Any:
    """Return 1 − u·v of two unit vectors without losing the digits of small angles."""
    x, y, z = u[0] - v[0], u[1] - v[1], u[2] - v[2]
    return min(0.5 * (x * x + y * y + z * z), 2.0)


@device
def _join_place(origin: Any, direction: Any, limits: Any, scales: Any, u: Any) -> Any:
    """Draw a distance along a ray for the join with the beam; return it and its density.

    ``limits`` are the first and last distance wanted, ``scales`` (attenuation of both ways, 1/m;
    length that separates near from far, m).
    """
    first, last = limits
    length = last - first
    rate = max(scales[0], 1e-6 / length)
    near = scales[1]
    closest = -(origin[0] * direction[0] + origin[1] * direction[1] + origin[2] * direction[2])
    square = origin[0] ** 2 + origin[1] ** 2 + origin[2] ** 2 - closest * closest
    height = max(math.sqrt(max(square, 0.0)), 0.1 * near)
    low, high = math.atan((first - closest) / height), math.atan((last - closest) / height)
    fall = -math.expm1(-rate * length)
    ratio = math.log((last + near) / (first + near))
    choice = 3.0 * u
    if choice < 1.0:
        place = closest + height * math.tan(low + choice * (high - low))
    elif choice < 2.0:
        place = first - math.log1p(-(choice - 1.0) * fall) / rate
    else:
        place = (first + near) * math.exp((choice - 2.0) * ratio) - near
    place = min(max(place, first), last)
    density = height / ((high - low) * (height * height + (place - closest) ** 2))
    density += rate * math.exp(-rate * (place - first)) / fall
    density += 1.0 / (ratio * (place + near))
    return place, density / 3.0


@device
def _arrival_limits(setup: Any, origin: Any, direction: Any, path: Any, length: Any) -> Any:
    """Return the part of a stretch whose light, straight from the laser, arrives while the gate is open.

    s + |origin + s u| = T has the root (T² − |o|²)/(2 (T + o·u)).
    """
    first, last = 0.0, length
    if setup.gate.opens == -math.inf:
        return first, last
    margin = 6.0 * setup.gate.sigma
    square = origin[0] ** 2 + origin[1] ** 2 + origin[2] ** 2
    along = origin[0] * direction[0] + origin[1] * direction[1] + origin[2] * direction[2]
    soonest = (setup.gate.opens - margin) * setup.water.group_velocity - path
    latest = (setup.gate.closes + margin) * setup.water.group_velocity - path
    if soonest > 0.0 and soonest * soonest > square:
        first = (soonest * soonest - square) / (2.0 * (soonest + along))
    if latest <= 0.0 or latest * latest <= square:
        return first, -1.0
    return first, min(last, (latest * latest - square) / (2.0 * (latest + along)))


@device
def _join(setup: Any, origin: Any, direction: Any, stretch: Any, draw: Any) -> Any:
    """Return energy and arrival time of one join of a stretch of a walk with the beam.

    ``stretch`` is (length of the stretch, path before it, weight); ``draw`` (seed, history, event).
    """
    length, path, weight = stretch
    first, last = _arrival_limits(setup, origin, direction, path, length)
    if not last > first:
        return 0.0, 0.0
    water = setup.water
    u0, u1, u2, _ = uniforms(draw[0], draw[1], draw[2], BACKSCATTER_STREAM + 1)
    scales = (2.0 * water.attenuation, setup.receiver.radius)
    place, density = _join_place(origin, direction, (first, last), scales, u0)
    point = (
        origin[0] + place * direction[0],
        origin[1] + place * direction[1],
        origin[2] + place * direction[2],
    )
    if point[2] <= 0.0:
        return 0.0, 0.0
    size, angle = math.sqrt(-2.0 * math.log(u1)), 2.0 * math.pi * u2
    irradiance, travel, distance = beam_irradiance(
        setup.beam, point, size * math.cos(angle), size * math.sin(angle)
    )
    back = (-direction[0], -direction[1], -direction[2])
    energy = weight * water.scattering * math.exp(-water.attenuation * (place + distance)) / density
    energy *= irradiance * phase_density(setup.phase, deviation_of(travel, back))
    return energy, (path + place + distance) / water.group_velocity


@device
def _new_direction(setup: Any, point: Any, direction: Any, turned: Any, draws: Any) -> Any:
    """Draw a scattered direction, perhaps around the way to the laser; return it, its weight, the choice."""
    u_choice, u_scatter, u_azimuth = draws
    sine, cosine = math.sin(2.0 * math.pi * u_azimuth), math.cos(2.0 * math.pi * u_azimuth)
    deviation = sample_deviation(setup.phase, u_scatter)
    if turned:
        return turn(direction, deviation, sine, cosine), 1.0, True
    away = 1.0 / math.sqrt(point[0] ** 2 + point[1] ** 2 + point[2] ** 2)
    home = (-point[0] * away, -point[1] * away, -point[2] * away)
    homeward = u_choice < TURN_TO_LASER
    leaving = turn(home if homeward else direction, deviation, sine, cosine)
    wanted = phase_density(setup.phase, deviation_of(direction, leaving))
    drawn = TURN_TO_LASER * phase_density(setup.phase, deviation_of(home, leaving))
    return leaving, wanted / ((1.0 - TURN_TO_LASER) * wanted + drawn), homeward


@device
def line_of_sight(setup: Any, u: Any) -> Any:
    """Draw a point of the picture and one of the aperture; return aperture point, direction, weight, cell."""
    target, receiver = setup.target, setup.receiver
    across, down = min(u[0], 1.0 - 1e-12), min(u[1], 1.0 - 1e-12)
    radius, angle = receiver.radius * math.sqrt(u[2]), 2.0 * math.pi * u[3]
    x, y = receiver.x + radius * math.cos(angle), receiver.y + radius * math.sin(angle)
    dx = (2.0 * across - 1.0) * target.half_width - x
    dy = (2.0 * down - 1.0) * target.half_height - y
    dz = target.distance - receiver.z
    inverse = 1.0 / math.sqrt(dx * dx + dy * dy + dz * dz)
    cosine = dz * inverse
    weight = 4.0 * target.half_width * target.half_height * math.pi * receiver.radius**2
    weight *= cosine**4 / (dz * dz)
    if cosine < receiver.cos_half_view:
        weight = 0.0
    cell = int(down * receiver.rows), int(across * receiver.columns)
    return (x, y, receiver.z), (dx * inverse, dy * inverse, cosine), weight, cell


@cached_kernel
def backscatter_walks(
    setup: Any, latest: float, seed: Any, first: Any, count: int, picture: Any, times: Any
) -> None:
    """Add the backscatter of ``count`` walks to a picture and to the impulse time bins, energies summed."""
    water, target = setup.water, setup.target
    mean_free_path = 1.0 / max(water.attenuation, 1e-30)
    for i in range(count):
        history = first + np.uint64(i)
        point, direction, weight, (row, column) = line_of_sight(
            setup, uniforms(seed, history, 0, BACKSCATTER_STREAM)
        )
        floor = ROULETTE_WEIGHT * weight
        path, turned = 0.0, False
        for event in range(1, MOST_EVENTS):
            if weight == 0.0 or path > latest * water.group_velocity:
                break
            if direction[2] > 0.0:
                length = (target.distance - point[2]) / direction[2]
            elif direction[2] < 0.0:
                length = -point[2] / direction[2]
            else:
                length = 1e30
            energy, arrival = _join(setup, point, direction, (length, path, weight), (seed, history, event))
            if energy > 0.0:
                picture[row, column] += energy * gate_share(setup.gate, arrival)
                bin_ = time_bin(setup.time, arrival)
                if bin_ >= 0:
                    times[bin_] += energy
            u_free, u_scatter, u_azimuth, u_choice = uniforms(seed, history, event, BACKSCATTER_STREAM)
            free = -math.log(u_free) * mean_free_path
            if free >= length:
                break
            point = (
                point[0] + free * direction[0],
                point[1] + free * direction[1],
                point[2] + free * direction[2],
            )
            path += free
            direction, factor, turned = _new_direction(
                setup, point, direction, turned, (u_choice, u_scatter, u_azimuth)
            )
            weight *= factor * water.albedo
            if weight < floor:
                dice, _, _, _ = uniforms(seed, history, event, BACKSCATTER_STREAM + 2)
                if dice > ROULETTE_CHANCE:
                    break
                weight /= ROULETTE_CHANCE
