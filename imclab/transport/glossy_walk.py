"""Walks from the camera for scattered light that has met a glossy surface of the target last.

Such light depends on the direction it came from, so it cannot be joined with a map of light on the target. A
walk from the camera is reflected by the glossy surface with the density of the surface; after that every
stretch is joined with the beam (`beam_join`), and at every collision the laser's image in the target is
connected (`mirror_connection`). Together they hold all light that water has scattered at least once. A laser
and an aperture near it see each other in the target through the forward peak: both joins sample just that.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from imclab.optics.surface import MICROFACET
from imclab.transport.analog import surface_at
from imclab.transport.backscatter_walk import line_of_sight, new_direction, way_out
from imclab.transport.beam_field import beam_irradiance
from imclab.transport.beam_join import deviation_of, join
from imclab.transport.even_points import advance, coordinate, first_point
from imclab.transport.gathering import gate_share, time_bin
from imclab.transport.kernel_cache import cached_kernel, device
from imclab.transport.light_walk import MOST_EVENTS, ROULETTE_CHANCE, ROULETTE_WEIGHT, diffuse_albedo
from imclab.transport.mirror_connection import connect
from imclab.transport.random import uniforms
from imclab.transport.scattering import phase_density, sample_deviation, turn
from imclab.transport.setup import Setup
from imclab.transport.surfaces import sample as sample_surface

GLOSSY_STREAM, MIRRORED_STREAM = 71, 75
MIRRORED_HISTORIES = np.uint64(1 << 62)
"""Added to the numbers of the walks that meet the target first, so that no two walks share random numbers."""


def roughnesses(setup: Setup) -> tuple[float, float]:
    """Return the roughness of figure and ground; of the one that is glossy, twice, where the other is not."""
    surfaces = (setup.target.figure, setup.target.ground)
    glossy = [surface.roughness for surface in surfaces if surface.kind == MICROFACET]
    return (glossy[0], glossy[-1]) if glossy else (0.0, 0.0)


@device
def _enter(setup: Any, picture: Any, times: Any, pixel: Any, energy: Any, path: Any) -> None:
    """Enter energy that has gone a path into its pixel, gated, and into its time bin."""
    arrival = path / setup.water.group_velocity
    picture[pixel[0], pixel[1]] += energy * gate_share(setup.gate, arrival)
    bin_ = time_bin(setup.time, arrival)
    if bin_ >= 0:
        times[bin_] += energy


@device
def _reflect(target: Any, point: Any, direction: Any, u0: Any, u1: Any) -> Any:
    """Reflect a walk from the camera; return the surface, the new direction and the factor of its weight.

    Light goes the other way. A glossy law is reciprocal; the diffuse law asks for the cosine of the light's
    arrival, which is that of the walk's leaving.
    """
    surface = surface_at(target, point)
    leaving, factor = sample_surface(surface, (-direction[0], -direction[1], direction[2]), u0, u1)
    if surface.kind != MICROFACET:
        factor = diffuse_albedo(surface, leaving[2])
    return surface, (leaving[0], leaving[1], -leaving[2]), factor


@device
def _lit_directly(setup: Any, point: Any, surface: Any, u0: Any, u1: Any) -> Any:
    """Return radiance per joule, and path, of a diffuse place of the target in the unscattered beam."""
    if surface.kind == MICROFACET:
        return 0.0, 0.0
    size, angle = math.sqrt(-2.0 * math.log(u0)), 2.0 * math.pi * u1
    lit, incoming, path = beam_irradiance(setup.beam, point, size * math.cos(angle), size * math.sin(angle))
    lit *= incoming[2] * diffuse_albedo(surface, incoming[2]) / math.pi
    return lit * math.exp(-setup.water.attenuation * path), path


@device
def _follow(setup: Any, way_of: Any, numbers: Any, even: Any, start: Any, picture: Any, times: Any) -> None:
    """Follow a walk from the camera to its end and enter what it brings into its pixel.

    ``way_of`` is (roughness, width of the forward peak, latest), ``numbers`` (seed, history), ``start``
    (point, direction, weight, free flight, pixel). The first event takes its numbers from the point
    ``even``, coordinates 6 to 9; a first collision is not connected, that is what `mirror_veil` does.
    """
    water, target = setup.water, setup.target
    (roughness, peak, latest), (seed, history) = way_of, numbers
    point, direction, weight, free, pixel = start
    farthest, mean_free_path = latest * water.group_velocity, 1.0 / max(water.attenuation, 1e-30)
    met, path, kept = False, 0.0, 1.0
    way = way_out(target, point, direction)
    for event in range(1, MOST_EVENTS):
        on_target = free >= way and direction[2] > 0.0
        if free >= way and not on_target:
            break
        free = min(free, way)
        point = (
            point[0] + free * direction[0],
            point[1] + free * direction[1],
            target.distance if on_target else point[2] + free * direction[2],
        )
        path += free
        u_free, u_scatter, u_azimuth, u_place = uniforms(seed, history, event, GLOSSY_STREAM)
        u_choice, u_size, u_angle, dice = uniforms(seed, history, event, GLOSSY_STREAM + 1)
        u_start, u_around, u_turn, _ = uniforms(seed, history, event, GLOSSY_STREAM + 2)
        if event == 1:
            u_scatter, u_azimuth, u_place = coordinate(even, 6), coordinate(even, 7), coordinate(even, 8)
            u_free = coordinate(even, 9)
        if on_target:
            if abs(point[0]) >= target.half_width or abs(point[1]) >= target.half_height:
                break
            surface, direction, factor = _reflect(target, point, direction, u_scatter, u_azimuth)
            if surface.kind != MICROFACET and not met:
                break
            if met:
                lit, more = _lit_directly(setup, point, surface, u_start, u_around)
                _enter(setup, picture, times, pixel, weight * lit, path + more)
            met = True
            weight *= factor
            kept *= min(factor, 1.0)
        else:
            weight *= water.albedo
            kept *= water.albedo
            if event > 1:
                mirrored = (u_choice, u_size, u_angle, u_start, u_around)
                energy, more, toward = connect(setup, point, roughness, mirrored)
                energy *= weight * phase_density(setup.phase, deviation_of(direction, toward))
                if energy > 0.0:
                    _enter(setup, picture, times, pixel, energy, path + more)
            if met:
                turned = (u_turn, u_scatter, u_azimuth)
                direction, factor = new_direction(setup, point, direction, peak, turned)
                weight *= factor
            else:
                angle = 2.0 * math.pi * u_azimuth
                deviation = sample_deviation(setup.phase, u_scatter)
                direction = turn(direction, deviation, math.sin(angle), math.cos(angle))
        if weight == 0.0 or path > farthest:
            break
        if kept < ROULETTE_WEIGHT:
            if dice > ROULETTE_CHANCE:
                break
            weight /= ROULETTE_CHANCE
            kept /= ROULETTE_CHANCE
        way = way_out(target, point, direction)
        if met:
            draws = (u_place, u_start, u_around)
            energy, arrival = join(setup, point, direction, (way, path, weight), draws)
            if energy > 0.0:
                _enter(setup, picture, times, pixel, energy, arrival * water.group_velocity)
        free = -math.log(u_free) * mean_free_path


@cached_kernel
def glossy_walks(
    setup: Any,
    roughness: Any,
    peak: float,
    latest: float,
    seed: Any,
    first: Any,
    count: int,
    picture: Any,
    times: Any,
) -> None:
    """Add ``count`` walks that the water scatters on the way from camera to target, all pixels alike.

    ``roughness`` is that of `roughnesses`, ``peak`` that of `way_home`; ``picture`` and the impulse
    ``times`` are sums over walks.
    """
    water, target = setup.water, setup.target
    rows, columns = picture.shape
    rate = max(water.attenuation, 1e-30)
    even = first_point(seed, first, GLOSSY_STREAM + 3)
    for i in range(count):
        advance(even, i)
        history = first + np.uint64(i)
        sight = (coordinate(even, 0), coordinate(even, 1), coordinate(even, 2), coordinate(even, 3))
        point, direction, weight, seen = line_of_sight(setup, sight)
        if weight == 0.0:
            continue
        into = -math.expm1(-rate * (target.distance - point[2]) / direction[2])
        free = -math.log1p(-coordinate(even, 4) * into) / rate
        pixel = (int(seen[0] * rows), int(seen[1] * columns))
        start = (point, direction, weight * into, free, pixel)
        _follow(setup, (roughness, peak, latest), (seed, history), even, start, picture, times)


@cached_kernel
def mirrored_walks(
    setup: Any,
    cells: Any,
    roughness: Any,
    peak: float,
    latest: float,
    seed: Any,
    first: Any,
    count: int,
    picture: Any,
    times: Any,
) -> None:
    """Add ``count`` walks that meet a glossy place first, spread evenly over the pixels that have any.

    ``cells`` are those pixels, counted row by row; the rest as for `glossy_walks`.
    """
    water, target = setup.water, setup.target
    rows, columns = picture.shape
    share = cells.shape[0] / (rows * columns)
    even = first_point(seed, first, MIRRORED_STREAM)
    for i in range(count):
        advance(even, i)
        history = first + np.uint64(i) + MIRRORED_HISTORIES
        inside_x, inside_y, _, _ = uniforms(seed, history, 0, GLOSSY_STREAM)
        cell = cells[min(int(coordinate(even, 0) * cells.shape[0]), cells.shape[0] - 1)]
        row, column = cell // columns, cell % columns
        sight = (
            (column + inside_x) / columns,
            (row + inside_y) / rows,
            coordinate(even, 2),
            coordinate(even, 3),
        )
        point, direction, weight, _ = line_of_sight(setup, sight)
        if weight == 0.0:
            continue
        way = (target.distance - point[2]) / direction[2]
        weight *= share * math.exp(-water.attenuation * way)
        start = (point, direction, weight, 2.0 * way, (row, column))
        _follow(setup, (roughness, peak, latest), (seed, history), even, start, picture, times)
