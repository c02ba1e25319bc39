"""What every reflecting surface has: the frame, the parameters, the interface.

Frame: the normal of the surface is +z, and both directions are unit vectors that point AWAY from the
surface, ``w_in`` to where the light comes from and ``w_out`` to where it goes. Arrays of directions
have the shape (..., 3). A BRDF is in 1/sr; the light sent into ``dw_out`` is ``BRDF cos_out dw_out``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imclab.optics.limits import check, refuse

Array = NDArray[np.float64]

LAMBERTIAN, DIFFUSE, MICROFACET = 0, 1, 2


class Surface(NamedTuple):
    """Parameters of any surface, as the kernels take them; the index is relative to the medium.

    Attributes
    ----------
    kind : int
        LAMBERTIAN, DIFFUSE or MICROFACET.
    reflectance : float
        Reflectance (Lambertian) or body reflectance R-infinity (diffuse).
    roughness : float
        Root mean square slope of the facets.
    refractive_index, extinction_index : float
        n and k of the index n - ik relative to the medium.
    """

    kind: int
    reflectance: float
    roughness: float
    refractive_index: float
    extinction_index: float


class Sample(NamedTuple):
    """Directions drawn, shape (..., 3), and the weight ``BRDF cos_out / density`` of each."""

    w_out: Array
    weight: Array


class Material(ABC):
    """What every surface can do."""

    @abstractmethod
    def evaluate(self, w_in: ArrayLike, w_out: ArrayLike) -> Array:
        """Return the BRDF in 1/sr; zero when a direction is below the surface."""

    @abstractmethod
    def density(self, w_in: ArrayLike, w_out: ArrayLike) -> Array:
        """Return the density in 1/sr with which `sample` draws ``w_out``."""

    @abstractmethod
    def sample(self, w_in: ArrayLike, u: ArrayLike) -> Sample:
        """Draw a direction for every pair of uniform numbers ``u``, shape (..., 2)."""

    @property
    @abstractmethod
    def parameters(self) -> Surface:
        """What the transport kernels need."""

    @abstractmethod
    def directional_albedo(self, cos_in: float) -> float:
        """Return the share of the light arriving at ``cos_in`` that is sent back, by quadrature."""


def directions(w_in: ArrayLike, w_out: ArrayLike) -> tuple[Array, Array]:
    """Return both directions as arrays of one shape (..., 3)."""
    a, b = np.broadcast_arrays(np.asarray(w_in, dtype=np.float64), np.asarray(w_out, dtype=np.float64))
    if a.shape[-1:] != (3,):
        raise refuse("directions", f"shape {a.shape}", "shape (..., 3)")
    return a, b


def check_index(index: complex) -> None:
    """Refuse an index that is not finite, or whose real part is not positive.

    Raises
    ------
    InputError
        The index is outside 1e-3 to 1e6 in n or 0 to 1e6 in k.
    """
    value = complex(index)
    check("index (real part)", value.real, 1e-3, 1e6)
    check("index (imaginary part)", abs(value.imag), 0.0, 1e6)
