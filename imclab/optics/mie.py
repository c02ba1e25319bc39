"""Light scattered by a homogeneous sphere (eqs. 4-6): efficiencies, amplitudes, phase function.

For every size parameter from 1e-8 to 1e6 and every relative index, to what binary64 can hold; compiled
on first use and kept on disk. The recurrences are described in ``imclab.optics.mie_kernels``.

Symbols: ``x = pi d n_medium / wavelength`` size parameter, ``m = n - ik`` index relative to the medium
(k > 0 absorbs; either sign of k is accepted and means the same), mu cosine of the scattering angle.
S1, S2 are those of van de Hulst and Wiscombe; Bohren & Huffman's are their complex conjugates.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imclab.optics import mie_kernels
from imclab.optics.limits import check, refuse

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

SMALLEST_X, LARGEST_X = 1e-8, 1e6
SMALLEST_INDEX, LARGEST_INDEX = 1e-3, 1e3


class Efficiencies(NamedTuple):
    """Cross sections of spheres divided by their geometric cross sections; floats or arrays.

    Attributes
    ----------
    extinction, scattering, absorption : float or ndarray
        Q_ext, Q_sca, Q_abs; the absorption is summed directly, never as a difference.
    backscattering : float or ndarray
        ``4 |S1(180 deg)|**2 / x**2``: the differential cross section at 180 degrees times 4 pi.
    asymmetry : float or ndarray
        Mean cosine of the scattering angle.
    """

    extinction: Any
    scattering: Any
    absorption: Any
    backscattering: Any
    asymmetry: Any


def efficiencies(x: ArrayLike, m: ArrayLike) -> Efficiencies:
    """Return the efficiencies and the asymmetry of spheres.

    Parameters
    ----------
    x : float or array_like
        Size parameter, 1e-8 to 1e6.
    m : complex or array_like
        Relative index, of modulus 1e-3 to 1e3 and with a real part that is not negative; broadcast
        against ``x``.

    Raises
    ------
    InputError
        A value lies outside its range or is not a number.

    Notes
    -----
    Eq. 4 of the paper. A sphere of index exactly 1 scatters nothing; its asymmetry is given as 0.
    """
    # One sphere takes a microsecond or two; the general way through arrays would add 15.
    if isinstance(x, float) and isinstance(m, (float, complex)) and _allowed(x, m):
        return Efficiencies._make(mie_kernels.efficiencies_of_one(x, m.real, m.imag))
    sizes, index = _checked(x, m)
    shape = np.broadcast_shapes(sizes.shape, index.shape)
    spheres = np.array(np.broadcast_to(sizes, shape)).ravel(), np.array(np.broadcast_to(index, shape)).ravel()
    return Efficiencies(*mie_kernels.efficiencies_of_many(*spheres).reshape(5, *shape))


def amplitudes(x: ArrayLike, m: ArrayLike, mu: ArrayLike) -> tuple[ComplexArray, ComplexArray]:
    """Return the amplitudes S1 (perpendicular) and S2 (parallel to the plane of scattering).

    Parameters
    ----------
    x, m : array_like
        As for `efficiencies`.
    mu : array_like
        Cosines of the scattering angle; broadcast against ``x`` and ``m``.

    Returns
    -------
    S1, S2 : ndarray of complex
        Of the common shape of the three.
    """
    cosines = np.array(mu, dtype=np.float64)
    if cosines.size and not (cosines.min() >= -1.0 and cosines.max() <= 1.0):
        check("mu", cosines, -1.0, 1.0, unit="(cosine of the scattering angle)")
    if isinstance(x, float) and isinstance(m, (float, complex)) and _allowed(x, m):
        s1, s2 = mie_kernels.amplitudes_of_one(x, m.real, m.imag, cosines.ravel())
        return s1.reshape(cosines.shape), s2.reshape(cosines.shape)
    sizes, index = _checked(x, m)
    sizes, index, cosines = np.broadcast_arrays(sizes, index, cosines)
    s1, s2 = np.empty(sizes.shape, np.complex128), np.empty(sizes.shape, np.complex128)
    # Each different sphere once, with all of its angles.
    spheres = np.stack((sizes.ravel(), index.real.ravel(), index.imag.ravel()), axis=1)
    different, which = np.unique(spheres, axis=0, return_inverse=True)
    order = np.argsort(which.ravel(), kind="stable")
    ends = np.cumsum(np.bincount(which.ravel(), minlength=len(different)))
    for (size, n, k), members in zip(different, np.split(order, ends[:-1]), strict=True):
        angles = np.ascontiguousarray(cosines.ravel()[members])
        one = mie_kernels.amplitudes_of_one(float(size), float(n), float(k), angles)
        s1.reshape(-1)[members], s2.reshape(-1)[members] = one
    return s1, s2


def phase_function(x: ArrayLike, m: ArrayLike, mu: ArrayLike) -> Array:
    """Return the phase function of unpolarised light in 1/sr, integral 1 over the sphere.

    ``(|S1|**2 + |S2|**2) / (2 pi x**2 Q_sca)``; parameters as for `amplitudes`.

    Raises
    ------
    InputError
        A sphere of index exactly 1 scatters nothing and has none.
    """
    sizes, index = _checked(x, m)
    if np.any(index == 1.0):
        raise refuse("m", "1", "an index that differs from that of the medium")
    s1, s2 = amplitudes(sizes, index, mu)
    scattering = efficiencies(sizes, index).scattering
    intensity = s1.real**2 + s1.imag**2 + s2.real**2 + s2.imag**2
    return np.asarray(intensity / (2.0 * np.pi * sizes**2 * scattering))


def mean_intensity(x: ArrayLike, m: complex, mu: ArrayLike, *, weights: ArrayLike) -> Array:
    """Return the sum of ``|S1|**2 + |S2|**2`` over spheres of one index, each with its weight.

    Parameters
    ----------
    x, weights : array_like, shape (sizes,)
        Size parameters and weights.
    m : complex
        Relative index.
    mu : array_like, shape (angles,)
        Cosines of the scattering angle.
    """
    sizes, index = _checked(x, m)
    cosines = np.array(mu, dtype=np.float64).ravel()
    check("mu", cosines, -1.0, 1.0, unit="(cosine of the scattering angle)")
    share = np.array(weights, dtype=np.float64).ravel()
    values = mie_kernels.mean_intensity_of_many(sizes.ravel(), index.item(), share, cosines)
    return np.asarray(values)


def _checked(x: ArrayLike, m: ArrayLike) -> tuple[Array, ComplexArray]:
    """Return size parameters and indices, refused outside their ranges."""
    sizes = np.asarray(x, dtype=np.float64)
    given = np.asarray(m, dtype=np.complex128)
    check("x", sizes, SMALLEST_X, LARGEST_X, unit="(size parameter)")
    check("real part of m", given.real, 0.0, LARGEST_INDEX, unit="(relative index n - ik)")
    check("modulus of m", np.abs(given), SMALLEST_INDEX, LARGEST_INDEX, unit="(relative index n - ik)")
    return sizes, given


def _allowed(x: float, m: complex) -> bool:
    """Whether one sphere is in range: what `_checked` tells, at the price that one sphere can afford."""
    return SMALLEST_X <= x <= LARGEST_X and m.real >= 0.0 and SMALLEST_INDEX <= abs(m) <= LARGEST_INDEX
