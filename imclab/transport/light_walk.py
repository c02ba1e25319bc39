"""Walks from the laser: the scattered light that falls on the target, as maps ready for the gate.

Light that has not met the target is symmetric about the beam's axis, so it is tallied in rings; the
little that has met it before, and comes back to it from the water, is tallied on a coarse grid. Each
map holds, for every camera time of `MapAxes.times`, the share that passes the gate when the way from
the target to the camera takes that long.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from imclab.optics.surface import MICROFACET
from imclab.transport.analog import surface_at
from imclab.transport.beam_field import beam_irradiance
from imclab.transport.beam_join import deviation_of
from imclab.transport.gathering import gate_share
from imclab.transport.kernel_cache import cached_kernel, device
from imclab.transport.random import uniforms
from imclab.transport.scattering import phase_density, sample_deviation, turn
from imclab.transport.surfaces import cosine_law_reflectance
from imclab.transport.surfaces import sample as sample_surface

FloatArray = NDArray[np.float64]

LIGHT_STREAM = 11
ROULETTE_WEIGHT = 0.02
ROULETTE_CHANCE = 0.2
REFLECTED_FIRST = 0.2
"""Share of walks that begin on the target, with light that has reached it unscattered."""
NEAREST = 1e-3
"""Shortest flight from the target that is drawn more often than it happens, in half sides of the target."""
MOST_EVENTS = 100_000


class MapAxes(NamedTuple):
    """Where the maps of light on the target have their nodes.

    Attributes
    ----------
    radii : array (rings)
        Radii of the tent functions of the ring map, m; the first is 0.
    ring_areas : array (rings)
        Integral of each tent function over the plane, m².
    inner_areas : array (rings)
        Its integral over the target's rectangle alone, m².
    times : array (times)
        Camera times, s; a single one when there is no gate.
    cells : int
        Cells along each side of the coarse grid.
    impulse_start, impulse_width, impulse_bins : float, float, int
        First time of arrival on the target, step (s) and number; light later than the last counts there.
    """

    radii: FloatArray
    ring_areas: FloatArray
    inner_areas: FloatArray
    times: FloatArray
    cells: int
    impulse_start: float
    impulse_width: float
    impulse_bins: int


class LightMaps(NamedTuple):
    """Irradiance of the target times diffuse albedo, 1/m² per packet, for each of two materials.

    Attributes
    ----------
    impulses : array (2, impulse bins, rings)
        Light that has not met the target, by time of arrival, before the gate.
    late_impulses : array (2, impulse bins, rings)
        Light that has met it, likewise, as if it were symmetric too; for the time histogram alone.
    late : array (2, times, cells, cells)
        Light that has met the target, gated for each camera time.
    """

    impulses: FloatArray
    late_impulses: FloatArray
    late: FloatArray


@device
def diffuse_albedo(surface: Any, cos_in: Any) -> Any:
    """Return the share of light that leaves with the same radiance everywhere; 0 for a glossy surface."""
    if surface.kind == MICROFACET:
        return 0.0
    return cosine_law_reflectance(surface, min(cos_in, 1.0))


@device
def launch(beam: Any, seed: Any, history: Any) -> Any:
    """Draw start and direction of a packet (eqs. 1, 2)."""
    u0, u1, u2, u3 = uniforms(seed, history, 0, LIGHT_STREAM)
    radius = beam.spot_sigma * math.sqrt(-2.0 * math.log(u0))
    polar = min(beam.divergence_sigma * math.sqrt(-2.0 * math.log(u1)), math.pi)
    place, azimuth = 2.0 * math.pi * u2, 2.0 * math.pi * u3
    sine = math.sin(polar)
    direction = (sine * math.cos(azimuth), sine * math.sin(azimuth), math.cos(polar))
    return (radius * math.cos(place), radius * math.sin(place), 0.0), direction


@device
def _reflected_first(setup: Any, wide: bool, seed: Any, history: Any) -> Any:
    """Begin a walk with light that the target has reflected, unscattered before.

    A place of the target is drawn evenly where the beam is wider than the target, else by following the beam.
    Returns the place, the direction, the weight and the path behind it; the direction's z is 0 where the
    beam misses the target or the surface absorbs all.
    """
    target, water = setup.target, setup.water
    u_polar, u_azimuth, _, _ = uniforms(seed, history, 0, LIGHT_STREAM + 1)
    if wide:
        u_x, u_y, u_size, u_angle = uniforms(seed, history, 0, LIGHT_STREAM)
        x, y = (2.0 * u_x - 1.0) * target.half_width, (2.0 * u_y - 1.0) * target.half_height
        size, angle = math.sqrt(-2.0 * math.log(u_size)), 2.0 * math.pi * u_angle
        offset = (size * math.cos(angle), size * math.sin(angle))
        lit, incoming, path = beam_irradiance(setup.beam, (x, y, target.distance), offset[0], offset[1])
        weight = lit * incoming[2] * 4.0 * target.half_width * target.half_height
    else:
        start, incoming = launch(setup.beam, seed, history)
        path, weight = target.distance / max(incoming[2], 1e-12), 1.0
        x, y = start[0] + path * incoming[0], start[1] + path * incoming[1]
    place = (x, y, target.distance)
    if incoming[2] <= 0.0 or abs(x) >= target.half_width or abs(y) >= target.half_height:
        return place, (1.0, 0.0, 0.0), 0.0, path
    arriving = (-incoming[0], -incoming[1], incoming[2])
    leaving, factor = sample_surface(surface_at(target, place), arriving, u_polar, u_azimuth)
    weight *= factor * math.exp(-water.attenuation * path)
    return place, (leaving[0], leaving[1], -leaving[2] if factor > 0.0 else 0.0), weight, path


@device
def ring_of(radii: Any, radius: Any) -> Any:
    """Return the ring inside a radius and how far (0 to 1) the radius lies toward the next."""
    ring = min(np.searchsorted(radii, radius, side="right"), radii.shape[0] - 1) - 1
    return ring, (radius - radii[ring]) / (radii[ring + 1] - radii[ring])


@device
def _score_late(setup: Any, axes: Any, maps: Any, place: Any, energy: Any, time: Any) -> None:
    """Part light between the four nodes around a place of the target, gated for each camera time."""
    target, cells = setup.target, axes.cells
    down = (place[1] / target.half_height + 1.0) * 0.5 * cells
    across = (place[0] / target.half_width + 1.0) * 0.5 * cells
    row, column = min(int(down), cells - 1), min(int(across), cells - 1)
    cell = 4.0 * target.half_width * target.half_height / (cells * cells)
    for n in range(axes.times.shape[0]):
        share = gate_share(setup.gate, time + axes.times[n]) / cell
        for corner in range(4):
            y, x = row + corner // 2, column + corner % 2
            part = share * (1.0 - abs(down - y)) * (1.0 - abs(across - x))
            part *= (2.0 if y in (0, cells) else 1.0) * (2.0 if x in (0, cells) else 1.0)  # half a tent
            maps.late[0, n, y, x] += energy[0] * part
            maps.late[1, n, y, x] += energy[1] * part


@device
def score(setup: Any, axes: Any, maps: Any, touched: bool, place: Any, energy: Any, time: Any) -> None:
    """Enter light that lands at a place (x, y) of the target's plane at a time into the maps."""
    target = setup.target
    x, y = place
    inside = abs(x) < target.half_width and abs(y) < target.half_height
    radius = math.sqrt(x * x + y * y)
    if radius >= axes.radii[-1] or (touched and not inside):
        return
    if touched:
        _score_late(setup, axes, maps, place, energy, time)
    impulses = maps.late_impulses if touched else maps.impulses
    ring, outer = ring_of(axes.radii, radius)
    areas = axes.inner_areas if touched else axes.ring_areas
    inner_area, outer_area = (1.0 - outer) / areas[ring], outer / areas[ring + 1]
    moment = min((time - axes.impulse_start) / axes.impulse_width, axes.impulse_bins - 1.000001)
    bin_ = int(max(moment, 0.0))
    later = moment - bin_
    for material in range(2):
        early, late = energy[material] * (1.0 - later), energy[material] * later
        impulses[material, bin_, ring] += early * inner_area
        impulses[material, bin_, ring + 1] += early * outer_area
        impulses[material, bin_ + 1, ring] += late * inner_area
        impulses[material, bin_ + 1, ring + 1] += late * outer_area


@device
def empty_maps(axes: Any) -> Any:
    """Return maps of no light."""
    bins, rings = axes.impulse_bins, axes.radii.shape[0]
    return LightMaps(
        np.zeros((2, bins, rings)),
        np.zeros((2, bins, rings)),
        np.zeros((2, axes.times.shape[0], axes.cells + 1, axes.cells + 1)),
    )


@device
def _flight_from_target(setup: Any, direction: Any, u: Any) -> Any:
    """Draw a flight away from the target that ends in the water; return it and the factor of the weight.

    Light that is scattered close to the target lands again with all its weight, and that is rare: half of
    the flights are drawn evenly in the logarithm of distance.
    """
    water, target = setup.water, setup.target
    longest = -target.distance / direction[2]
    nearest = NEAREST * min(target.half_width, target.half_height, longest)
    into, ratio = -math.expm1(-water.attenuation * longest), math.log(longest / nearest)
    if u < 0.5:
        free = -math.log1p(-2.0 * u * into) / max(water.attenuation, 1e-30)
    else:
        free = nearest * math.exp((2.0 * u - 1.0) * ratio)
    wanted = water.attenuation * math.exp(-water.attenuation * free)
    drawn = 0.5 * wanted / into + (0.5 / (free * ratio) if free > nearest else 0.0)
    return min(free, (1.0 - 1e-12) * longest), wanted / drawn


@device
def _connect(setup: Any, axes: Any, maps: Any, ray: Any, state: Any, draws: Any) -> None:
    """Score light scattered toward an evenly drawn place of the target, weighed against going on there.

    ``ray`` is (point, direction before the scattering), ``state`` (weight after it, path, farthest). Light
    that comes back has to turn round: few walks do so by themselves, and those few ruled the error.
    """
    target, water = setup.target, setup.water
    (point, direction), (weight, path, farthest) = ray, state
    x, y = (2.0 * draws[0] - 1.0) * target.half_width, (2.0 * draws[1] - 1.0) * target.half_height
    dx, dy, dz = x - point[0], y - point[1], target.distance - point[2]
    square = dx * dx + dy * dy + dz * dz
    way = math.sqrt(square)
    if dz <= 0.0 or path + way > farthest:
        return
    toward = (dx / way, dy / way, dz / way)
    scattered = phase_density(setup.phase, deviation_of(direction, toward))
    even = square / (4.0 * target.half_width * target.half_height * toward[2])
    energy = weight * scattered / (scattered + even) * math.exp(-water.attenuation * way)
    figure = energy * diffuse_albedo(target.figure, toward[2])
    ground = energy * diffuse_albedo(target.ground, toward[2])
    score(setup, axes, maps, True, (x, y), (figure, ground), (path + way) / water.group_velocity)


@cached_kernel
def light_walks(
    setup: Any, axes: MapAxes, swung: int, latest: float, seed: Any, first: Any, count: int
) -> Any:
    """Walk ``count`` packets and return the `LightMaps` of scattered light on the target, summed.

    The unscattered light on the target is left out: it is computed. Walks therefore begin with a
    collision forced before the target, or (the share `REFLECTED_FIRST`) reflected by the target. After every
    collision the chance of reaching the target unscattered is scored. A walk ends when it leaves, when
    it can no longer land by ``latest`` (s), or by Russian roulette. Light that has not met the target is
    left to `swung_walks` when it comes from up to ``swung`` collisions, all of them nearer to the start
    than the landing.
    """
    water, target = setup.water, setup.target
    maps = empty_maps(axes)
    mean_free_path = 1.0 / max(water.attenuation, 1e-30)
    farthest, area = latest * water.group_velocity, 4.0 * target.half_width * target.half_height
    deviation = 0.0
    for i in range(count):
        history = first + np.uint64(i)
        choice, u_free, u_scatter, u_azimuth = uniforms(seed, history, 1, LIGHT_STREAM)
        touched, farthest_square, collisions, at_target = choice < REFLECTED_FIRST, 0.0, 0, False
        if touched:
            point, direction, weight, path = _reflected_first(setup, swung > 0, seed, history)
            if direction[2] >= 0.0:
                continue
            free, share = _flight_from_target(setup, direction, u_free)
            weight *= share / REFLECTED_FIRST
        else:
            point, direction = launch(setup.beam, seed, history)
            if direction[2] <= 0.0:
                continue
            path, into = 0.0, -math.expm1(-water.attenuation * target.distance / direction[2])
            weight = into / (1.0 - REFLECTED_FIRST)
            free = -math.log1p(-u_free * into) * mean_free_path
        (x, y, z), start = point, (point[0], point[1])
        floor = ROULETTE_WEIGHT * min(weight, 1.0)
        for event in range(2, MOST_EVENTS):
            x, y, z = x + free * direction[0], y + free * direction[1], z + free * direction[2]
            path += free
            was_at_target, incoming = at_target, direction
            if at_target:
                z = target.distance
                if abs(x) >= target.half_width or abs(y) >= target.half_height:
                    break
                surface = surface_at(target, (x, y))
                arriving = (-direction[0], -direction[1], direction[2])
                leaving, factor = sample_surface(surface, arriving, u_scatter, u_azimuth)
                direction = (leaving[0], leaving[1], -leaving[2])
                weight *= factor
                touched = True
            else:
                weight *= water.albedo
                square = (x - start[0]) ** 2 + (y - start[1]) ** 2 + z * z
                farthest_square = max(farthest_square, square)
                collisions += 1
                angle = 2.0 * math.pi * u_azimuth
                deviation = sample_deviation(setup.phase, u_scatter)
                direction = turn(direction, deviation, math.sin(angle), math.cos(angle))
            if weight < floor:
                dice, _, _, _ = uniforms(seed, history, event, LIGHT_STREAM + 1)
                if weight == 0.0 or dice > ROULETTE_CHANCE:
                    break
                weight /= ROULETTE_CHANCE
            if touched and not was_at_target:
                draws = uniforms(seed, history, event, LIGHT_STREAM + 2)
                _connect(setup, axes, maps, ((x, y, z), incoming), (weight, path, farthest), draws)
            # not the way ahead but the shortest: a grazing walk may yet be turned toward the target
            if path + (target.distance - z) > farthest:
                break
            way = 1e30
            if direction[2] > 0.0:
                way = (target.distance - z) / direction[2]
                arriving_weight = weight * math.exp(-water.attenuation * way)
                figure = arriving_weight * diffuse_albedo(target.figure, direction[2])
                ground = arriving_weight * diffuse_albedo(target.ground, direction[2])
                place = (x + way * direction[0], y + way * direction[1])
                ball = (place[0] - start[0]) ** 2 + (place[1] - start[1]) ** 2 + target.distance**2
                in_time = path + way <= farthest
                if in_time and (touched or collisions > swung or farthest_square >= ball):
                    time = (path + way) / water.group_velocity
                    own = 1.0
                    if touched:  # weighed against the connection below
                        drawn = phase_density(setup.phase, deviation)
                        own = drawn / (drawn + way * way / (area * direction[2]))
                    score(setup, axes, maps, touched, place, (own * figure, own * ground), time)
            elif direction[2] < 0.0:
                way = -z / direction[2]
            _, u_free, u_scatter, u_azimuth = uniforms(seed, history, event, LIGHT_STREAM)
            free, share = -math.log(u_free) * mean_free_path, 1.0
            if was_at_target and direction[2] < 0.0:
                free, share = _flight_from_target(setup, direction, u_free)
            weight *= share
            at_target = free >= way
            if at_target:
                if direction[2] < 0.0:
                    break
                free = way
    return maps
