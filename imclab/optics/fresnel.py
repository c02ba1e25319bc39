"""Fresnel reflectance of unpolarised light at a surface of complex index.

Symbols: c and s cosine and sine of the angle of incidence, ``m = n - ik`` the index relative to the
medium, ``a - ib = sqrt(m**2 - s**2)``. Born & Wolf, Principles of Optics, section 14.2, written as
sums of squares so that nothing cancels below zero.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def reflectance(cos_in: ArrayLike, index: complex) -> NDArray[np.float64]:
    """Return the mean of the two polarisations' reflectances.

    Parameters
    ----------
    cos_in : array_like
        Cosine of the angle of incidence, 0 to 1.
    index : complex
        Index of the material relative to the medium; either sign of the imaginary part.
    """
    c = np.asarray(cos_in, dtype=np.float64)
    n, k = complex(index).real, abs(complex(index).imag)
    s2 = (1.0 - c) * (1.0 + c)
    real = n * n - k * k - s2
    modulus = np.hypot(real, 2.0 * n * k)
    # The larger of a, b directly, the smaller through a b = n k: no cancellation.
    large = np.sqrt(0.5 * (modulus + np.abs(real)))
    small = n * k / np.maximum(large, 1e-150)
    a, b = np.where(real >= 0.0, large, small), np.where(real >= 0.0, small, large)
    perpendicular = ((a - c) ** 2 + b * b) / np.maximum((a + c) ** 2 + b * b, 1e-300)
    ratio = ((a * c - s2) ** 2 + (b * c) ** 2) / np.maximum((a * c + s2) ** 2 + (b * c) ** 2, 1e-300)
    return np.asarray(0.5 * perpendicular * (1.0 + ratio))
