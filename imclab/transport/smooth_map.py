"""A picture known to be smooth, tallied on a coarse grid of tent functions.

Backscatter has no edges: what a line of sight gathers at depth z changes over the width of the beam
there, and over that of the aperture's cone. Tents as wide as a tenth of that scale lose 2e-3 of its
curvature and need far fewer samples than pixels do. Where the scale is finer than a pixel, the pixels
themselves are the grid and nothing is smoothed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from imclab.transport.setup import Setup

FloatArray = NDArray[np.float64]

TENTS_PER_SCALE = 10.0
FEWEST_TENTS = 4


@dataclass(frozen=True)
class SmoothMap:
    """Tents along y and x, and how much of each lies in every pixel row and column.

    Attributes
    ----------
    shape : (int, int)
        Of the tally; that of the picture when ``tents`` is false.
    tents : bool
    """

    shape: tuple[int, int]
    tents: bool
    in_rows: FloatArray
    in_columns: FloatArray

    def picture(self, tally: FloatArray) -> FloatArray:
        """Return the picture of a tally; its sum is the tally's."""
        return np.asarray(self.in_rows @ tally @ self.in_columns.T) if self.tents else tally


def smooth_map(setup: Setup) -> SmoothMap:
    """Lay the grid for the backscatter of a scene."""
    target, receiver = setup.target, setup.receiver
    step = backscatter_scale(setup) / TENTS_PER_SCALE
    rows = max(FEWEST_TENTS, math.ceil(2.0 * target.half_height / step))
    columns = max(FEWEST_TENTS, math.ceil(2.0 * target.half_width / step))
    if rows >= receiver.rows or columns >= receiver.columns:
        nothing = np.zeros((0, 0))
        return SmoothMap((receiver.rows, receiver.columns), False, nothing, nothing)
    in_rows, in_columns = _shares(receiver.rows, rows), _shares(receiver.columns, columns)
    return SmoothMap((rows + 1, columns + 1), True, in_rows, in_columns)


def backscatter_scale(setup: Setup) -> float:
    """Return the finest scale of the backscatter in the object plane, m."""
    beam, receiver = setup.beam, setup.receiver
    reach = setup.target.distance - receiver.z
    depth = np.linspace(0.02, 1.0, 99) * reach
    beam_width = np.hypot(beam.spot_sigma, (receiver.z + depth) * beam.divergence_sigma)
    aperture = receiver.radius * (1.0 - depth / reach)
    return float(np.min(np.maximum(beam_width, 0.5 * aperture) * reach / depth))


def _shares(pixels: int, cells: int) -> FloatArray:
    """Return the share of each tent (columns) that lies in each pixel (rows)."""
    edges = np.arange(pixels + 1)[:, None] * cells / pixels - np.arange(cells + 1)[None, :]
    low, high = np.clip(edges[:-1], -1.0, 1.0), np.clip(edges[1:], -1.0, 1.0)
    inside = _tent_integral(high) - _tent_integral(low)
    return np.asarray(inside / inside.sum(axis=0))


def _tent_integral(u: FloatArray) -> FloatArray:
    return np.asarray(u - 0.5 * u * np.abs(u))
