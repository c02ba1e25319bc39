"""A picture between its pixels: cubic B-spline with its slopes and its Laplacian.

The only file of the registration that imports numba. OpenCV's cubic warp does not reproduce a
straight ramp and, before version 5, rounds coordinates to 1/32 px; scipy's spline sampler takes ten
times as long and gives no slopes.
"""

from __future__ import annotations

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

_POLE = np.sqrt(3.0) - 2.0
"""Pole of the cubic B-spline's inverse filter (Unser, Aldroubi, Eden 1993)."""
_REACH = 10
"""Half width of that filter, cut at 2e-6."""


def coefficients(picture: NDArray[np.float64], variance: float) -> NDArray[np.float64]:
    """Return B-spline coefficients of the picture blurred by a Gaussian of ``variance`` px².

    A small negative variance sharpens to first order, by the same diffusion equation.
    """
    offset = np.arange(-_REACH, _REACH + 1)
    kernel = -6 * _POLE / (1 - _POLE**2) * _POLE ** np.abs(offset)
    if variance > 1e-6:
        reach = int(np.ceil(4 * np.sqrt(variance))) + 1
        blur = np.exp(-0.5 * np.arange(-reach, reach + 1) ** 2 / variance)
        kernel = np.convolve(kernel, blur / blur.sum())
    elif variance < 0:
        kernel = np.convolve(kernel, [variance / 2, 1 - variance, variance / 2])
    return np.asarray(cv2.sepFilter2D(picture, cv2.CV_64F, kernel, kernel, borderType=cv2.BORDER_REFLECT_101))


@njit(cache=True, error_model="numpy")  # type: ignore[untyped-decorator]
def sample(coefficient, x, y, out):  # type: ignore[no-untyped-def]
    """Sample value, slope in x, slope in y and Laplacian of a spline at points inside the picture.

    Parameters
    ----------
    coefficient : float64 array (rows, cols)
    x, y : float64 arrays (n,)
        Pixel coordinates; the caller keeps them in [1, cols - 2] and [1, rows - 2].
    out : float64 array (4, n)
        Filled.
    """
    rows, cols = coefficient.shape
    for i in range(x.size):
        left = min(max(int(x[i]), 1), cols - 3)
        top = min(max(int(y[i]), 1), rows - 3)
        f = x[i] - left
        g = y[i] - top
        a0, a1, a2, a3 = _weights(f)
        b0, b1, b2, b3 = _slopes(f)
        c0, c1, c2, c3 = 1 - f, 3 * f - 2, 1 - 3 * f, f
        value = slope_x = slope_y = bend = 0.0
        v = _weights(g)
        s = _slopes(g)
        k = (1 - g, 3 * g - 2, 1 - 3 * g, g)
        for r in range(4):
            line = coefficient[top - 1 + r]
            p0, p1, p2, p3 = line[left - 1], line[left], line[left + 1], line[left + 2]
            across = a0 * p0 + a1 * p1 + a2 * p2 + a3 * p3
            value += v[r] * across
            slope_y += s[r] * across
            slope_x += v[r] * (b0 * p0 + b1 * p1 + b2 * p2 + b3 * p3)
            bend += v[r] * (c0 * p0 + c1 * p1 + c2 * p2 + c3 * p3) + k[r] * across
        out[0, i] = value
        out[1, i] = slope_x
        out[2, i] = slope_y
        out[3, i] = bend


@njit(inline="always", error_model="numpy")  # type: ignore[untyped-decorator]
def _weights(f):  # type: ignore[no-untyped-def]
    g = 1 - f
    return (
        g * g * g / 6,
        (4 - 6 * f * f + 3 * f * f * f) / 6,
        (4 - 6 * g * g + 3 * g * g * g) / 6,
        f * f * f / 6,
    )


@njit(inline="always", error_model="numpy")  # type: ignore[untyped-decorator]
def _slopes(f):  # type: ignore[no-untyped-def]
    g = 1 - f
    return -g * g / 2, (3 * f * f - 4 * f) / 2, (4 * g - 3 * g * g) / 2, f * f / 2
