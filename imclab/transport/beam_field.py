"""The unscattered beam, known everywhere in closed form: irradiance, direction and distance.

Symbols: ``s`` start point in the plane z = 0, normal with ``spot_sigma``; θ the polar angle of flight
with the Rayleigh law p(θ) of eq. 2; radiant intensity p(θ)/(2π sin θ) per joule.
"""

from __future__ import annotations

import math
from typing import Any

from imclab.transport.kernel_cache import device

LEAST_SIGMA = 1e-9
"""Floor of spot (m) and divergence (rad): a pencil of light has no irradiance to be joined with."""


@device
def start_law(beam: Any, x: Any, y: Any, z: Any) -> Any:
    """Return mean x, mean y and sigma of where the light at (x, y, z) started, at small angles.

    Starts are normal with ``spot_sigma``, transverse slopes normal with ``divergence_sigma``; given the
    point, the start is normal too.
    """
    spot = max(beam.spot_sigma, LEAST_SIGMA) ** 2
    spread = (z * max(beam.divergence_sigma, LEAST_SIGMA)) ** 2
    share = spot / (spot + spread)
    return x * share, y * share, math.sqrt(spread * share)


@device
def beam_irradiance(beam: Any, point: Any, offset_x: Any, offset_y: Any) -> Any:
    """Return the scalar irradiance of the beam at a point, as an integrand over its starts.

    Light reaches the point from every start s of the spot: the irradiance is ∫ N(s) I(point − s)/r² ds
    with N the normal law of the spot and I the radiant intensity. Written as a mean over starts drawn
    from `start_law` the integrand is nearly constant, and it is exact at any angle.

    Parameters
    ----------
    beam : Beam
    point : (x, y, z), z > 0, m
    offset_x, offset_y : float
        The start, in standard deviations of `start_law` from its mean.

    Returns
    -------
    irradiance, direction, distance
        1/m² per emitted joule without the water's attenuation; unit vector of travel; m.
    """
    x, y, z = point
    mean_x, mean_y, sigma = start_law(beam, x, y, z)
    start_x, start_y = mean_x + sigma * offset_x, mean_y + sigma * offset_y
    dx, dy = x - start_x, y - start_y
    across = math.sqrt(dx * dx + dy * dy)
    square = across * across + z * z
    distance = math.sqrt(square)
    theta = math.atan2(across, z)
    ratio = theta * distance / across if across > 1e-9 * z else 1.0
    spot_variance = max(beam.spot_sigma, LEAST_SIGMA) ** 2
    angle_variance = max(beam.divergence_sigma, LEAST_SIGMA) ** 2
    # the exponents are added first: far outside the beam each exponential alone would underflow
    exponent = 0.5 * (offset_x * offset_x + offset_y * offset_y) - 0.5 * theta * theta / angle_variance
    exponent -= 0.5 * (start_x * start_x + start_y * start_y) / spot_variance
    factor = sigma * sigma / (spot_variance * angle_variance * 2.0 * math.pi)
    irradiance = ratio * math.exp(min(exponent, 700.0)) * factor / square
    inverse = 1.0 / distance
    return irradiance, (dx * inverse, dy * inverse, z * inverse), distance
