"""Surfaces of the target: what they reflect, evaluated, sampled and integrated with numpy.

The diffuse laws are here, `Microfacet` comes from its own module; the frame and the interface are
those of ``imclab.optics.reflection``. The kernels of ``imclab.transport.surfaces`` follow these laws.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imclab.optics.fresnel import reflectance as fresnel_reflectance
from imclab.optics.limits import check
from imclab.optics.microfacet import Microfacet, paper_equation_8
from imclab.optics.reflection import (
    DIFFUSE,
    LAMBERTIAN,
    MICROFACET,
    Material,
    Sample,
    Surface,
    check_index,
    directions,
)

__all__ = [
    "DIFFUSE",
    "LAMBERTIAN",
    "MICROFACET",
    "Diffuse",
    "Lambertian",
    "Material",
    "Microfacet",
    "Sample",
    "Surface",
    "paper_equation_8",
]

Array = NDArray[np.float64]


class _CosineLaw(Material):
    """A reflectance that may depend on the angle of incidence, the same radiance in all directions."""

    @abstractmethod
    def reflectance_at(self, cos_in: Array) -> Array:
        """Return the directional albedo."""

    def evaluate(self, w_in: ArrayLike, w_out: ArrayLike) -> Array:
        """Return the BRDF in 1/sr."""
        a, b = directions(w_in, w_out)
        lit = (a[..., 2] > 0.0) & (b[..., 2] > 0.0)
        return np.where(lit, self.reflectance_at(np.clip(a[..., 2], 0.0, 1.0)) / np.pi, 0.0)

    def density(self, w_in: ArrayLike, w_out: ArrayLike) -> Array:
        """Return the density ``cos_out / pi`` of the directions drawn (eq. 12)."""
        _, b = directions(w_in, w_out)
        return np.maximum(b[..., 2], 0.0) / np.pi

    def sample(self, w_in: ArrayLike, u: ArrayLike) -> Sample:
        """Draw directions with the density ``cos_out / pi``."""
        uniform = np.asarray(u, dtype=np.float64)
        w_out = _cosine_direction(uniform[..., 0], uniform[..., 1])
        a, b = directions(w_in, w_out)
        return Sample(b, self.reflectance_at(np.clip(a[..., 2], 0.0, 1.0)))

    def directional_albedo(self, cos_in: float) -> float:
        """Return the share of the light arriving at ``cos_in`` that is sent back, by quadrature.

        Parameters
        ----------
        cos_in : float
            Cosine of the angle of incidence, above 0 and at most 1.
        """
        check("cos_in", cos_in, 0.0, 1.0, open_low=True)
        w_in = np.array([np.sqrt((1.0 - cos_in) * (1.0 + cos_in)), 0.0, cos_in])
        nodes, weights = np.polynomial.legendre.leggauss(16)
        w_out = _cosine_direction(0.5 * (1.0 + nodes), np.zeros_like(nodes))
        return float(0.5 * np.pi * weights @ self.evaluate(w_in, w_out))


@dataclass(frozen=True)
class Lambertian(_CosineLaw):
    """Sends the share ``reflectance`` (0 to 1) back with the same radiance in all directions."""

    reflectance: float

    def __post_init__(self) -> None:
        check("reflectance", self.reflectance, 0.0, 1.0)

    def reflectance_at(self, cos_in: Array) -> Array:
        """Return the directional albedo: the same at every angle."""
        return np.full(np.shape(cos_in), self.reflectance)

    @property
    def parameters(self) -> Surface:
        """What the transport kernels need."""
        return Surface(LAMBERTIAN, self.reflectance, 0.0, 1.0, 0.0)


@dataclass(frozen=True)
class Diffuse(_CosineLaw):
    """The paper's diffuse law, eqs. 10-12.

    The BRDF is ``rho_d / pi``, ``rho_d = (1 - R_i) (1 - K2) R_inf / (1 - K2 R_inf)``, ``K2 = R_i``. R_i
    is the Fresnel reflectance at the angle of incidence, so the law is reciprocal only where
    ``cos_in = cos_out``; G_d of eq. 12 is the density of the directions, not another factor.

    Parameters
    ----------
    body_reflectance : float
        R-infinity, the reflectance of an endless depth of the material, 0 to 1.
    index : complex
        Index of the material relative to the medium, n - ik (either sign of k).
    """

    body_reflectance: float
    index: complex

    def __post_init__(self) -> None:
        check("body_reflectance", self.body_reflectance, 0.0, 1.0)
        check_index(self.index)

    def reflectance_at(self, cos_in: Array) -> Array:
        """Return the directional albedo rho_d (eq. 11)."""
        surface = fresnel_reflectance(cos_in, self.index)
        body = (1.0 - surface) * self.body_reflectance
        # R_i = R_inf = 1 is 0/0; its limit along R_i -> 1 is 0: nothing enters.
        return np.asarray((1.0 - surface) * body / np.maximum(1.0 - surface * self.body_reflectance, 1e-300))

    @property
    def parameters(self) -> Surface:
        """What the transport kernels need."""
        return Surface(
            DIFFUSE, self.body_reflectance, 0.0, complex(self.index).real, abs(complex(self.index).imag)
        )


def _cosine_direction(u1: Array, u2: Array) -> Array:
    radius, azimuth = np.sqrt(u1), 2.0 * np.pi * u2
    return np.stack((radius * np.cos(azimuth), radius * np.sin(azimuth), np.sqrt(1.0 - u1)), axis=-1)
