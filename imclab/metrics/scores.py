"""MSE, PSNR, SSIM and MSSIM, each by one definition.

Symbols: L data range, C1 = (0.01 L)², C2 = (0.03 L)², μ mean, σ² population variance.
Equation numbers are those of the imaging Monte Carlo paper that imclab follows; eqs. 15 and 16 are
Wang, Bovik, Sheikh, Simoncelli, IEEE Trans. Image Process. 13 (2004) 600, eqs. 13 and 17 there.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imclab.errors import Fault, InputError
from imclab.metrics.pictures import Pair, checked_pair, checked_range, warn_of_range

K1, K2 = 0.01, 0.03
"""Wang's constants: C1 = (K1 L)², C2 = (K2 L)²."""

WINDOW = 11
"""Pixels across the Gaussian window of MSSIM."""

SIGMA = 1.5
"""Standard deviation of that window in pixels."""


def mse(x: ArrayLike, y: ArrayLike, *, mask: ArrayLike | None = None) -> float:
    """Mean squared difference of two pictures (eq. 17).

    Parameters
    ----------
    x, y : array_like (rows, cols)
        Integers of any width or floats; computed in float64, so unsigned integers do not wrap.
    mask : array_like of bool (rows, cols), optional
        True where a pixel counts.

    Raises
    ------
    InputError
        (A ValueError.) Different shapes, pixels not finite, complex or not two-dimensional.
    """
    first, second = checked_pair(x, y, mask=mask).pixels()
    return float(np.mean(np.square(first - second)))


def psnr(x: ArrayLike, y: ArrayLike, *, data_range: float, mask: ArrayLike | None = None) -> float:
    """Peak signal-to-noise ratio in dB, 10 log10(L²/MSE) (eq. 18); infinite for identical pictures.

    Parameters and errors as :func:`mse` and :func:`ssim`.
    """
    peak = checked_range(data_range)
    error = mse(x, y, mask=mask)
    warn_of_range(x, y, data_range=peak)
    return math.inf if error == 0 else 20 * math.log10(peak) - 10 * math.log10(error)


def ssim(x: ArrayLike, y: ArrayLike, *, data_range: float, mask: ArrayLike | None = None) -> float:
    """Structural similarity, computed once over the whole picture (eq. 15, population moments).

    Parameters
    ----------
    x, y : array_like (rows, cols)
        Two pictures of one shape, integers or floats.
    data_range : float
        L, the full scale of the pictures: 255 for 8 bit, 4095 for 12 bit. Never guessed.
    mask : array_like of bool (rows, cols), optional
        True where a pixel counts.

    Raises
    ------
    InputError
        (A ValueError.) Pictures as in :func:`mse`; a range that is not positive and finite.

    Warns
    -----
    DataRangeWarning
        When the range cannot fit the pictures.
    """
    peak = checked_range(data_range)
    first, second = checked_pair(x, y, mask=mask).pixels()
    warn_of_range(x, y, data_range=peak)
    mean_x, mean_y = first.mean(), second.mean()
    dx, dy = first - mean_x, second - mean_y
    c1, c2 = (K1 * peak) ** 2, (K2 * peak) ** 2
    luminance = (2 * mean_x * mean_y + c1) / (mean_x**2 + mean_y**2 + c1)
    structure = (2 * np.mean(dx * dy) + c2) / (np.mean(dx * dx) + np.mean(dy * dy) + c2)
    return float(luminance * structure)


def mssim(x: ArrayLike, y: ArrayLike, *, data_range: float, mask: ArrayLike | None = None) -> float:
    """Mean of the SSIM map of Wang et al. (2004) (eq. 16).

    Windows of 11 x 11 pixels, Gaussian with σ = 1.5 and weights summing to 1, at every position
    where the whole window fits into the picture. Parameters, errors and warnings as :func:`ssim`.
    With a mask only windows that lie wholly inside it count, so pixels outside may be NaN.

    Raises
    ------
    InputError
        Also when a picture is smaller than the window, or no window fits into the mask.
    """
    peak = checked_range(data_range)
    pair = checked_pair(x, y, mask=mask)
    warn_of_range(x, y, data_range=peak)
    return _mean_of(_windowed(pair, peak, with_structure=True))


def luminance_mssim(x: ArrayLike, y: ArrayLike, *, data_range: float, mask: ArrayLike | None = None) -> float:
    """Mean of the luminance factor of the SSIM map alone: local means, no contrast, no structure.

    No measure of similarity: it is near 1 for nearly any pair, and explains a published MSSIM of
    0.999 beside an SSIM of 0.53. All else as :func:`mssim`.
    """
    peak = checked_range(data_range)
    pair = checked_pair(x, y, mask=mask)
    warn_of_range(x, y, data_range=peak)
    return _mean_of(_windowed(pair, peak, with_structure=False))


def mssim_map(
    x: ArrayLike, y: ArrayLike, *, data_range: float, mask: ArrayLike | None = None
) -> NDArray[np.float64]:
    """Return the SSIM map whose mean is :func:`mssim`.

    Returns
    -------
    float64 array (rows - 10, cols - 10), read-only
        Element (i, j) belongs to the window centred on pixel (i + 5, j + 5); NaN where the window
        leaves the mask.
    """
    peak = checked_range(data_range)
    pair = checked_pair(x, y, mask=mask)
    warn_of_range(x, y, data_range=peak)
    values = _windowed(pair, peak, with_structure=True)
    values.flags.writeable = False
    return values


def _windowed(pair: Pair, peak: float, *, with_structure: bool) -> NDArray[np.float64]:
    if min(pair.x.shape) < WINDOW:
        wanted = f"at least {WINDOW} x {WINDOW} pixels, the window of MSSIM"
        raise InputError(
            "metrics", [Fault("x and y", f"shape {pair.x.shape}", wanted, "Use ssim, without window.")]
        )
    from imclab.metrics import window

    offset = (pair.x.mean() + pair.y.mean()) / 2
    c1, c2 = (K1 * peak) ** 2, (K2 * peak) ** 2
    values: NDArray[np.float64] = window.similarity_map(
        pair.x, pair.y, _window_weights(), offset, c1, c2, with_structure
    )
    if pair.mask is not None:
        inside = _whole_windows(pair.mask)
        if not inside.any():
            wanted = f"room for one window of {WINDOW} x {WINDOW} pixels"
            raise InputError("metrics", [Fault("mask", f"{int(pair.mask.sum())} pixels", wanted)])
        values[~inside] = np.nan
    return values


def _window_weights() -> NDArray[np.float64]:
    """Return the 11 one-dimensional weights; their products are the window, summing to 1."""
    offset = np.arange(WINDOW) - WINDOW // 2
    weight = np.exp(-0.5 * (offset / SIGMA) ** 2)
    return np.asarray(weight / weight.sum())


def _whole_windows(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tell at which positions the window lies wholly inside the mask, by sums over the window."""
    sums = np.zeros((mask.shape[0] + 1, mask.shape[1] + 1), dtype=np.int64)
    sums[1:, 1:] = mask.cumsum(axis=0, dtype=np.int64).cumsum(axis=1)
    inside = (
        sums[WINDOW:, WINDOW:] - sums[:-WINDOW, WINDOW:] - sums[WINDOW:, :-WINDOW] + sums[:-WINDOW, :-WINDOW]
    )
    return np.asarray(inside == WINDOW * WINDOW)


def _mean_of(values: NDArray[np.float64]) -> float:
    mean = float(values.mean())
    return mean if math.isfinite(mean) else float(np.nanmean(values))
