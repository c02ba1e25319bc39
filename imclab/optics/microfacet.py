"""Mirror facets with Gaussian slopes: the glossy surfaces of eqs. 8 and 9.

Symbols: ``h`` normal of the facet that mirrors one direction into the other, ``theta_N`` its angle to
the surface's normal, ``beta`` the angle of incidence on it, D density of facet normals, G shadowing,
F Fresnel reflectance, m roughness. The frame is that of ``imclab.optics.reflection``.

Roughness is Beckmann's m, the root mean square slope of the facets ``sqrt(<slope_x**2 + slope_y**2>)``
(Cook & Torrance 1982, section on the facet slope distribution); along one axis the slopes are normal
with standard deviation ``m / sqrt(2)``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imclab.optics.fresnel import reflectance as fresnel_reflectance
from imclab.optics.limits import check
from imclab.optics.reflection import MICROFACET, Material, Sample, Surface, check_index, directions

Array = NDArray[np.float64]

SMALLEST_ROUGHNESS = 1e-4


@dataclass(frozen=True)
class Microfacet(Material):
    """Mirror facets with Gaussian slopes: ``D F G / (4 cos_in cos_out)`` (Cook & Torrance 1982).

    D is Beckmann's density, G the V-cavity shadowing of eq. 9, F Fresnel's reflectance with a complex
    index. Light is reflected once: what hits a second facet is lost, so the albedo falls below F
    toward grazing incidence on rough surfaces.

    Parameters
    ----------
    roughness : float
        Root mean square slope m of the facets, 1e-4 to 1.
    index : complex
        Index of the material relative to the medium, n - ik (either sign of k).
    """

    roughness: float
    index: complex

    def __post_init__(self) -> None:
        check("roughness", self.roughness, SMALLEST_ROUGHNESS, 1.0, unit="(root mean square slope)")
        check_index(self.index)

    def evaluate(self, w_in: ArrayLike, w_out: ArrayLike) -> Array:
        """Return the BRDF in 1/sr, exactly symmetric in its two directions."""
        facet = _Facet(*directions(w_in, w_out))
        reflectance = fresnel_reflectance(facet.cos_beta, self.index)
        value = reflectance * self._facet_density(facet) * facet.shadowing / (4.0 * facet.cos_product)
        return np.where(facet.lit, value, 0.0)

    def density(self, w_in: ArrayLike, w_out: ArrayLike) -> Array:
        """Return the density in 1/sr with which `sample` draws ``w_out``, also below the surface."""
        a, b = directions(w_in, w_out)
        facet = _Facet(a, b)
        # A facet whose mirror image (slope reversed) faces away from w_in is drawn in its stead too.
        opposite_hidden = 2.0 * facet.cos_normal * a[..., 2] < facet.cos_beta
        drawn = self._facet_density(facet) * facet.cos_normal / (4.0 * facet.cos_beta)
        return np.where(a[..., 2] > 0.0, np.where(opposite_hidden, 2.0, 1.0) * drawn, 0.0)

    def sample(self, w_in: ArrayLike, u: ArrayLike) -> Sample:
        """Draw facets by their slopes; the weight is at most 2 F and its mean is the albedo.

        A facet that faces away from the light is replaced by the other wall of its V-cavity, so no
        draw is wasted on it.
        """
        uniform = np.asarray(u, dtype=np.float64)
        slope = self.roughness * np.sqrt(-np.log1p(-uniform[..., 0]))
        azimuth = 2.0 * np.pi * uniform[..., 1]
        slopes = np.stack((slope * np.cos(azimuth), slope * np.sin(azimuth), np.ones_like(slope)), axis=-1)
        normal = slopes / np.sqrt(1.0 + slope * slope)[..., None]
        w, normal = directions(w_in, normal)
        cosine = np.sum(w * normal, axis=-1)
        normal = np.where((cosine < 0.0)[..., None], normal * [-1.0, -1.0, 1.0], normal)
        cosine = np.sum(w * normal, axis=-1)
        w_out = 2.0 * cosine[..., None] * normal - w
        return Sample(w_out, self._weight(w, w_out, normal[..., 2], cosine))

    def _weight(self, w: Array, w_out: Array, cos_normal: Array, cos_beta: Array) -> Array:
        cos_in, cos_out = w[..., 2], w_out[..., 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            lower = np.minimum(cos_in, cos_out)
            shadowing = np.minimum(1.0, 2.0 * cos_normal * lower / cos_beta)
            factor = np.where(2.0 * cos_normal * cos_in < cos_beta, 0.5, 1.0)
            value = factor * shadowing * cos_beta / (cos_in * cos_normal)
        reflected = (cos_in > 0.0) & (cos_out > 0.0) & (cos_beta > 0.0)
        return np.where(reflected, fresnel_reflectance(np.clip(cos_beta, 0.0, 1.0), self.index) * value, 0.0)

    def _facet_density(self, facet: _Facet) -> Array:
        square = self.roughness**2
        return np.asarray(np.exp(-facet.tan_square / square) / (np.pi * square * facet.cos_normal**4))

    def directional_albedo(self, cos_in: float) -> float:
        """Return the share of the light arriving at ``cos_in`` that is sent back, by quadrature.

        Gauss quadrature of `evaluate` over the slopes of the facets, cut where the law has kinks: it
        does not use `sample` or `density`. Error below 1e-7.

        Parameters
        ----------
        cos_in : float
            Cosine of the angle of incidence, above 0 and at most 1.
        """
        check("cos_in", cos_in, 0.0, 1.0, open_low=True)
        incidence = np.arctan2(np.sqrt((1.0 - cos_in) * (1.0 + cos_in)), cos_in)
        w_in = np.array([np.sin(incidence), 0.0, cos_in])
        # Out to 7 roughnesses, where D is below 1e-21 of its peak.
        slope, slope_weight = _gauss_between(_slope_cuts(incidence, 7.0 * self.roughness), 128)
        azimuth, azimuth_weight = _gauss_between(_azimuth_cuts(slope, incidence), 32)
        tangent = np.broadcast_to(slope, azimuth.shape)
        cos_normal = 1.0 / np.sqrt(1.0 + tangent * tangent)
        normal = np.stack((tangent * np.cos(azimuth), tangent * np.sin(azimuth), np.ones_like(tangent)), -1)
        normal *= cos_normal[..., None]
        cos_beta = np.maximum(normal @ w_in, 0.0)
        w_out = 2.0 * cos_beta[..., None] * normal - w_in
        # dw_out = 4 cos_beta dw_facet, dw_facet = cos_normal**3 slope dslope dazimuth, two half circles.
        measure = 8.0 * cos_beta * cos_normal**3 * tangent * azimuth_weight * slope_weight
        return float(np.sum(self.evaluate(w_in, w_out) * np.maximum(w_out[..., 2], 0.0) * measure))

    @property
    def parameters(self) -> Surface:
        """What the transport kernels need."""
        index = complex(self.index)
        return Surface(MICROFACET, 0.0, self.roughness, index.real, abs(index.imag))


class _Facet:
    """The facet that mirrors ``w_in`` into ``w_out``; symmetric in the two."""

    def __init__(self, w_in: Array, w_out: Array) -> None:
        total = w_in + w_out
        across = total[..., 0] ** 2 + total[..., 1] ** 2
        length = np.sqrt(across + total[..., 2] ** 2)
        cos_in, cos_out = w_in[..., 2], w_out[..., 2]
        usable = (total[..., 2] > 0.0) & (length > 0.0)
        z = np.where(usable, total[..., 2], 1.0)
        length = np.where(usable, length, 1.0)
        self.lit = (cos_in > 0.0) & (cos_out > 0.0)
        self.cos_normal: Array = z / length
        self.cos_beta: Array = np.minimum(0.5 * length, 1.0)
        self.tan_square: Array = np.where(usable, across / z**2, np.inf)
        self.cos_product: Array = np.where(self.lit, cos_in * cos_out, 1.0)
        lower = np.minimum(cos_in, cos_out)
        self.shadowing: Array = np.minimum(1.0, 2.0 * self.cos_normal * lower / self.cos_beta)


def paper_equation_8(w_in: ArrayLike, w_out: ArrayLike, *, index: complex) -> Array:
    """Return eq. 8 as the paper prints it, ``F G / (pi cos_in cos_out)``, for comparison only.

    It has no density of facets and may return more light than arrives: it is no BRDF.

    Parameters
    ----------
    w_in, w_out : array_like, shape (..., 3)
        Directions away from the surface.
    index : complex
        Index of the material relative to the medium.
    """
    facet = _Facet(*directions(w_in, w_out))
    value = fresnel_reflectance(facet.cos_beta, index) * facet.shadowing / (np.pi * facet.cos_product)
    return np.where(facet.lit, value, 0.0)


def _azimuth_cuts(slope: Array, incidence: float) -> Array:
    """Azimuths from 0 to pi, for every slope, between which the law is smooth; along axis 0.

    Its kinks lie where w_out turns horizontal, where the second wall of the V-cavity comes to light,
    where shadowing begins, and where cos_out = cos_in.
    """
    square = slope * slope
    shadow = 2.0 * (3.0 * square - 1.0) / (3.0 - square)
    level = np.stack((square - 1.0, np.full_like(slope, 2.0), shadow, 2.0 * square))
    with np.errstate(over="ignore"):
        cosine = 0.5 * level * np.cos(incidence) / np.maximum(slope * np.sin(incidence), 1e-300)
    kinks = np.arccos(np.clip(cosine, -1.0, 1.0))
    return np.sort(
        np.concatenate((np.zeros((1, slope.size)), kinks, np.full((1, slope.size), np.pi))), axis=0
    )


def _slope_cuts(incidence: float, reach: float) -> Array:
    """Slopes from 0 to ``reach`` at which a kink of `_azimuth_cuts` comes or goes."""
    third, half = incidence / 3.0, incidence / 2.0
    tilts = [0.0, np.pi / 4 - half, np.pi / 4 + half, np.pi / 2 - incidence]
    tilts += [np.pi / 6 - third, np.pi / 6 + third, incidence, np.pi / 2]
    return np.sort(np.minimum(np.tan(tilts), reach))


def _gauss_between(cuts: Array, points: int) -> tuple[Array, Array]:
    """Points and weights of every interval between cuts along axis 0, joined along axis 0.

    Gauss points, gathered toward both ends of the interval as those of a sine, because the integrand
    has roots and thin layers there.
    """
    nodes, weights = np.polynomial.legendre.leggauss(points)
    angle = 0.25 * np.pi * (1.0 + nodes)
    shape = (1, points) + (1,) * (cuts.ndim - 1)
    start, length = cuts[:-1][:, None], np.diff(cuts, axis=0)[:, None]
    position = start + length * (np.sin(angle) ** 2).reshape(shape)
    weight = length * (0.25 * np.pi * weights * np.sin(2.0 * angle)).reshape(shape)
    return position.reshape(-1, *cuts.shape[1:]), weight.reshape(-1, *cuts.shape[1:])
