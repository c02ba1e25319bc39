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
from scipy.linalg import expm, logm

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


_STRETCH = 0.06


class Frame(NamedTuple):
    """Where the target is in the simulated picture: the origin and unit of the parameters."""

    x: float
    y: float
    radius: float

    def matrix(self) -> Matrix:
        """Return T, from pixels to target units."""
        return np.array(
            [
                [1 / self.radius, 0, -self.x / self.radius],
                [0, 1 / self.radius, -self.y / self.radius],
                [0, 0, 1],
            ]
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


def velocities(
    x: NDArray[np.float64], y: NDArray[np.float64], count: int
) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
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


def moved_back(
    matrix: Matrix, x: NDArray[np.float64], y: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Map pixels of the measured frame back into the simulated picture."""
    (a, b, c), (d, e, f), (g, h, i) = np.linalg.inv(matrix)
    depth = g * x + h * y + i
    return (a * x + b * y + c) / depth, (d * x + e * y + f) / depth


def distortion(matrix: Matrix, frame: Frame) -> NDArray[np.float64]:
    """Return stretch, shear and the two perspectives of a motion at the target (target units).

    The linear part A at the centre is a rotation and scale times exp of ((a, b), (b, -a)): a is the
    stretch, b the shear.
    """
    local = matrix @ np.linalg.inv(frame.matrix())
    local = local / local[2, 2]
    linear = local[:2, :2] - np.outer(local[:2, 2], local[2, :2])
    values, vectors = np.linalg.eigh(linear.T @ linear)
    log = vectors @ np.diag(np.log(np.maximum(values, 1e-300)) / 2) @ vectors.T
    return np.array([(log[0, 0] - log[1, 1]) / 2, log[0, 1], -local[2, 0], -local[2, 1]])


class Prior(NamedTuple):
    """What a flat target in front of a long lens can do, against what noise would make of it.

    A standard deviation of 0.06 for stretch and shear (a tilt by 28 degrees stretches by 0.06) and
    of ``perspective`` for the perspectives, times ``noise``, the variance of one independent pixel.
    """

    noise: float
    perspective: float

    def stiffness(self) -> NDArray[np.float64]:
        """Weights of the squared distortions."""
        return self.noise / np.array([_STRETCH, _STRETCH, self.perspective, self.perspective]) ** 2

    def penalty(self, matrix: Matrix, frame: Frame) -> float:
        """Return what the distortions of a motion cost."""
        return float(self.stiffness() @ distortion(matrix, frame) ** 2)

    def pull(
        self, matrix: Matrix, frame: Frame, count: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the gradient step and the stiffness for ``count`` parameters, the blur last."""
        stiffness, gradient = np.zeros(count), np.zeros(count)
        used = max(count - 1 - 4, 0)
        stiffness[4 : 4 + used] = self.stiffness()[:used]
        gradient[4 : 4 + used] = -(self.stiffness() * distortion(matrix, frame))[:used]
        return gradient, stiffness


def magnification(matrix: Matrix) -> float:
    """Return pixels of the frame per pixel of the simulated picture."""
    return float(np.sqrt(abs(np.linalg.det(matrix[:2, :2]))))


def jacobian(matrix: Matrix, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Derivative of the mapped points by the points (n, 2, 2)."""
    homogeneous = points @ matrix[:, :2].T + matrix[:, 2]
    depth = homogeneous[:, 2]
    image = homogeneous[:, :2] / depth[:, None]
    slope = matrix[None, :2, :2] - image[:, :, None] * matrix[None, 2:, :2]
    return np.asarray(slope / depth[:, None, None])


def parameters_between(matrix: Matrix, other: Matrix, frame: Frame) -> NDArray[np.float64]:
    """Return the eight parameters of the step that leads from one motion to another."""
    to_unit = frame.matrix()
    change = to_unit @ np.linalg.solve(matrix, other) @ np.linalg.inv(to_unit)
    change = change / np.cbrt(np.linalg.det(change))
    log = np.real(logm(change))
    log = log - log[2, 2] * np.eye(3)
    basis = _GENERATORS.reshape(len(_GENERATORS), -1).T
    return np.asarray(np.linalg.lstsq(basis, log.ravel(), rcond=None)[0])


def simplified(matrix: Matrix, model: str, frame: Frame) -> Matrix:
    """Return the translation, rotation or similarity that agrees with a motion at the target.

    A freer model keeps the motion as it is.
    """
    if PARAMETERS[model] > PARAMETERS["similarity"]:
        return matrix
    centre = np.array([[frame.x, frame.y]])
    local = jacobian(matrix, centre)[0]
    turn = np.arctan2(local[1, 0] - local[0, 1], local[0, 0] + local[1, 1]) if model != "translation" else 0.0
    zoom = np.sqrt(abs(np.linalg.det(local))) if model not in ("translation", "euclidean") else 1.0
    out = np.eye(3)
    out[:2, :2] = zoom * np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    out[:2, 2] = moved(matrix, centre)[0] - out[:2, :2] @ centre[0]
    return out
