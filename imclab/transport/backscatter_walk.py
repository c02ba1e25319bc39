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

from imclab.transport.beam_field import LEAST_SIGMA, beam_irradiance
from imclab.transport.gathering import gate_share, time_bin
from imclab.transport.kernel_cache import cached_kernel, device
from imclab.transport.random import uniforms
from imclab.transport.scattering import phase_density, sample_deviation, turn
from imclab.transport.setup import PULSE_REACH, Setup

BACKSCATTER_STREAM = 31
ROULETTE_WEIGHT = 0.02
ROULETTE_CHANCE = 0.2
MOST_EVENTS = 100_000
CORE_REACH = 1.5
"""Standard deviations of the pulse by which the open gate is widened where joins are drawn evenly."""
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
def _join_place(origin: Any, direction: Any, limits: Any, core: Any, scales: Any, u: Any) -> Any:
    """Draw a distance along a ray for the join with the beam; return it and its density.

    ``limits`` are the first and last distance wanted, ``core`` those between which the gate is wide
    open, ``scales`` the attenuation of both ways (1/m) and two lengths (m): what separates near from
    far, and the width below which the beam does not narrow.
    """
    first, last = limits
    length = last - first
    rate = max(scales[0], 1e-6 / length)
    near = scales[1]
    closest = -(origin[0] * direction[0] + origin[1] * direction[1] + origin[2] * direction[2])
    square = origin[0] ** 2 + origin[1] ** 2 + origin[2] ** 2 - closest * closest
    height = max(math.sqrt(max(square, 0.0)), scales[2])
    low, high = math.atan((first - closest) / height), math.atan((last - closest) / height)
    fall = -math.expm1(-rate * length)
    ratio = math.log((last + near) / (first + near))
    width = core[1] - core[0]
    kinds = 4.0 if width > 0.0 else 3.0
    choice = kinds * u
    if choice < 1.0:
        place = closest + height * math.tan(low + choice * (high - low))
    elif choice < 2.0:
        place = first - math.log1p(-(choice - 1.0) * fall) / rate
    elif choice < 3.0:
        place = (first + near) * math.exp((choice - 2.0) * ratio) - near
    else:
        place = core[0] + (choice - 3.0) * width
    place = min(max(place, first), last)
    density = height / ((high - low) * (height * height + (place - closest) ** 2))
    density += rate * math.exp(-rate * (place - first)) / fall
    density += 1.0 / (ratio * (place + near))
    if width > 0.0 and core[0] <= place <= core[1]:
        density += 1.0 / width
    return place, density / kinds


@device
def _arrival_limits(setup: Any, origin: Any, direction: Any, path: Any, length: Any, margin: Any) -> Any:
    """Return the part of a stretch whose light, straight from the laser, arrives while the gate is open.

    The gate is widened by ``margin`` standard deviations of the pulse on both sides.
    s + |origin + s u| = T has the root (T² − |o|²)/(2 (T + o·u)).
    """
    first, last = 0.0, length
    if setup.gate.opens == -math.inf:
        return first, last
    margin *= setup.gate.sigma
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
    first, last = _arrival_limits(setup, origin, direction, path, length, PULSE_REACH)
    if not last > first:
        return 0.0, 0.0
    water = setup.water
    u0, u1, u2, _ = uniforms(draw[0], draw[1], draw[2], BACKSCATTER_STREAM + 1)
    scales = (2.0 * water.attenuation, setup.receiver.radius, max(setup.beam.spot_sigma, LEAST_SIGMA))
    core = (0.0, -1.0)
    if setup.gate.opens != -math.inf:
        core = _arrival_limits(setup, origin, direction, path, length, CORE_REACH)
    place, density = _join_place(origin, direction, (first, last), core, scales, u0)
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
def _new_direction(setup: Any, point: Any, direction: Any, peak: Any, draws: Any) -> Any:
    """Draw a scattered direction, perhaps around the way to the laser; return it and its weight.

    The join of a ray that misses the laser by an angle α is worth 1/α: around the way to the laser the
    density is therefore that of α, ∝ 1/(peak² + α²), and not that of a solid angle.
    """
    u_choice, u_scatter, u_azimuth = draws
    sine, cosine = math.sin(2.0 * math.pi * u_azimuth), math.cos(2.0 * math.pi * u_azimuth)
    away = 1.0 / math.sqrt(point[0] ** 2 + point[1] ** 2 + point[2] ** 2)
    home = (-point[0] * away, -point[1] * away, -point[2] * away)
    reach = math.atan(math.pi / peak)
    if u_choice < TURN_TO_LASER:
        miss = math.sin(0.5 * peak * math.tan(u_scatter * reach))
        leaving = turn(home, 2.0 * miss * miss, sine, cosine)
    else:
        leaving = turn(direction, sample_deviation(setup.phase, u_scatter), sine, cosine)
    wanted = phase_density(setup.phase, deviation_of(direction, leaving))
    angle = max(2.0 * math.asin(math.sqrt(0.5 * deviation_of(home, leaving))), 1e-9)
    drawn = peak / (reach * (peak * peak + angle * angle) * 2.0 * math.pi * max(math.sin(angle), 1e-9))
    return leaving, wanted / ((1.0 - TURN_TO_LASER) * wanted + TURN_TO_LASER * drawn)


@device
def line_of_sight(setup: Any, u: Any) -> Any:
    """Draw a point of the picture and one of the aperture; return where, direction, weight, place."""
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
    return (x, y, receiver.z), (dx * inverse, dy * inverse, cosine), weight, (down, across)


@device
def _enter(tally: Any, tents: bool, seen: Any, energy: Any) -> None:
    """Enter energy at a place of the picture, (down, across) from 0 to 1, into pixels or tents."""
    rows, columns = tally.shape
    if not tents:
        tally[int(seen[0] * rows), int(seen[1] * columns)] += energy
        return
    y, x = seen[0] * (rows - 1), seen[1] * (columns - 1)
    row, column = int(y), int(x)
    down, across = y - row, x - column
    tally[row, column] += energy * (1.0 - down) * (1.0 - across)
    tally[row, column + 1] += energy * (1.0 - down) * across
    tally[row + 1, column] += energy * down * (1.0 - across)
    tally[row + 1, column + 1] += energy * down * across


@cached_kernel
def backscatter_walks(
    setup: Any,
    peak: float,
    latest: float,
    tents: bool,
    seed: Any,
    first: Any,
    count: int,
    picture: Any,
    times: Any,
) -> None:
    """Add the backscatter of ``count`` walks to a picture and to the impulse time bins, energies summed.

    ``peak`` is the width of the phase function's forward peak, rad; ``tents`` tells what ``picture`` is
    made of, see `smooth_map`.
    """
    water, target = setup.water, setup.target
    mean_free_path = 1.0 / max(water.attenuation, 1e-30)
    for i in range(count):
        history = first + np.uint64(i)
        point, direction, weight, seen = line_of_sight(setup, uniforms(seed, history, 0, BACKSCATTER_STREAM))
        # roulette looks at what the water has absorbed: a walk turned home weighs little and counts much
        kept = 1.0
        path = 0.0
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
                _enter(picture, tents, seen, energy * gate_share(setup.gate, arrival))
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
            direction, factor = _new_direction(
                setup, point, direction, peak, (u_choice, u_scatter, u_azimuth)
            )
            weight *= factor * water.albedo
            kept *= water.albedo
            if kept < ROULETTE_WEIGHT:
                dice, _, _, _ = uniforms(seed, history, event, BACKSCATTER_STREAM + 2)
                if dice > ROULETTE_CHANCE:
                    break
                weight /= ROULETTE_CHANCE
                kept /= ROULETTE_CHANCE


def peak_angle(setup: Setup) -> float:
    """Return the median scattering angle, rad, at least 1e-4."""
    deviations = np.sort(_deviations(setup, 1001))
    return max(2.0 * math.asin(math.sqrt(0.5 * float(deviations[500]))), 1e-4)


@cached_kernel
def _deviations(setup: Any, count: int) -> Any:
    deviations = np.empty(count)
    for i in range(count):
        deviations[i] = sample_deviation(setup.phase, (i + 0.5) / count)
    return deviations
