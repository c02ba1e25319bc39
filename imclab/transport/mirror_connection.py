"""One connection of a point in the water with the laser by way of a glossy target.

A nearly smooth target shows the laser's image. Seen from a point y in the water the light comes from around
the place where the line from y to the image of the laser, behind the target at twice its distance, meets
the target. To first order in the slopes of facets it spreads there as a normal law of
σ = √2 α d₁ d₂/(d₁ + d₂), with α the roughness, d₁ the distance from laser to target, d₂ that from y to the
target. Places are drawn from a law with heavier tails, q(δ) = 1/(π w² (1 + δ²/w²)²) with w² = 3 σ², which is
nowhere less than 0.6 of the normal law, for each roughness that the target has, and evenly over the target;
the mean of the densities is divided by (balance heuristic, Veach 1997, section 9.2).
"""

from __future__ import annotations

import math
from typing import Any

from imclab.optics.surface import MICROFACET
from imclab.transport.analog import surface_at
from imclab.transport.beam_field import beam_irradiance
from imclab.transport.kernel_cache import device
from imclab.transport.surfaces import evaluate as surface_brdf

EVENLY = 0.2
"""Chance of drawing the place on the target evenly instead of around the laser's image."""


@device
def _place_on_target(setup: Any, point: Any, roughness: Any, draws: Any) -> Any:
    """Draw a place (x, y) of the target for a point in the water; return it and its density, 1/m²."""
    target, spot = setup.target, setup.beam.spot_sigma
    u_choice, u_size, u_angle = draws
    near, far = target.distance - point[2], target.distance
    toward = far / (near + far)
    middle = (point[0] * toward, point[1] * toward)
    spread = near / (near + far)
    first = 3.0 * ((math.sqrt(2.0) * roughness[0] * far * spread) ** 2 + (spot * spread) ** 2)
    second = 3.0 * ((math.sqrt(2.0) * roughness[1] * far * spread) ** 2 + (spot * spread) ** 2)
    if u_choice < EVENLY:
        x = (2.0 * u_size - 1.0) * target.half_width
        y = (2.0 * u_angle - 1.0) * target.half_height
    else:
        width = first if u_choice < 0.5 * (1.0 + EVENLY) else second
        offset, angle = math.sqrt(width * u_size / (1.0 - u_size)), 2.0 * math.pi * u_angle
        x, y = middle[0] + offset * math.cos(angle), middle[1] + offset * math.sin(angle)
    inside = abs(x) < target.half_width and abs(y) < target.half_height
    square = (x - middle[0]) ** 2 + (y - middle[1]) ** 2
    density = 0.5 / (math.pi * first * (1.0 + square / first) ** 2)
    density += 0.5 / (math.pi * second * (1.0 + square / second) ** 2)
    density = (1.0 - EVENLY) * density + EVENLY / (4.0 * target.half_width * target.half_height)
    return (x, y), density if inside else 0.0


@device
def connect(setup: Any, point: Any, roughness: Any, draws: Any) -> Any:
    """Return what a point in the water receives by way of a glossy place of the target.

    Parameters
    ----------
    setup : Setup
    point : (x, y, z)
        In the water, m.
    roughness : (float, float)
        Those of the target's glossy surfaces, see `glossy_walk.roughnesses`.
    draws : five numbers in (0, 1)
        Three for the place on the target, two for the start in the laser's spot.

    Returns
    -------
    energy, way, toward
        Scalar irradiance per joule, 1/m², as an estimate from one place; length of the way to the laser, m;
        unit vector toward the place.
    """
    target, water = setup.target, setup.water
    place, density = _place_on_target(setup, point, roughness, (draws[0], draws[1], draws[2]))
    if density == 0.0:
        return 0.0, 0.0, (0.0, 0.0, 1.0)
    surface = surface_at(target, place)
    if surface.kind != MICROFACET:
        return 0.0, 0.0, (0.0, 0.0, 1.0)
    mirror = (place[0], place[1], target.distance)
    size, angle = math.sqrt(-2.0 * math.log(draws[3])), 2.0 * math.pi * draws[4]
    lit, incoming, path = beam_irradiance(setup.beam, mirror, size * math.cos(angle), size * math.sin(angle))
    dx, dy, dz = mirror[0] - point[0], mirror[1] - point[1], mirror[2] - point[2]
    square = dx * dx + dy * dy + dz * dz
    way = math.sqrt(square)
    toward = (dx / way, dy / way, dz / way)
    w_in = (-incoming[0], -incoming[1], incoming[2])
    w_out = (-toward[0], -toward[1], toward[2])
    energy = lit * incoming[2] * surface_brdf(surface, w_in, w_out) * w_out[2] / (square * density)
    return energy * math.exp(-water.attenuation * (way + path)), way + path, toward
