"""Forward transport through planes of water, in lanes that the machine's vector units work on.

Each packet is one lane of arrays in single precision. A round turns and moves every lane at once in a
loop without branches, which LLVM turns into vector instructions; a scalar pass then looks only at the
lanes that have crossed something and puts a fresh packet where one has ended, so lanes stay full.
Crossings are written down and summed in double precision when their buffer is full.

Absorption acts along the path: a packet at path length p has the weight exp(-a p). From the weight
1e-3 on it stays so and the packet is absorbed whole with the same probability, which is roulette
without bias; the path at which that happens is drawn at the launch. So no lane carries a weight.

Light that is never scattered is computed (:mod:`imclab.transport.unscattered`), not sampled. Only
packets that can scatter are followed: the first free path is drawn from those below the longest way
out, and the share of such packets is known. A batch of ``count`` emitted packets therefore follows
``count`` times that share.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba.extending import overload

from imclab.transport import phase_sampling
from imclab.transport.kernel_cache import cached_kernel_without_allocation, device
from imclab.transport.lane_arrays import DELAY_BINS, LANES, PROPERTIES, RADIAL_BINS, RECORDS
from imclab.transport.random import (
    azimuth32,
    exp32,
    log32,
    sine_cosine32,
    uniform32,
    uniform64,
    words,
)
from imclab.transport.scattering import henyey_greenstein_deviation, is_closed_form, turn_in

# Properties of a packet: rows of one array, so that LLVM sees that they cannot overlap. Place and path
# are those where the flight starts, and the step is the flight: a plane is reached from the start
# without the cancellation that going back from a far end would bring.
_ROWS = tuple(np.uint64(LANES * row) for row in range(PROPERTIES))
_X, _Y, _Z, _DX, _DY, _DZ, _PATH, _DEATH, _STEP, _LIMIT, _DEVIATION = _ROWS
# Whole numbers of a packet: its history within the batch, its event, and random words.
_HISTORY, _EVENT, _WORD0, _WORD1, _WORD2 = (np.uint64(LANES * row) for row in range(5))
_LAUNCH, _ENDS, _WALK = np.uint64(0), np.uint64(1), np.uint64(2)
_ZERO, _HALF, _ONE, _TWO = np.float32(0.0), np.float32(0.5), np.float32(1.0), np.float32(2.0)
_PI = np.float32(math.pi)


_LONGEST = np.float32(1e30)


@cached_kernel_without_allocation
def follow(slab: Any, seed: Any, first_history: Any, count: int, sums: Any, work: Any) -> None:
    """Follow ``count`` packets that can scatter to their ends, summing what crosses the planes."""
    pool, pool_numbers, lanes, numbers, plane, crossed, records = work
    launched, taken, fresh, alive, filled = 0, 0, 0, 0, 0
    while True:
        # fill every lane, those that have ended and at the start all
        while alive < LANES:
            if taken == fresh:
                if launched == count:
                    break
                fresh, taken = min(LANES, count - launched), 0
                _launch(slab, seed, first_history, launched, fresh, pool, pool_numbers)
                launched += fresh
            alive += _enter(slab, pool, pool_numbers, taken, lanes, numbers, plane, alive, sums)
            taken += 1
        if alive == 0:
            break
        sums.collisions[0] += alive
        _draw(seed, first_history, numbers, alive)
        _deviate(slab.phase, numbers, lanes, alive)
        _move(slab.mean_free_path, numbers, lanes, crossed, alive)
        for lane in range(alive - 1, -1, -1):
            if crossed[lane]:
                filled, ended = _cross(slab, lanes, lane, plane, records, filled, sums)
                if filled >= RECORDS:
                    _sum(slab, records, filled, sums)
                    filled = 0
                if ended:
                    alive -= 1
                    _copy(lanes, numbers, plane, alive, lane)
    _sum(slab, records, filled, sums)


@device
def _launch(slab: Any, seed: Any, first: Any, launched: Any, fresh: Any, pool: Any, numbers: Any) -> None:
    """Put ``fresh`` packets with their first flights into the pool (eqs. 1 to 3)."""
    for j in range(fresh):
        i = np.uint64(j)
        history = np.uint64(launched + j)
        numbers[_HISTORY + i] = np.uint32(history)
        numbers[_EVENT + i] = np.uint32(0)
        w0, w1, w2, w3 = words(seed, first + history, np.uint64(0), _LAUNCH)
        w4, w5, _, _ = words(seed, first + history, np.uint64(0), _ENDS)
        radius = slab.spot_sigma * np.sqrt(-_TWO * log32(uniform32(w0)))
        place_sine, place_cosine = azimuth32(w1)
        polar = min(slab.divergence_sigma * np.sqrt(-_TWO * log32(uniform32(w2))), _PI)
        sine, dz = sine_cosine32(polar)
        azimuth_sine, azimuth_cosine = azimuth32(w3)
        dx, dy = sine * azimuth_cosine, sine * azimuth_sine
        pool[_X + i], pool[_Y + i], pool[_Z + i] = radius * place_cosine, radius * place_sine, _ZERO
        pool[_DX + i], pool[_DY + i], pool[_DZ + i] = dx, dy, dz
        pool[_PATH + i] = _ZERO
        pool[_STEP + i] = -slab.mean_free_path * _log_of_one_less(slab.followed * uniform32(w4))
        excess = -log32(uniform32(w5)) * (_ONE / max(slab.absorption, np.float32(1e-30)))
        pool[_DEATH + i] = slab.roulette_path + min(excess, _LONGEST)


@device
def _log_of_one_less(value: Any) -> Any:
    """Return log(1 - value), by its series where 1 - value would be rounded."""
    cube = _ONE / np.float32(3.0) + value * np.float32(0.25)
    series = -value * (_ONE + value * (_HALF + value * cube))
    return series if value < np.float32(0.01) else log32(_ONE - value)


@device
def _enter(
    slab: Any,
    pool: Any,
    pool_numbers: Any,
    taken: Any,
    lanes: Any,
    numbers: Any,
    plane: Any,
    lane: Any,
    sums: Any,
) -> Any:
    """Move a packet from the pool into a lane; return 1, or 0 when it has no first collision."""
    source, goal = np.uint64(taken), np.uint64(lane)
    z, path = pool[_STEP + source] * pool[_DZ + source], pool[_STEP + source]
    last = slab.planes.size - 1
    if not (z > _ZERO and z < slab.planes[last]):
        return 0  # leaves unscattered: that part is computed
    sums.sampled[0] += 1.0
    if path >= pool[_DEATH + source]:
        sums.absorbed[0] += 1.0
        return 0
    for row in range(9):
        shift = np.uint64(LANES * row)
        lanes[goal + shift] = pool[source + shift]
    numbers[_HISTORY + goal] = pool_numbers[_HISTORY + source]
    numbers[_EVENT + goal] = np.uint32(0)
    next_plane = 0
    while z >= slab.planes[next_plane]:
        next_plane += 1
    plane[lane] = next_plane
    lanes[_LIMIT + goal] = slab.planes[next_plane]
    return 1


@device
def _copy(lanes: Any, numbers: Any, plane: Any, source_lane: Any, goal_lane: Any) -> None:
    """Copy a living packet into the lane of one that has ended."""
    source, goal = np.uint64(source_lane), np.uint64(goal_lane)
    for row in range(10):
        shift = np.uint64(LANES * row)
        lanes[goal + shift] = lanes[source + shift]
    numbers[_HISTORY + goal] = numbers[_HISTORY + source]
    numbers[_EVENT + goal] = numbers[_EVENT + source]
    plane[goal_lane] = plane[source_lane]


@device
def _draw(seed: Any, first: Any, numbers: Any, alive: Any) -> None:
    """Give every lane three random words for its next collision and free path."""
    for j in range(alive):
        i = np.uint64(j)
        event = np.uint64(numbers[_EVENT + i])
        w0, w1, w2, _ = words(seed, first + np.uint64(numbers[_HISTORY + i]), event, _WALK)
        numbers[_EVENT + i] = np.uint32(event + np.uint64(1))
        numbers[_WORD0 + i] = w0
        numbers[_WORD1 + i] = w1
        numbers[_WORD2 + i] = w2


def _deviate(phase: Any, numbers: Any, lanes: Any, alive: Any) -> None:
    """Turn every lane's first word into a deviation, by the kind of phase function."""
    raise NotImplementedError("called from kernels only")


def _deviate_closed_form(phase: Any, numbers: Any, lanes: Any, alive: Any) -> None:
    asymmetry = np.float32(phase.asymmetry)
    for j in range(alive):
        i = np.uint64(j)
        u = uniform32(numbers[_WORD0 + i])
        lanes[_DEVIATION + i] = henyey_greenstein_deviation(asymmetry, u, _ONE)


def _deviate_table(phase: Any, numbers: Any, lanes: Any, alive: Any) -> None:
    for j in range(alive):
        i = np.uint64(j)
        lanes[_DEVIATION + i] = np.float32(phase_sampling.sample(phase, uniform64(numbers[_WORD0 + i])))


@overload(_deviate)  # type: ignore[untyped-decorator]
def _overload_deviate(phase: Any, numbers: Any, lanes: Any, alive: Any) -> Any:
    return _deviate_closed_form if is_closed_form(phase) else _deviate_table


@device
def _move(mean_free_path: Any, numbers: Any, lanes: Any, crossed: Any, alive: Any) -> None:
    """Take every lane to its collision, turn it, draw its flight; mark what may cross or be absorbed."""
    for j in range(alive):
        i = np.uint64(j)
        step = lanes[_STEP + i]
        direction = (lanes[_DX + i], lanes[_DY + i], lanes[_DZ + i])
        lanes[_X + i] += step * direction[0]
        lanes[_Y + i] += step * direction[1]
        z, path = lanes[_Z + i] + step * direction[2], lanes[_PATH + i] + step
        lanes[_Z + i], lanes[_PATH + i] = z, path
        sine, cosine = azimuth32(numbers[_WORD1 + i])
        dx, dy, dz = turn_in(_ONE, direction, lanes[_DEVIATION + i], sine, cosine)
        lanes[_DX + i], lanes[_DY + i], lanes[_DZ + i] = dx, dy, dz
        step = -mean_free_path * log32(uniform32(numbers[_WORD2 + i]))
        lanes[_STEP + i] = step
        end = z + step * dz
        crossed[i] = (end <= _ZERO) | (end >= lanes[_LIMIT + i]) | (path + step >= lanes[_DEATH + i])


@device
def _cross(slab: Any, lanes: Any, lane: Any, plane: Any, records: Any, filled: Any, sums: Any) -> Any:
    """Write down what a marked lane crosses; return the filled records and whether it ends."""
    i, planes = np.uint64(lane), slab.planes
    z, path, step, dz = lanes[_Z + i], lanes[_PATH + i], lanes[_STEP + i], lanes[_DZ + i]
    end, slope, death = z + step * dz, _ONE / dz, lanes[_DEATH + i]
    next_plane = plane[lane]
    while next_plane < planes.size and end >= planes[next_plane]:
        way = (planes[next_plane] - z) * slope
        if path + way >= death:
            break
        _record(lanes, i, way, records, filled)
        records.excess[filled] = path + way - planes[next_plane]
        records.row[filled] = next_plane
        filled += 1
        next_plane += 1
    if next_plane == planes.size:
        return filled, True
    plane[lane] = next_plane
    lanes[_LIMIT + i] = planes[next_plane]
    if end <= _ZERO and path - z * slope < death:
        _record(lanes, i, -z * slope, records, filled)
        records.excess[filled] = path - z * slope
        records.row[filled] = planes.size + next_plane
        return filled + 1, True
    if path + step >= death:
        sums.absorbed[0] += 1.0
        return filled, True
    return filled, False


@device
def _record(lanes: Any, i: Any, way: Any, records: Any, filled: Any) -> None:
    """Write down place and path after a way along the flight."""
    records.x[filled] = lanes[_X + i] + way * lanes[_DX + i]
    records.y[filled] = lanes[_Y + i] + way * lanes[_DY + i]
    records.path[filled] = lanes[_PATH + i] + way


@device
def _sum(slab: Any, records: Any, filled: Any, sums: Any) -> None:
    """Add the records to the sums, in double precision."""
    for i in range(filled):
        records.weight[i] = exp32(-slab.absorption * min(records.path[i], slab.roulette_path))
        square = records.x[i] * records.x[i] + records.y[i] * records.y[i]
        radius, excess = np.sqrt(square), max(records.excess[i], _ZERO)
        records.square[i] = square
        records.radial_bin[i] = np.int32(radius / (radius + slab.radial_scale) * np.float32(RADIAL_BINS))
        records.delay_bin[i] = np.int32(excess / (excess + slab.delay_scale) * np.float32(DELAY_BINS))
    planes = slab.planes.size
    for i in range(filled):
        row, weight = records.row[i], np.float64(records.weight[i])
        excess = weight * np.float64(records.excess[i])
        moments = sums.moments[row]
        moments[0] += weight
        moments[1] += weight * np.float64(records.square[i])
        moments[2] += excess
        moments[3] += excess * np.float64(records.excess[i])
        if row < planes:
            sums.radial[row, min(records.radial_bin[i], RADIAL_BINS - 1)] += weight
            delay_bin = min(records.delay_bin[i], DELAY_BINS - 1)
            sums.delay[row, 0, delay_bin] += weight
            sums.delay[row, 1, delay_bin] += excess
        if row >= planes - 1:
            sums.absorbed[0] += 1.0 - weight
