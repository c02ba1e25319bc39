"""The veil of a glossy target: its light, scattered once by the water on the way to the camera.

A place y in the water, lit by way of the target (`mirror_connection`), sends light to every point of the
aperture, and each point sees y in another pixel. One place therefore serves all pixels of a disc. With ζ the
depth of y before the camera, l that of the target, and κ = l/ζ, the pixel at X sees y from the aperture
point a = (κ y − X)/(κ − 1); the energy of a pixel of area P is

    ∫ b M(y) p(a → y → target) exp(−c |y − a|) cos³ P/(l − ζ)² d³y

with M the scalar irradiance that reaches y by way of the target and cos = ζ/|y − a|. Nothing is singular,
neither at the aperture nor at the target. The pixels of a place are visited on a lattice shifted at random,
so the mean is exact.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from imclab.transport.beam_join import deviation_of
from imclab.transport.camera_walk import span
from imclab.transport.even_points import advance, coordinate, first_point
from imclab.transport.gathering import gate_share, pixel_at, time_bin
from imclab.transport.kernel_cache import cached_kernel, device
from imclab.transport.mirror_connection import connect
from imclab.transport.random import exp32, uniforms
from imclab.transport.scattering import phase_density

VEIL_STREAM = 81
SMALLEST_DISC = 2.0
"""Radius in pixels below which a place is seen from one point of the aperture, in one pixel: a lattice would
seldom have a point in so small a disc."""


@device
def _shares(setup: Any, shortest: Any, longest: Any, beyond: Any) -> Any:
    """Return the gate's share at the shortest way from y to the aperture, and its slope, 1/m.

    ``beyond`` is the way from the laser to y. Over one aperture the share is linear enough: 1e-4.
    """
    velocity = setup.water.group_velocity
    first = gate_share(setup.gate, (beyond + shortest) / velocity)
    last = gate_share(setup.gate, (beyond + longest) / velocity)
    return first, (last - first) / max(longest - shortest, 1e-12)


@device
def _seen(setup: Any, toward: Any, sight: Any) -> Any:
    """Return p exp(−c s) cos³ and s, the length of the way (dx, dy, dz) from a point of the aperture to y.

    The first is 0 outside the field of view. ``toward`` is the unit vector from y to the target.
    """
    dx, dy, depth = sight
    way = math.sqrt(dx * dx + dy * dy + depth * depth)
    cosine = depth / way
    seen = phase_density(setup.phase, deviation_of((dx / way, dy / way, cosine), toward))
    seen *= cosine * cosine * cosine * np.float64(exp32(np.float32(-setup.water.attenuation * way)))
    return seen if cosine >= setup.receiver.cos_half_view else 0.0, way


@device
def _into_one_pixel(
    setup: Any, tally: Any, point: Any, toward: Any, lit: Any, beyond: Any, draws: Any
) -> None:
    """Add what the aperture gathers, seen from one of its points, drawn evenly.

    ``tally`` is (picture, times).
    """
    receiver, (picture, times) = setup.receiver, tally
    radius, angle = receiver.radius * math.sqrt(draws[0]), 2.0 * math.pi * draws[1]
    x, y = receiver.x + radius * math.cos(angle), receiver.y + radius * math.sin(angle)
    sight = (point[0] - x, point[1] - y, point[2] - receiver.z)
    wider = (setup.target.distance - receiver.z) / sight[2]
    row, column = pixel_at(setup, x + wider * sight[0], y + wider * sight[1])
    if row < 0:
        return
    seen, way = _seen(setup, toward, sight)
    energy = lit * seen * math.pi * (receiver.radius / sight[2]) ** 2
    arrival = (beyond + way) / setup.water.group_velocity
    picture[row, column] += energy * gate_share(setup.gate, arrival)
    bin_ = time_bin(setup.time, arrival)
    if bin_ >= 0:
        times[bin_] += energy


@device
def _into_disc(setup: Any, tally: Any, point: Any, toward: Any, lit: Any, beyond: Any, inside: Any) -> None:
    """Add what the aperture gathers to all pixels that see the point.

    ``tally`` is (picture, times), ``inside`` the place in a pixel that is looked at.
    """
    target, receiver, (picture, times) = setup.target, setup.receiver, tally
    rows, columns = picture.shape
    pitch_x, pitch_y = 2.0 * target.half_width / columns, 2.0 * target.half_height / rows
    off_x, off_y, depth = point[0] - receiver.x, point[1] - receiver.y, point[2] - receiver.z
    wider = (target.distance - receiver.z) / depth - 1.0
    radius = receiver.radius * wider
    middle_x, middle_y = point[0] + off_x * wider, point[1] + off_y * wider
    across = math.hypot(off_x, off_y)
    nearest = math.hypot(max(across - receiver.radius, 0.0), depth)
    share, slope = _shares(setup, nearest, math.hypot(across + receiver.radius, depth), beyond)
    each = lit * pitch_x * pitch_y / (wider * depth) ** 2
    top, bottom = span(middle_y, radius, target.half_height, pitch_y, inside[1])
    for row in range(top, bottom):
        height = (row + inside[1]) * pitch_y - target.half_height - middle_y
        half = math.sqrt(max(radius * radius - height * height, 0.0))
        left, end = span(middle_x, half, target.half_width, pitch_x, inside[0])
        for column in range(left, end):
            off = (column + inside[0]) * pitch_x - target.half_width - middle_x
            seen, way = _seen(setup, toward, (off_x + off / wider, off_y + height / wider, depth))
            picture[row, column] += each * seen * (share + slope * (way - nearest))
            if setup.time.bins > 0:
                bin_ = time_bin(setup.time, (beyond + way) / setup.water.group_velocity)
                if bin_ >= 0:
                    times[bin_] += each * seen


@cached_kernel
def mirror_veil(
    setup: Any, roughness: Any, latest: float, seed: Any, first: Any, count: int, picture: Any, times: Any
) -> None:
    """Add the veil from ``count`` places in the water to the picture and to the impulse time bins.

    Parameters
    ----------
    setup : Setup
    roughness : (float, float)
        That of `glossy_walk.roughnesses`.
    latest : float
        When the gate has closed, s.
    seed, first, count
        Of the random numbers, as for walks.
    picture, times : array
        What is added to; sums over the places.
    """
    target, receiver, water = setup.target, setup.receiver, setup.water
    rows, columns = picture.shape
    length = target.distance - receiver.z
    pitch = max(2.0 * target.half_width / columns, 2.0 * target.half_height / rows)
    even = first_point(seed, first, VEIL_STREAM + 1)
    for i in range(count):
        advance(even, i)
        history = first + np.uint64(i)
        u_choice, u_first, u_second, u_around = uniforms(seed, history, 0, VEIL_STREAM)
        depth = coordinate(even, 0) * length
        nearer = depth / length
        wide = target.half_width * nearer + receiver.radius * (1.0 - nearer)
        high = target.half_height * nearer + receiver.radius * (1.0 - nearer)
        point = (
            receiver.x * (1.0 - nearer) + (2.0 * coordinate(even, 1) - 1.0) * wide,
            receiver.y * (1.0 - nearer) + (2.0 * coordinate(even, 2) - 1.0) * high,
            receiver.z + depth,
        )
        draws = (u_choice, coordinate(even, 3), coordinate(even, 4), coordinate(even, 5), u_around)
        irradiance, beyond, toward = connect(setup, point, roughness, draws)
        if irradiance == 0.0 or beyond + depth > latest * water.group_velocity:
            continue
        lit = irradiance * water.scattering * length * 4.0 * wide * high
        places, tally = (u_first, u_second), (picture, times)
        if receiver.radius * (length / depth - 1.0) > SMALLEST_DISC * pitch:
            _into_disc(setup, tally, point, toward, lit, beyond, places)
        else:
            _into_one_pixel(setup, tally, point, toward, lit, beyond, places)
