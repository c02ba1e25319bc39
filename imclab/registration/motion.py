"""Plane motions as groups: every step of a fit stays inside its model.

A motion is a 3 x 3 matrix H from pixel centres (x, y, 1) of the simulated picture to pixel centres
of the measured frame. A step multiplies it from the right, H ← H · T⁻¹ exp(Σ δₖ gₖ) T, where T
brings the target to the origin and to unit size, so the parameters δ are of one magnitude. The
velocity of a point (x, y) in those units under gₖ is listed beside each generator.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import expm

Matrix = NDArray[np.float64]

_GENERATORS = np.array(
    [
        [[0, 0, 1], [0, 0, 0], [0, 0, 0]],  # shift in x: (1, 0)
        [[0, 0, 0], [0, 0, 1], [0, 0, 0]],  # shift in y: (0, 1)
        [[0, -1, 0], [1, 0, 0], [0, 0, 0]],  # rotation: (-y, x)
        [[1, 0, 0], [0, 1, 0], [0, 0, 0]],  # scale: (x, y)
        [[1, 0, 0], [0, -1, 0], [0, 0, 0]],  # stretch: (x, -y)
        [[0, 1, 0], [1, 0, 0], [0, 0, 0]],  # shear: (y, x)
        [[0, 0, 0], [0, 0, 0], [-1, 0, 0]],  # perspective in x: (x², xy)
        [[0, 0, 0], [0, 0, 0], [0, -1, 0]],  # perspective in y: (xy, y²)
    ],
    dtype=np.float64,
)

PARAMETERS = {"translation": 2, "euclidean": 3, "similarity": 4, "affine": 6, "homography": 8}
"""Motions from the simplest to the freest; each takes the first so many generators."""


class Frame(NamedTuple):
    """Where the target is in the simulated picture: the origin and unit of the parameters."""

    x: float
    y: float
    radius: float

    def matrix(self) -> Matrix:
        """Return T, from pixels to target units."""
        return np.array(
            [[1 / self.radius, 0, -self.x / self.radius], [0, 1 / self.radius, -self.y / self.radius], [0, 0, 1]]
        )


def moved(matrix: Matrix, points: ArrayLike) -> NDArray[np.float64]:
    """Map points (n, 2) given as (x, y)."""
    flat = np.asarray(points, dtype=np.float64)
    homogeneous = flat @ matrix[:, :2].T + matrix[:, 2]
    return np.asarray(homogeneous[:, :2] / homogeneous[:, 2:])


def stepped(matrix: Matrix, step: NDArray[np.float64], frame: Frame) -> Matrix:
    """Return the motion after a step of the first ``len(step)`` parameters."""
    to_unit = frame.matrix()
    change = expm(np.tensordot(step, _GENERATORS[: len(step)], axes=1))
    new = matrix @ np.linalg.inv(to_unit) @ change @ to_unit
    return np.asarray(new / new[2, 2])


def velocities(x: NDArray[np.float64], y: NDArray[np.float64], count: int) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Return the velocity fields (in target units) of the first ``count`` generators."""
    one, zero = np.ones_like(x), np.zeros_like(x)
    fields = [(one, zero), (zero, one), (-y, x), (x, y), (x, -y), (y, x), (x * x, x * y), (x * y, y * y)]
    return fields[:count]


def displacements(matrix: Matrix, points: ArrayLike, frame: Frame, count: int) -> NDArray[np.float64]:
    """Derivative of the mapped points by the parameters.

    Returns
    -------
    float64 array (n, 2, count)
        Pixels of the measured frame per unit of each parameter.
    """
    flat = np.asarray(points, dtype=np.float64)
    x, y = (flat[:, 0] - frame.x) / frame.radius, (flat[:, 1] - frame.y) / frame.radius
    speed = np.array(velocities(x, y, count)) * frame.radius
    return np.asarray(np.einsum("nij,kjn->nik", jacobian(matrix, flat), speed))


def jacobian(matrix: Matrix, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Derivative of the mapped points by the points (n, 2, 2)."""
    homogeneous = points @ matrix[:, :2].T + matrix[:, 2]
    depth = homogeneous[:, 2]
    image = homogeneous[:, :2] / depth[:, None]
    slope = matrix[None, :2, :2] - image[:, :, None] * matrix[None, 2:, :2]
    return np.asarray(slope / depth[:, None, None])
