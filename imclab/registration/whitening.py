"""The noise of a frame, and pictures weighed so that this noise becomes white and even.

Bright pixels are noisier and speckle joins neighbours, so equal weights waste what the quiet fine
scales know about the edges. The noise is described by four numbers read from a first fit's
residual: a floor, a part that grows with brightness, and the depth c and width s of a filter

    whitened = f / strength - c · Gaussian(f / strength; s)

which is the inverse of a spectrum that falls by (1 - c)² from coarse to fine scales.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]

_DEPTHS = np.linspace(0.0, 0.9, 19)
_WIDTHS = np.array([0.6, 0.8, 1.0, 1.3, 1.7, 2.2, 3.0])
_BINS = 32
_LEAST_VARIANCE = 0.15
"""Of the mean: no pixel counts more than this, whatever the line through the variances says."""


class Grid(NamedTuple):
    """Where each pixel that takes part is on its grid."""

    rows: NDArray[np.intp]
    cols: NDArray[np.intp]
    shape: tuple[int, int]

    def picture(self, values: Vector) -> Vector:
        """Lay values (n,) out on the grid, 0 where no pixel takes part."""
        field = np.zeros(self.shape)
        field[self.rows, self.cols] = values
        return field


class Noise(NamedTuple):
    """Strength (n,) of the noise at each pixel, and the filter that whitens it."""

    grid: Grid
    strength: Vector
    depth: float
    width: float

    def whitened(self, fields: Vector) -> Vector:
        """Return fields (k, n) in which the noise is white and of unit strength."""
        scaled = np.asarray(fields / self.strength)
        if self.depth > 0:
            scaled -= self.depth * np.stack([self._smooth(values) for values in scaled])
        return scaled

    def _smooth(self, values: Vector) -> Vector:
        size = 2 * int(np.ceil(3 * self.width)) + 1
        field = self.grid.picture(values)
        smooth = cv2.GaussianBlur(field, (size, size), self.width, borderType=cv2.BORDER_CONSTANT)
        return np.asarray(smooth[self.grid.rows, self.grid.cols])


def grid_of(x: Vector, y: Vector, width: int) -> Grid:
    """Return the grid of pixels at places (x, y), ``width`` apart."""
    rows, cols = (((place - place.min()) / width).round().astype(np.intp) for place in (y, x))
    return Grid(rows, cols, (int(rows.max()) + 1, int(cols.max()) + 1))


def noise_of(residual: Vector, brightness: Vector, grid: Grid) -> Noise:
    """Read the noise from a residual; outliers must be cut before."""
    strength = _strength(residual, brightness)
    frequency, power = _spectrum(grid.picture(residual / strength))
    best, depth, width = np.inf, 0.0, 1.0
    for s in _WIDTHS:
        for c in _DEPTHS:
            gain = (1 - c * np.exp(-0.5 * (2 * np.pi * frequency * s) ** 2)) ** 2
            # Whittle's likelihood with the overall strength profiled out
            cost = np.log(np.average(power[0] * gain, weights=power[1])) - np.average(
                np.log(gain), weights=power[1]
            )
            if cost < best:
                best, depth, width = cost, float(c), float(s)
    return Noise(grid, strength, depth, width)


def _strength(residual: Vector, brightness: Vector) -> Vector:
    """Standard deviation as the root of a straight line in the brightness."""
    square = residual * residual
    mean = float(square.mean()) + 1e-300
    centred = brightness - brightness.mean()
    slope = float(centred @ square) / max(float(centred @ centred), 1e-300)
    return np.asarray(np.sqrt(np.maximum(mean + slope * centred, _LEAST_VARIANCE * mean)))


def _spectrum(field: Vector) -> tuple[Vector, tuple[Vector, Vector]]:
    """Mean power by radius of frequency (cycles a pixel): radius, (power, number of waves)."""
    power = np.abs(np.fft.fft2(field)) ** 2
    radius = np.hypot(*np.meshgrid(*(np.fft.fftfreq(size) for size in field.shape), indexing="ij"))
    which = np.minimum((radius / 0.5 * _BINS).astype(int), _BINS - 1).ravel()
    which[0] = -1  # the mean is fitted away
    used = which >= 0
    count = np.bincount(which[used], minlength=_BINS).astype(float)
    some = count > 0
    total = np.bincount(which[used], power.ravel()[used], minlength=_BINS)
    middle = np.bincount(which[used], radius.ravel()[used], minlength=_BINS)
    return middle[some] / count[some], (total[some] / count[some], count[some])
