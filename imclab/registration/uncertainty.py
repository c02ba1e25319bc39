"""How far the fitted motion may be off, from what the fit left over.

White noise is no model of a residual: speckle and blur correlate it, and no model is exact. The
covariance of the parameters is therefore the sandwich I⁻¹ S I⁻¹, with I the information of the
weighted fit and S the variance of its score under the residual's own auto-covariance, its strength
taken locally. To it comes a floor for what the model gets wrong, in the shape of I⁻¹. A covariance
for white noise held the truth in 22 % of the cases meant to be 95 %.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from imclab.registration.fit import Linearised, Pixels
from imclab.registration.motion import Prior
from imclab.registration.reference import Reference
from imclab.registration.whitening import grid_of

_REACH = 8
"""Largest lag of the auto-covariance, in pixels of the frame."""
_MODEL_ERROR_PX = 0.012
"""Error of a shift that no noise explains, where the model is not quite the camera: standard deviation
per axis at a sharp edge, in pixels of the simulated picture, growing with the width of the edges."""
_LOCAL = 9
"""Width of the neighbourhood that the strength of the residual is taken from."""


class Leftover(NamedTuple):
    """The weighted residual on its grid.

    Attributes
    ----------
    rows, cols : int arrays (n,)
        Place of each pixel on the grid.
    strength : float64 array (n,)
        Local standard deviation.
    correlation : float64 array (17, 17)
        Auto-correlation, tapered to zero.
    noise : float64
        Variance of one independent pixel: variance times the sum of the auto-correlation.
    """

    rows: NDArray[np.intp]
    cols: NDArray[np.intp]
    strength: NDArray[np.float64]
    correlation: NDArray[np.float64]
    noise: float


def leftover(model: Linearised, pixels: Pixels) -> Leftover:
    """Describe the residual of a fit: local strength, auto-correlation, independent noise."""
    rows, cols, shape = grid_of(pixels.x, pixels.y, pixels.width)
    residual, present = np.zeros(shape), np.zeros(shape)
    residual[rows, cols] = model.residual * model.weight
    present[rows, cols] = 1.0
    local = _neighbourhood(residual * residual) / np.maximum(_neighbourhood(present), 1e-9)
    variance = float(np.mean(residual[rows, cols] ** 2))
    strength = np.sqrt(np.maximum(local, 0.05 * variance) + 1e-300)
    scaled = np.where(present > 0, residual / strength, 0.0)
    reach = min(_REACH, (min(shape) - 1) // 2)
    correlation = _auto_covariance(scaled, reach) / np.maximum(_auto_covariance(present, reach), 1.0)
    correlation /= max(float(correlation[reach, reach]), 1e-300)
    lag = np.arange(-reach, reach + 1)
    correlation *= np.clip(2 - 2 * np.hypot(*np.meshgrid(lag, lag)) / (reach + 1), 0, 1)
    return Leftover(
        rows, cols, strength[rows, cols], correlation, variance * max(float(correlation.sum()), 1.0)
    )


def covariance(
    model: Linearised, left: Leftover, *, reference: Reference, prior: Prior | None
) -> NDArray[np.float64]:
    """Covariance of the motion's parameters (in target units), blur and amplitudes projected out."""
    projected, restrained = model.projected_slopes()
    # Huber's score bends where a residual is cut: its slope there is 0, not the weight.
    information = (projected * (model.weight == 1.0)) @ projected.T + restrained
    score = _score_variance(projected * left.strength, left) + restrained * left.noise
    if prior is not None:
        _, stiffness = prior.pull(model.state.matrix, reference.frame, len(information))
        information = information + np.diag(stiffness)
        score = score + np.diag(stiffness) * prior.noise
    inverse = np.linalg.pinv(information, hermitian=True)
    shift = (inverse[0, 0] + inverse[1, 1]) / 2 * reference.frame.radius**2
    misfit = _MODEL_ERROR_PX**2 * (1 + max(model.state.blur, 0.0)) / shift * inverse
    return np.asarray((inverse @ score @ inverse + misfit)[:-1, :-1])


def _neighbourhood(field: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(cv2.blur(field, (_LOCAL, _LOCAL), borderType=cv2.BORDER_CONSTANT))


def _score_variance(columns: NDArray[np.float64], left: Leftover) -> NDArray[np.float64]:
    shape = (int(left.rows.max()) + 1, int(left.cols.max()) + 1)
    out = np.empty((len(columns), columns.shape[1]))
    for column, smooth in zip(columns, out, strict=True):
        field = np.zeros(shape)
        field[left.rows, left.cols] = column
        smooth[:] = cv2.filter2D(field, -1, left.correlation, borderType=cv2.BORDER_CONSTANT)[
            left.rows, left.cols
        ]
    variance = columns @ out.T
    values, vectors = np.linalg.eigh((variance + variance.T) / 2)
    return np.asarray(vectors @ np.diag(np.maximum(values, 0)) @ vectors.T)


def _auto_covariance(field: NDArray[np.float64], reach: int) -> NDArray[np.float64]:
    """Sum of products at all lags up to ``reach``."""
    shape = [cv2.getOptimalDFTSize(size + reach) for size in field.shape]
    spectrum = np.abs(np.fft.rfft2(field, shape)) ** 2
    full = np.fft.irfft2(spectrum, shape)
    lag = np.arange(-reach, reach + 1)
    return np.asarray(full[np.ix_(lag, lag)])
