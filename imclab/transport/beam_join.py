"""One join of a stretch of a walk with the unscattered beam, at a place drawn for it alone.

The beam's irradiance grows as 1/r² toward the laser, and a receiver on the laser looks right through
that place; the join is therefore drawn in the angle seen from the laser, evenly and around the beam's
axis, in the logarithm of distance, and evenly in the open gate, weighted by the mean of the densities
(balance heuristic, Veach 1997, section 9.2), so that no join weighs much more than another.
"""

from __future__ import annotations

import math
from typing import Any

from imclab.transport.beam_field import LEAST_SIGMA, beam_irradiance
from imclab.transport.kernel_cache import device
from imclab.transport.scattering import phase_density
from imclab.transport.setup import PULSE_REACH

CORE_REACH = 1.5
"""Standard deviations of the pulse by which the open gate is widened where joins are drawn evenly."""
LEAST_DIVERGENCE = 1e-6
"""Floor of the width (rad) of the angles drawn around the beam's axis."""


@device
def deviation_of(u: Any, v: Any) -> Any:
    """Return 1 − u·v of two unit vectors without losing the digits of small angles."""
    x, y, z = u[0] - v[0], u[1] - v[1], u[2] - v[2]
    return min(0.5 * (x * x + y * y + z * z), 2.0)


@device
def _join_place(origin: Any, direction: Any, limits: Any, core: Any, scales: Any, u: Any) -> Any:
    """Draw a distance along a ray for the join with the beam; return it and its density.

    ``limits`` are the first and last distance wanted, ``core`` those between which the gate is wide
    open, ``scales`` two lengths (m), what separates near from far and the width below which the beam
    does not narrow, and the beam's divergence (rad).
    """
    first, last = limits
    near, narrowest, divergence = scales
    closest = -(origin[0] * direction[0] + origin[1] * direction[1] + origin[2] * direction[2])
    square = origin[0] ** 2 + origin[1] ** 2 + origin[2] ** 2 - closest * closest
    height = max(math.sqrt(max(square, 0.0)), narrowest)
    low, high = math.atan((first - closest) / height), math.atan((last - closest) / height)
    # seen from the laser the ray turns by the angle phi; where phi is `axis` it is nearest to the beam's axis
    axis = math.atan2(direction[2], (origin[2] + closest * direction[2]) / height)
    below, above = math.atan((low - axis) / divergence), math.atan((high - axis) / divergence)
    ratio = math.log((last + near) / (first + near))
    width = core[1] - core[0]
    kinds = 4.0 if width > 0.0 else 3.0
    choice = kinds * u
    if choice < 1.0:
        place = closest + height * math.tan(low + choice * (high - low))
    elif choice < 2.0:
        angle = axis + divergence * math.tan(below + (choice - 1.0) * (above - below))
        place = closest + height * math.tan(min(max(angle, low), high))
    elif choice < 3.0:
        place = (first + near) * math.exp((choice - 2.0) * ratio) - near
    else:
        place = core[0] + (choice - 3.0) * width
    place = min(max(place, first), last)
    swept = height / (height * height + (place - closest) ** 2)
    off = math.atan((place - closest) / height) - axis
    density = swept / (high - low) + 1.0 / (ratio * (place + near))
    density += swept * divergence / ((above - below) * (divergence * divergence + off * off))
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
def join(setup: Any, origin: Any, direction: Any, stretch: Any, draws: Any) -> Any:
    """Return energy and arrival time of one join of a stretch of a walk with the beam.

    ``stretch`` is (length of the stretch, path before it, weight); ``draws`` are three uniform numbers,
    the first of which chooses the place.
    """
    length, path, weight = stretch
    first, last = _arrival_limits(setup, origin, direction, path, length, PULSE_REACH)
    if not last > first:
        return 0.0, 0.0
    water = setup.water
    u0, u1, u2 = draws
    beam = setup.beam
    scales = (
        setup.receiver.radius,
        max(beam.spot_sigma, LEAST_SIGMA),
        max(beam.divergence_sigma, LEAST_DIVERGENCE),
    )
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
