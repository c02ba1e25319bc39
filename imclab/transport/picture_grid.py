"""The grid of cells on which the two-sided estimator works: pixels, or equal parts of large pixels."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from imclab.transport.setup import Setup

FloatArray = NDArray[np.float64]

FEWEST_CELLS = 96
"""Cells along each side at least: fine enough for quadrature and for edges of the mask."""


@dataclass(frozen=True)
class PictureGrid:
    """Pixels (rows, columns) and the number of cells along the side of each."""

    shape: tuple[int, int]
    fine_rows: int
    fine_columns: int

    @property
    def cells(self) -> tuple[int, int]:
        """Rows and columns of cells."""
        return self.shape[0] * self.fine_rows, self.shape[1] * self.fine_columns

    def pixels(self, cells: FloatArray) -> FloatArray:
        """Sum cells over pixels."""
        rows, columns = self.shape
        parts = cells.reshape(rows, self.fine_rows, columns, self.fine_columns)
        return np.asarray(parts.sum(axis=(1, 3)))


def picture_grid(setup: Setup) -> PictureGrid:
    """Cut large pixels into cells; leave small ones whole."""
    rows, columns = setup.receiver.rows, setup.receiver.columns
    fine_rows, fine_columns = math.ceil(FEWEST_CELLS / rows), math.ceil(FEWEST_CELLS / columns)
    return PictureGrid((rows, columns), fine_rows, fine_columns)
