"""Light that crosses the water without being scattered: computed by quadrature, never sampled.

Directions follow the beam's Rayleigh law in the polar angle; a ray at angle theta reaches the plane at z
after z / cos(theta) and keeps exp(-c z / cos(theta)) of its energy.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import i0e

from imclab.transport.setup import Beam

FloatArray = NDArray[np.float64]

PANELS = 60
NODES_PER_PANEL = 24
FARTHEST_ANGLE_SIGMAS = 9.0
NARROWEST_SPOT = 0.01
"""Start points are smeared by at least this part of the beam's width, to keep node from node apart."""


class Rays(NamedTuple):
    """Nodes of the quadrature over the polar angle (rad), and their shares of the beam."""

    angle: FloatArray
    share: FloatArray


def rays_of(beam: Beam) -> Rays:
    """Return nodes and shares over the forward half space; the shares sum to what starts into it."""
    farthest = min(math.pi / 2.0, FARTHEST_ANGLE_SIGMAS * beam.divergence_sigma)
    nodes, weights = np.polynomial.legendre.leggauss(NODES_PER_PANEL)
    panel = np.arange(PANELS)[:, None]
    angle = (farthest / PANELS * (panel + 0.5 * (nodes + 1.0))).ravel()
    relative = angle / beam.divergence_sigma
    density = relative / beam.divergence_sigma * np.exp(-0.5 * relative**2)
    share = np.tile(weights, PANELS) * density
    return Rays(angle, share * (1.0 - backward_share(beam)) / share.sum())


def backward_share(beam: Beam) -> float:
    """Return the share of the beam that starts at more than 90 degrees and leaves at once."""
    return math.exp(-0.5 * (math.pi / 2.0 / beam.divergence_sigma) ** 2)


def moments(rays: Rays, beam: Beam, attenuation: float, distance: float) -> FloatArray:
    """Return weight, weight r^2, weight p, weight p^2 at a plane, p the path beyond the distance."""
    excess = excess_path(rays, distance)
    weight = rays.share * np.exp(-attenuation * (distance + excess))
    square = 2.0 * beam.spot_sigma**2 + (distance * np.tan(rays.angle)) ** 2
    return np.array([weight.sum(), weight @ square, weight @ excess, weight @ excess**2])


def excess_path(rays: Rays, distance: float) -> FloatArray:
    """Return z / cos(theta) - z without cancellation: 2 z sin^2(theta / 2) / cos(theta)."""
    return 2.0 * distance * np.sin(0.5 * rays.angle) ** 2 / np.cos(rays.angle)


def radial_shares(
    rays: Rays, beam: Beam, attenuation: float, *, distance: float, edges: FloatArray
) -> FloatArray:
    """Return the energy in each radial bin of a plane; the last edge may be infinite.

    A ray's foot lies z tan(theta) from the axis, its start point is normal around it: the radius has
    Rice's law, here taken at the middle of each bin.
    """
    reach = np.hypot(beam.spot_sigma, distance * beam.divergence_sigma)
    sigma = max(beam.spot_sigma, NARROWEST_SPOT * reach)
    foot = distance * np.tan(rays.angle)
    weight = rays.share * np.exp(-attenuation * (distance + excess_path(rays, distance)))
    middle, width = 0.5 * (edges[:-1] + edges[1:]), np.diff(edges)
    shares = np.zeros(middle.size)
    for near in np.flatnonzero(middle < 20.0 * reach):
        radius = middle[near]
        rice = np.exp(-0.5 * ((radius - foot) / sigma) ** 2) * i0e(radius * foot / sigma**2)
        shares[near] = width[near] * radius / sigma**2 * (weight @ rice)
    return shares * (weight.sum() / shares.sum()) if shares.sum() > 0.0 else shares


def absorbed_share(rays: Rays, absorption: float, scattering: float, distance: float) -> float:
    """Return the energy absorbed, up to a plane, from packets that are not scattered on the way."""
    way = distance + excess_path(rays, distance)
    return float(rays.share @ (-np.exp(-scattering * way) * np.expm1(-absorption * way)))


def scattered_share(rays: Rays, scattering: float, distance: float) -> float:
    """Return the share of the beam that is scattered, absorption aside, before it reaches a plane."""
    return float(rays.share @ -np.expm1(-scattering * (distance + excess_path(rays, distance))))
