"""Walks from the laser that score, at every collision and reflection, the chance to be gathered.

Two ways lead from a vertex to the aperture: a point drawn evenly on the disc (density d²/(A cos θ) per
solid angle), and the direction in which the walk goes on (density of phase function or surface). Both
are scored with the balance heuristic (Veach 1997, section 9.2): value/(density one + density two). A
score is then at most the weight of the packet, however near the aperture the vertex lies, and however
narrow the lobe of a mirror is beside the aperture, or the aperture beside the lobe.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from imclab.optics.surface import MICROFACET
from imclab.transport.analog import surface_at
from imclab.transport.beam_field import beam_irradiance
from imclab.transport.gathering import gate_share, pixel_at, time_bin
from imclab.transport.kernel_cache import cached_kernel, device
from imclab.transport.light_walk import MOST_EVENTS, ROULETTE_CHANCE, ROULETTE_WEIGHT, launch
from imclab.transport.random import uniforms
from imclab.transport.scattering import phase_density, sample_deviation, turn
from imclab.transport.surfaces import density as surface_density
from imclab.transport.surfaces import evaluate as surface_brdf
from imclab.transport.surfaces import sample as sample_surface

NEXT_EVENT_STREAM = 41
MIRROR_STREAM = 45
MIRROR_SAMPLES = 4
"""Samples of unscattered glossy light a packet: they are cheap, and bright in the picture."""

NARROW_BEAM = 0.05
"""Square of the beam's width over the glossy area below which half of the samples follow the beam."""
_SHARPEST = 1e200

UNTOUCHED, DIFFUSE_LAST, GLOSSY_LAST = 0, 1, 2
"""What light has met on the target last."""


@device
def _way_to_aperture(receiver: Any, point: Any, u_radius: Any, u_angle: Any) -> Any:
    """Draw a point of the aperture; return direction, distance and the density per solid angle.

    The distance is 0 where the point cannot be seen from the aperture or lies outside its field of view.
    """
    radius, angle = receiver.radius * math.sqrt(u_radius), 2.0 * math.pi * u_angle
    dx = receiver.x + radius * math.cos(angle) - point[0]
    dy = receiver.y + radius * math.sin(angle) - point[1]
    dz = receiver.z - point[2]
    square = dx * dx + dy * dy + dz * dz
    distance = math.sqrt(square)
    if dz >= 0.0 or -dz < receiver.cos_half_view * distance:
        return (0.0, 0.0, 1.0), 0.0, 1.0
    inverse = 1.0 / distance
    density = square * distance / (-dz * math.pi * receiver.radius * receiver.radius)
    return (dx * inverse, dy * inverse, dz * inverse), distance, density


@device
def _aperture_hit(receiver: Any, point: Any, direction: Any) -> Any:
    """Return the distance at which a ray enters the aperture and its even density there; 0 if it does not."""
    if point[2] <= receiver.z or -direction[2] < receiver.cos_half_view or direction[2] >= 0.0:
        return 0.0, 1.0
    distance = (receiver.z - point[2]) / direction[2]
    dx = point[0] + distance * direction[0] - receiver.x
    dy = point[1] + distance * direction[1] - receiver.y
    square = receiver.radius * receiver.radius
    if dx * dx + dy * dy > square:
        return 0.0, 1.0
    return distance, distance * distance / (-direction[2] * math.pi * square)


@device
def _gather(setup: Any, picture: Any, times: Any, ray: Any, energy: Any, path: Any) -> None:
    """Enter energy that leaves a point in a direction (its attenuation included) and is gathered."""
    point, direction = ray
    back = (setup.target.distance - point[2]) / direction[2]
    row, column = pixel_at(setup, point[0] + back * direction[0], point[1] + back * direction[1])
    if row < 0:
        return
    arrival = path / setup.water.group_velocity
    picture[row, column] += energy * gate_share(setup.gate, arrival)
    bin_ = time_bin(setup.time, arrival)
    if bin_ >= 0:
        times[bin_] += energy


@device
def _vertex_value(setup: Any, point: Any, incoming: Any, on_target: Any, leaving: Any) -> Any:
    """Return value and sampling density, per solid angle, of leaving a vertex in a direction."""
    if not on_target:
        x, y, z = incoming[0] - leaving[0], incoming[1] - leaving[1], incoming[2] - leaving[2]
        value = phase_density(setup.phase, min(0.5 * (x * x + y * y + z * z), 2.0))
        if not value < _SHARPEST:  # straight on or straight back alone: no number at that one angle
            value = _SHARPEST
        return value, value
    surface = surface_at(setup.target, point)
    w_in = (-incoming[0], -incoming[1], incoming[2])
    w_out = (leaving[0], leaving[1], -leaving[2])
    return surface_brdf(surface, w_in, w_out) * w_out[2], surface_density(surface, w_in, w_out)


@cached_kernel
def next_event_walks(
    setup: Any, least: int, latest: float, seed: Any, first: Any, count: int, picture: Any, times: Any
) -> None:
    """Add the scores of ``count`` packets to the picture of target light.

    Light that goes from laser to target to aperture unscattered is left out: it has its own ways
    (`direct_light`, `mirror_light`). Scored is light whose last meeting with the target ranks at least
    as ``least``: `DIFFUSE_LAST` for all of it, `GLOSSY_LAST` for that of glossy surfaces.
    """
    water, target, receiver = setup.water, setup.target, setup.receiver
    mean_free_path = 1.0 / max(water.attenuation, 1e-30)
    farthest = latest * water.group_velocity
    for i in range(count):
        history = first + np.uint64(i)
        point, direction = launch(setup.beam, seed, history)
        weight, path, met, on_target, order = 1.0, 0.0, UNTOUCHED, False, 0
        for event in range(1, MOST_EVENTS):
            u_free, u_scatter, u_azimuth, dice = uniforms(seed, history, event, NEXT_EVENT_STREAM)
            way, exits = 1e30, False
            if direction[2] > 0.0:
                way = (target.distance - point[2]) / direction[2]
            elif direction[2] < 0.0:
                way, exits = -point[2] / direction[2], True
            free = -math.log(u_free) * mean_free_path
            on_target = free >= way and not exits
            gathered, _ = _aperture_hit(receiver, point, direction)
            if (free >= way and exits) or 0.0 < gathered <= free:
                break
            free = min(free, way)
            point = (
                point[0] + free * direction[0],
                point[1] + free * direction[1],
                target.distance if on_target else point[2] + free * direction[2],
            )
            path += free
            incoming = direction
            if on_target:
                if abs(point[0]) >= target.half_width or abs(point[1]) >= target.half_height:
                    break
                surface = surface_at(target, point)
                w_in = (-incoming[0], -incoming[1], incoming[2])
                w_out, factor = sample_surface(surface, w_in, u_scatter, u_azimuth)
                direction = (w_out[0], w_out[1], -w_out[2])
                met = GLOSSY_LAST if surface.kind == MICROFACET else DIFFUSE_LAST
            else:
                angle = 2.0 * math.pi * u_azimuth
                deviation = sample_deviation(setup.phase, u_scatter)
                direction = turn(incoming, deviation, math.sin(angle), math.cos(angle))
                factor = water.albedo
                order += 1
            scored = order > 0 and met >= least
            if scored:
                u_radius, u_angle, _, _ = uniforms(seed, history, event, NEXT_EVENT_STREAM + 1)
                leaving, distance, even = _way_to_aperture(receiver, point, u_radius, u_angle)
                if distance > 0.0:
                    value, drawn = _vertex_value(setup, point, incoming, on_target, leaving)
                    energy = weight * value / (even + drawn) * math.exp(-water.attenuation * distance)
                    energy *= 1.0 if on_target else water.albedo
                    _gather(setup, picture, times, (point, leaving), energy, path + distance)
            weight *= factor
            if weight == 0.0:
                break
            if scored:
                distance, even = _aperture_hit(receiver, point, direction)
                if distance > 0.0:
                    _, drawn = _vertex_value(setup, point, incoming, on_target, direction)
                    energy = weight * drawn / (even + drawn) * math.exp(-water.attenuation * distance)
                    _gather(setup, picture, times, (point, direction), energy, path + distance)
            if weight < ROULETTE_WEIGHT:
                if dice > ROULETTE_CHANCE:
                    break
                weight /= ROULETTE_CHANCE
            if path + abs(point[2] - receiver.z) > farthest:
                break


@device
def _glossy_place(setup: Any, cells: Any, shape: Any, draws: Any, number: Any) -> Any:
    """Draw a place of the target: evenly over the pixels that have glossy places, or in a narrow beam.

    ``number`` is (number of the sample, of how many); returns the place and the inverse of its density, m².
    """
    target, beam = setup.target, setup.beam
    rows, columns = shape
    pitch_x, pitch_y = 2.0 * target.half_width / columns, 2.0 * target.half_height / rows
    area = pitch_x * pitch_y * cells.shape[0]
    width = math.hypot(beam.spot_sigma, target.distance * beam.divergence_sigma)
    narrow = width * width < NARROW_BEAM * area
    u_cell, u_choice, u_x, u_y = draws
    cell = cells[min(int((number[0] + u_cell) / number[1] * cells.shape[0]), cells.shape[0] - 1)]
    x = (cell % columns + u_x) * pitch_x - target.half_width
    y = (cell // columns + u_y) * pitch_y - target.half_height
    if not narrow:
        return (x, y, target.distance), area
    if u_choice < 0.5:
        size, angle = width * math.sqrt(-2.0 * math.log(u_x)), 2.0 * math.pi * u_y
        x, y = size * math.cos(angle), size * math.sin(angle)
    square = (x * x + y * y) / (width * width)
    density = 0.5 / area + 0.5 * math.exp(-0.5 * square) / (2.0 * math.pi * width * width)
    return (x, y, target.distance), 1.0 / density


@cached_kernel
def mirror_light(setup: Any, cells: Any, seed: Any, first: Any, count: int, picture: Any, times: Any) -> None:
    """Add unscattered light from laser to glossy surface to aperture, `MIRROR_SAMPLES` samples a packet.

    Samples are spread evenly over the pixels, in part over a narrow beam: a place, a start in the laser's
    spot, then the two ways to the aperture. ``cells`` are the pixels, row by row, that have any glossy
    surface.
    """
    water, target, receiver = setup.water, setup.target, setup.receiver
    samples = count * MIRROR_SAMPLES
    for i in range(samples):
        history = first * np.uint64(MIRROR_SAMPLES) + np.uint64(i)
        u_cell, u_scatter, u_azimuth, u_choice = uniforms(seed, history, 0, MIRROR_STREAM)
        u_x, u_y, u_size, u_angle = uniforms(seed, history, 1, MIRROR_STREAM)
        draws = (u_cell, u_choice, u_x, u_y)
        point, area = _glossy_place(setup, cells, picture.shape, draws, (i, samples))
        area /= MIRROR_SAMPLES
        if abs(point[0]) >= target.half_width or abs(point[1]) >= target.half_height:
            continue
        surface = surface_at(target, point)
        if surface.kind != MICROFACET:
            continue
        size, angle = math.sqrt(-2.0 * math.log(u_size)), 2.0 * math.pi * u_angle
        lit, incoming, path = beam_irradiance(
            setup.beam, point, size * math.cos(angle), size * math.sin(angle)
        )
        lit *= incoming[2] * area * math.exp(-water.attenuation * path)
        u_radius, u_around, _, _ = uniforms(seed, history, 2, MIRROR_STREAM)
        leaving, distance, even = _way_to_aperture(receiver, point, u_radius, u_around)
        if distance > 0.0:
            value, drawn = _vertex_value(setup, point, incoming, True, leaving)
            energy = lit * value / (even + drawn) * math.exp(-water.attenuation * distance)
            _gather(setup, picture, times, (point, leaving), energy, path + distance)
        w_in = (-incoming[0], -incoming[1], incoming[2])
        w_out, factor = sample_surface(surface, w_in, u_scatter, u_azimuth)
        direction = (w_out[0], w_out[1], -w_out[2])
        distance, even = _aperture_hit(receiver, point, direction)
        if distance > 0.0 and factor > 0.0:
            drawn = surface_density(surface, w_in, w_out)
            energy = lit * factor * drawn / (even + drawn) * math.exp(-water.attenuation * distance)
            _gather(setup, picture, times, (point, direction), energy, path + distance)
