"""Walks from the camera joined with the beam: light that comes back without having met the target.

Every stretch of a walk is joined once with the unscattered beam (`beam_join`).

Walks that come home through many small deviations grow in worth from join to join. One whose join is
worth much is split into parts that go on independently (Kahn and Harris 1951), which keeps the spread of
batches near that of a normal law. Splitting and the join around the beam's axis took the variance at optical
depth 4 from 92 squared means a walk to 21, and the excess kurtosis of means of 500 walks from 96 to 13.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from imclab.transport.beam_join import deviation_of, join
from imclab.transport.even_points import advance, coordinate, first_point
from imclab.transport.gathering import gate_share, time_bin
from imclab.transport.kernel_cache import cached_kernel, device
from imclab.transport.random import uniforms
from imclab.transport.scattering import phase_density, sample_deviation, turn
from imclab.transport.setup import Setup

BACKSCATTER_STREAM = 31
ROULETTE_WEIGHT = 0.02
ROULETTE_CHANCE = 0.2
MOST_EVENTS = 100_000
SPLIT_ABOVE = 2.0
"""A walk is split where one join brings more than so many times what a walk usually brings in all."""
WALKS_TO_LEARN_FROM = 4096
MOST_WAITING, MOST_COPIES = 256, 1000
STREAMS_OF_A_COPY = 64
"""Copies of a split walk draw from streams of their own, so far apart that no two walks share one."""
TURN_TO_LASER = 0.4
"""Chance of drawing a scattered direction around the way back to the laser instead of the flight's.

Where light is turned back far from the laser and then scattered ahead, the join sees the forward peak
of the phase function after a rare event; drawing toward the laser makes the event frequent."""


class WayHome(NamedTuple):
    """How walks find back to the laser.

    Attributes
    ----------
    peak : float
        Width of the phase function's forward peak, rad.
    large : float
        Energy of one join above which a walk is split.
    """

    peak: float
    large: float


@device
def _join_draws(numbers: Any, even: Any) -> Any:
    """Return the numbers of a join: for the first two stretches the place is spread evenly over a batch."""
    seed, history, event, stream = numbers
    place, first, second, _ = uniforms(seed, history, event, stream + 1)
    if stream == BACKSCATTER_STREAM and event == 1:
        place = coordinate(even, 4)
    elif stream == BACKSCATTER_STREAM and event == 2:
        place = coordinate(even, 9)
    return place, first, second


@device
def _collision_draws(numbers: Any, even: Any) -> Any:
    """Return the numbers of a collision, spread evenly over a batch as far as there are coordinates."""
    seed, history, event, stream = numbers
    free, scatter, azimuth, choice = uniforms(seed, history, event, stream)
    if stream == BACKSCATTER_STREAM and event == 1:
        free, scatter = coordinate(even, 5), coordinate(even, 6)
        azimuth, choice = coordinate(even, 7), coordinate(even, 8)
    elif stream == BACKSCATTER_STREAM and event == 2:
        free, scatter = coordinate(even, 10), coordinate(even, 11)
    return free, scatter, azimuth, choice


@device
def _put_aside(waiting: Any, place: Any, point: Any, direction: Any, state: Any) -> None:
    """Keep a walk for later; ``state`` is (weight, path, share not absorbed, event, copy)."""
    line = waiting[place]
    line[0], line[1], line[2] = point
    line[3], line[4], line[5] = direction
    line[6], line[7], line[8] = state[0], state[1], state[2]
    line[9], line[10] = state[3], state[4]


@device
def _take_up(waiting: Any, place: Any) -> Any:
    """Return point, direction, weight, path, share not absorbed, event and copy of a walk put aside."""
    line = waiting[place]
    point, direction = (line[0], line[1], line[2]), (line[3], line[4], line[5])
    return point, direction, line[6], line[7], line[8], int(line[9]), int(line[10])


@device
def new_direction(setup: Any, point: Any, direction: Any, peak: Any, draws: Any) -> Any:
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


@device
def way_out(target: Any, point: Any, direction: Any) -> Any:
    """Return how far a ray goes to the target's plane or to the water's surface."""
    if direction[2] > 0.0:
        return (target.distance - point[2]) / direction[2]
    if direction[2] < 0.0:
        return -point[2] / direction[2]
    return 1e30


@cached_kernel
def backscatter_walks(
    setup: Any,
    home: WayHome,
    latest: float,
    tents: bool,
    seed: Any,
    first: Any,
    count: int,
    picture: Any,
    times: Any,
) -> None:
    """Add the backscatter of ``count`` walks to a picture and to the impulse time bins, energies summed.

    ``home`` is that of `way_home`; ``tents`` tells what ``picture`` is made of, see `smooth_map`.
    """
    water, target = setup.water, setup.target
    mean_free_path = 1.0 / max(water.attenuation, 1e-30)
    farthest = latest * water.group_velocity
    even = first_point(seed, first, BACKSCATTER_STREAM + 3)
    waiting = np.empty((MOST_WAITING, 11))
    for i in range(count):
        advance(even, i)
        history = first + np.uint64(i)
        sight = (coordinate(even, 0), coordinate(even, 1), coordinate(even, 2), coordinate(even, 3))
        point, direction, weight, seen = line_of_sight(setup, sight)
        # roulette looks at what the water has absorbed: a walk turned home weighs little and counts much
        _put_aside(waiting, 0, point, direction, (weight, 0.0, 1.0, 1, 0))
        left, copies = 1, 0
        while left > 0:
            left -= 1
            point, direction, weight, path, kept, event, copy = _take_up(waiting, left)
            joined = copy > 0  # a copy goes on after the join that it was made at
            while weight > 0.0 and path <= farthest and event < MOST_EVENTS:
                numbers = (seed, history, event, BACKSCATTER_STREAM + STREAMS_OF_A_COPY * copy)
                length = way_out(target, point, direction)
                if not joined:
                    stretch = (length, path, weight)
                    energy, arrival = join(setup, point, direction, stretch, _join_draws(numbers, even))
                    gated = energy * gate_share(setup.gate, arrival) if energy > 0.0 else 0.0
                    if energy > 0.0:
                        _enter(picture, tents, seen, gated)
                        bin_ = time_bin(setup.time, arrival)
                        if bin_ >= 0:
                            times[bin_] += energy
                    parts = min(int(min(gated / home.large, 1e3)), MOST_WAITING - left, MOST_COPIES - copies)
                    if parts > 1:
                        weight /= parts
                        for _ in range(parts - 1):
                            copies += 1
                            _put_aside(waiting, left, point, direction, (weight, path, kept, event, copies))
                            left += 1
                joined = False
                u_free, u_scatter, u_azimuth, u_choice = _collision_draws(numbers, even)
                free = -math.log(u_free) * mean_free_path
                if free >= length:
                    break
                point = (
                    point[0] + free * direction[0],
                    point[1] + free * direction[1],
                    point[2] + free * direction[2],
                )
                path += free
                direction, factor = new_direction(
                    setup, point, direction, home.peak, (u_choice, u_scatter, u_azimuth)
                )
                weight *= factor * water.albedo
                kept *= water.albedo
                if kept < ROULETTE_WEIGHT:
                    dice, _, _, _ = uniforms(seed, history, event, numbers[3] + 2)
                    if dice > ROULETTE_CHANCE:
                        break
                    weight /= ROULETTE_CHANCE
                    kept /= ROULETTE_CHANCE
                event += 1


def way_home(setup: Setup, latest: float) -> WayHome:
    """Return how the walks of a set-up are turned and split, learnt from a few walks that are not counted."""
    unsplit = WayHome(_peak_angle(setup), math.inf)
    if setup.water.scattering == 0.0:
        return unsplit
    picture = np.zeros((1, 1))
    few, none = WALKS_TO_LEARN_FROM, np.zeros(0)
    alone = setup._replace(time=setup.time._replace(bins=0))
    backscatter_walks(alone, unsplit, latest, False, np.uint64(0), np.uint64(0), few, picture, none)
    usual = float(picture[0, 0]) / few
    return unsplit._replace(large=SPLIT_ABOVE * usual if usual > 0.0 else math.inf)


def _peak_angle(setup: Setup) -> float:
    """Return the median scattering angle, rad, at least 1e-4."""
    deviations = np.sort(_deviations(setup, 1001))
    return max(2.0 * math.asin(math.sqrt(0.5 * float(deviations[500]))), 1e-4)


@cached_kernel
def _deviations(setup: Any, count: int) -> Any:
    deviations = np.empty(count)
    for i in range(count):
        deviations[i] = sample_deviation(setup.phase, (i + 0.5) / count)
    return deviations
