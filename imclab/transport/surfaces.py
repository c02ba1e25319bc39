"""Scalar kernels of the target's surfaces: evaluate, sample, density.

The frame, the symbols and the laws are those of ``imclab.optics.surface``, which is also their
reference in the tests: normal +z, both directions unit vectors (x, y, z) pointing away from the
surface, ``w_in`` to where the light comes from.
"""

from __future__ import annotations

import math

from imclab.optics.surface import DIFFUSE, LAMBERTIAN, Surface
from imclab.transport.scalar_kernel import scalar_kernel

Direction = tuple[float, float, float]

_BELOW_ONE = 1.0 - 2.0**-53  # u1 may have been rounded up to 1


@scalar_kernel
def fresnel(cos_in: float, n: float, k: float) -> float:
    """Return the unpolarised Fresnel reflectance for the relative index n - ik."""
    s2 = (1.0 - cos_in) * (1.0 + cos_in)
    real = n * n - k * k - s2
    modulus = math.sqrt(real * real + 4.0 * n * n * k * k)
    large = math.sqrt(0.5 * (modulus + abs(real)))
    small = n * k / max(large, 1e-150)
    a = large if real >= 0.0 else small
    b = small if real >= 0.0 else large
    across = b * b
    perpendicular = ((a - cos_in) ** 2 + across) / max((a + cos_in) ** 2 + across, 1e-300)
    along = across * cos_in * cos_in
    ratio = ((a * cos_in - s2) ** 2 + along) / max((a * cos_in + s2) ** 2 + along, 1e-300)
    return 0.5 * perpendicular * (1.0 + ratio)


@scalar_kernel
def cosine_law_reflectance(surface: Surface, cos_in: float) -> float:
    """Return the directional albedo of a Lambertian surface or of the diffuse law (eq. 11)."""
    if surface.kind == LAMBERTIAN:
        return surface.reflectance
    entering = 1.0 - fresnel(cos_in, surface.refractive_index, surface.extinction_index)
    body = surface.reflectance
    return entering * entering * body / max(1.0 - (1.0 - entering) * body, 1e-300)


@scalar_kernel
def facet_density(surface: Surface, tan_square: float, cos_normal: float) -> float:
    """Return Beckmann's density of facet normals, 1/sr."""
    square = surface.roughness * surface.roughness
    return math.exp(-tan_square / square) / (math.pi * square * cos_normal**4)


@scalar_kernel
def evaluate(surface: Surface, w_in: Direction, w_out: Direction) -> float:
    """Return the BRDF in 1/sr; zero when a direction is not above the surface."""
    cos_in, cos_out = w_in[2], w_out[2]
    if cos_in <= 0.0 or cos_out <= 0.0:
        return 0.0
    if surface.kind <= DIFFUSE:
        return cosine_law_reflectance(surface, min(cos_in, 1.0)) / math.pi
    x, y, z = w_in[0] + w_out[0], w_in[1] + w_out[1], cos_in + cos_out
    across = x * x + y * y
    length = math.sqrt(across + z * z)
    cos_normal, cos_beta = z / length, min(0.5 * length, 1.0)
    shadowing = min(1.0, 2.0 * cos_normal * min(cos_in, cos_out) / cos_beta)
    reflectance = fresnel(cos_beta, surface.refractive_index, surface.extinction_index)
    facets = facet_density(surface, across / (z * z), cos_normal)
    return reflectance * facets * shadowing / (4.0 * (cos_in * cos_out))


@scalar_kernel
def density(surface: Surface, w_in: Direction, w_out: Direction) -> float:
    """Return the density in 1/sr with which `sample` draws ``w_out``."""
    if w_in[2] <= 0.0:
        return 0.0
    if surface.kind <= DIFFUSE:
        return max(w_out[2], 0.0) / math.pi
    x, y, z = w_in[0] + w_out[0], w_in[1] + w_out[1], w_in[2] + w_out[2]
    if z <= 0.0:
        return 0.0
    across = x * x + y * y
    length = math.sqrt(across + z * z)
    cos_normal, cos_beta = z / length, min(0.5 * length, 1.0)
    drawn = facet_density(surface, across / (z * z), cos_normal) * cos_normal / (4.0 * cos_beta)
    # A facet whose mirror image (slope reversed) faces away from w_in is drawn in its stead too.
    return 2.0 * drawn if 2.0 * cos_normal * w_in[2] < cos_beta else drawn


@scalar_kernel
def sample(surface: Surface, w_in: Direction, u1: float, u2: float) -> tuple[Direction, float]:
    """Draw a direction; its weight is ``BRDF cos_out / density``, zero if it is lost.

    Parameters
    ----------
    surface : Surface
        Parameters; trusted.
    w_in : tuple of float
        Direction to where the light comes from.
    u1, u2 : float
        Uniform numbers in [0, 1).

    Returns
    -------
    w_out, weight
        The direction, and the factor for the packet's energy (at most 2 F; its mean is the albedo).
    """
    azimuth = 2.0 * math.pi * u2
    cos_azimuth, sin_azimuth = math.cos(azimuth), math.sin(azimuth)
    if surface.kind <= DIFFUSE:
        radius = math.sqrt(u1)
        weight = cosine_law_reflectance(surface, min(max(w_in[2], 0.0), 1.0))
        return (radius * cos_azimuth, radius * sin_azimuth, math.sqrt(1.0 - u1)), weight
    slope = surface.roughness * math.sqrt(-math.log1p(-min(u1, _BELOW_ONE)))
    cos_normal = 1.0 / math.sqrt(1.0 + slope * slope)
    x, y = slope * cos_azimuth * cos_normal, slope * sin_azimuth * cos_normal
    tilt = w_in[0] * x + w_in[1] * y
    upright = w_in[2] * cos_normal
    if tilt + upright < 0.0:  # the facet faces away: take the other wall of its V-cavity
        x, y, tilt = -x, -y, -tilt
    cos_beta = tilt + upright
    doubled = 2.0 * cos_beta
    w_out = (doubled * x - w_in[0], doubled * y - w_in[1], doubled * cos_normal - w_in[2])
    cos_in, cos_out = w_in[2], w_out[2]
    if cos_in <= 0.0 or cos_out <= 0.0 or cos_beta <= 0.0:
        return w_out, 0.0
    shadowing = min(1.0, 2.0 * cos_normal * min(cos_in, cos_out) / cos_beta)
    reflectance = fresnel(min(cos_beta, 1.0), surface.refractive_index, surface.extinction_index)
    weight = reflectance * shadowing * cos_beta / (cos_in * cos_normal)
    return w_out, 0.5 * weight if 2.0 * cos_normal * cos_in < cos_beta else weight
