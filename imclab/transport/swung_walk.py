"""Walks from the laser, swung about it until they land where light is wanted.

Few walks of a wide beam land on a small target. But the water is the same in all directions: a walk
drawn without regard to the beam, and swung as a whole about its start so that its last flight ends at a
given point of the target, has the probability it had, times the laser's radiant intensity in the
direction in which it now starts. Every walk then lands.

The last flight of a walk from inside the ball around the start, through the wanted point, leaves the
ball with a cosine μ to its radius ρ. Swung over all directions with intensity I it lights the point with
w exp(−c r) I cos θ/(μ ρ²), with w the weight of the walk, r the length of the last flight, θ its angle
to the target's normal.

Only walks of up to `MOST_COLLISIONS` collisions that stay inside the ball are swung; `light_walks` leaves
out just those. What the swing moves out of the water counts nothing.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from imclab.transport.even_points import advance, coordinate, first_point
from imclab.transport.kernel_cache import cached_kernel, device
from imclab.transport.light_walk import MapAxes, diffuse_albedo, empty_maps, score
from imclab.transport.random import uniforms
from imclab.transport.scattering import sample_deviation, turn
from imclab.transport.setup import Setup

MOST_COLLISIONS = 8
SWUNG_STREAM = 51
EVEN_COLLISIONS = 2
"""Collisions whose numbers are spread evenly over a batch, four for each."""
WIDE_BEAM = 0.5
"""Walks are swung where the beam's standard deviation on the target is more than so many half diagonals."""


def collisions_swung(setup: Setup) -> int:
    """Return up to how many collisions walks are swung: none for a beam narrower than the target."""
    target = setup.target
    corner = math.hypot(target.half_width, target.half_height)
    wide = target.distance * setup.beam.divergence_sigma > WIDE_BEAM * corner
    return MOST_COLLISIONS if wide else 0


@device
def _dot(a: Any, b: Any) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@device
def _frame(axis: Any) -> Any:
    """Return two unit vectors across a unit vector (Duff et al. 2017, JCGT 6, 1)."""
    x, y, z = axis
    sign = math.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    return (1.0 + sign * x * x * a, sign * b, -sign * x), (b, sign + y * y * a, -y)


@device
def _swung_heights(exit_axis: Any, wanted_axis: Any, sine: Any, cosine: Any) -> Any:
    """Return the vector h with (swung a)_z = h·a, for the swing that turns one axis into another.

    ``sine`` and ``cosine`` are of the angle that the walk is turned about the wanted axis.
    """
    first, second = _frame(exit_axis)
    across, down = _frame(wanted_axis)
    height_first = cosine * across[2] + sine * down[2]
    height_second = cosine * down[2] - sine * across[2]
    return (
        exit_axis[0] * wanted_axis[2] + first[0] * height_first + second[0] * height_second,
        exit_axis[1] * wanted_axis[2] + first[1] * height_first + second[1] * height_second,
        exit_axis[2] * wanted_axis[2] + first[2] * height_first + second[2] * height_second,
    )


@device
def _intensity(beam: Any, cosine: Any) -> Any:
    """Return the laser's radiant intensity per joule at an angle to its axis, p(θ)/(2π sin θ), 1/sr."""
    theta = math.acos(min(max(cosine, -1.0), 1.0))
    variance = beam.divergence_sigma * beam.divergence_sigma
    ratio = theta / math.sin(theta) if 1e-6 < theta < 3.1 else 1.0
    return ratio * math.exp(-0.5 * theta * theta / variance) / (2.0 * math.pi * variance)


@cached_kernel
def swung_walks(setup: Any, axes: MapAxes, latest: float, seed: Any, first: Any, count: int) -> Any:
    """Return the `LightMaps` of ``count`` swung walks, summed; none of late light."""
    water, target = setup.water, setup.target
    maps = empty_maps(axes)
    vertices = np.empty((MOST_COLLISIONS, 3))
    mean_free_path = 1.0 / max(water.attenuation, 1e-30)
    farthest, widest = latest * water.group_velocity, axes.radii[-1]
    area = math.pi * widest * widest
    even = first_point(seed, first, SWUNG_STREAM + 1)
    for i in range(count):
        advance(even, i)
        history = first + np.uint64(i)
        u_around, u_size, _, _ = uniforms(seed, history, 0, SWUNG_STREAM)
        size = setup.beam.spot_sigma * math.sqrt(-2.0 * math.log(u_size))
        radius = widest * math.sqrt(coordinate(even, 0))
        x, y = radius - size * math.cos(2.0 * math.pi * u_around), size * math.sin(2.0 * math.pi * u_around)
        ball = math.sqrt(x * x + y * y + target.distance * target.distance)
        wanted = (x / ball, y / ball, target.distance / ball)
        into = -math.expm1(-water.attenuation * ball)
        weight, path = into * area, 0.0
        free = -math.log1p(-coordinate(even, 1) * into) * mean_free_path
        point, direction = (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)
        for collision in range(MOST_COLLISIONS):
            point = (
                point[0] + free * direction[0],
                point[1] + free * direction[1],
                point[2] + free * direction[2],
            )
            path += free
            square = _dot(point, point)
            if square >= ball * ball or path > farthest:
                break
            vertices[collision, 0], vertices[collision, 1], vertices[collision, 2] = point
            u_scatter, u_azimuth, u_turn, u_free = uniforms(seed, history, collision + 1, SWUNG_STREAM)
            if collision < EVEN_COLLISIONS:
                k = 2 + 4 * collision
                u_scatter, u_turn = coordinate(even, k), coordinate(even, k + 1)
                u_free, u_azimuth = coordinate(even, k + 2), coordinate(even, k + 3)
            weight *= water.albedo
            angle = 2.0 * math.pi * u_azimuth
            deviation = sample_deviation(setup.phase, u_scatter)
            direction = turn(direction, deviation, math.sin(angle), math.cos(angle))
            free = -math.log(u_free) * mean_free_path
            along = _dot(point, direction)
            leaving = math.sqrt(along * along + ball * ball - square)
            last = leaving - along
            exit_axis = (
                (point[0] + last * direction[0]) / ball,
                (point[1] + last * direction[1]) / ball,
                (point[2] + last * direction[2]) / ball,
            )
            angle = 2.0 * math.pi * u_turn
            heights = _swung_heights(exit_axis, wanted, math.sin(angle), math.cos(angle))
            arriving = _dot(heights, direction)
            inside = arriving > 0.0 and leaving > 0.0
            for k in range(collision + 1):
                height = _dot(heights, (vertices[k, 0], vertices[k, 1], vertices[k, 2]))
                inside = inside and 0.0 < height < target.distance
            if inside:
                light = weight * math.exp(-water.attenuation * last) * _intensity(setup.beam, heights[2])
                light *= arriving / (leaving * ball)
                energy = (
                    light * diffuse_albedo(target.figure, arriving),
                    light * diffuse_albedo(target.ground, arriving),
                )
                time = (path + last) / water.group_velocity
                score(setup, axes, maps, False, (radius, 0.0), energy, time)
    return maps
