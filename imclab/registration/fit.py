"""The generative fit: the clean simulated picture, moved, blurred and lit until it is the raw frame.

The frame is never resampled. Per pixel the model is

    background(u, v) + R·(a + b u + c v) + d R² + e H

with R the simulated picture through the motion and a Gaussian blur, H the same through a wide blur
(halo), and a quadratic background: tone, illumination, halo and background enter linearly and are
solved at every step (variable projection); motion and blur are stepped by damped Gauss–Newton with
Huber weights against hot pixels.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from imclab.registration import sampling
from imclab.registration.motion import Matrix, jacobian, stepped, velocities
from imclab.registration.reference import Reference

Vector = NDArray[np.float64]

_HUBER = 1.5
"""Residuals beyond so many standard deviations count linearly."""
_BACKGROUND_TERMS = 6
_FIGURE_TERMS = 5


class Pixels(NamedTuple):
    """Pixels of the frame that take part: places (x, y) and values."""

    x: Vector
    y: Vector
    value: Vector


class State(NamedTuple):
    """What is stepped: the motion and the blur (variance in px² of the simulated picture)."""

    matrix: Matrix
    blur: float


@dataclass(frozen=True)
class Linearised:
    """The model and its derivatives at one state.

    Attributes
    ----------
    linear : float64 array (terms, n)
        Basis of background and figure.
    slopes : float64 array (parameters + 1, n)
        Derivatives of the model by motion and blur.
    amplitudes : float64 array (terms,)
    residual, weight : float64 arrays (n,)
    """

    state: State
    linear: Vector
    slopes: Vector
    amplitudes: Vector
    residual: Vector
    weight: Vector

    def cost(self, weight: Vector) -> float:
        """Weighted sum of squares."""
        return float(weight @ self.residual**2)


def choose_pixels(frame: Pixels, reference: Reference, matrix: Matrix) -> Pixels:
    """Keep the pixels that see the target or its surroundings, under a first motion."""
    rows, cols = reference.picture.shape
    x, y = _back(matrix, frame)
    inside = (x > 2.5) & (x < cols - 3.5) & (y > 2.5) & (y < rows - 3.5)
    near = inside.copy()
    near[inside] = reference.distance[y[inside].round().astype(int), x[inside].round().astype(int)] < reference.margin
    return Pixels(*(part[near] for part in frame))


def fit(reference: Reference, pixels: Pixels, start: State, *, parameters: int, steps: int) -> Linearised:
    """Fit motion and blur from a start; returns the model at the best state found."""
    best = _linearised(reference, pixels, start, parameters, None)
    damping = 1e-3
    for _ in range(steps):
        step = _solved(best, damping)
        reach = float(np.abs(step[:-1]).max()) * reference.frame.radius
        step = step * min(1.0, 3.0 / max(reach, 1e-12))
        blur = float(np.clip(best.state.blur + step[-1], 0.25 * best.state.blur, 4 * best.state.blur + 0.5))
        state = State(stepped(best.state.matrix, step[:-1], reference.frame), min(blur, 100.0))
        trial = _linearised(reference, pixels, state, parameters, best.weight)
        if trial.cost(best.weight) <= best.cost(best.weight):
            best = _reweighted(trial)
            damping = max(damping / 5, 1e-6)
            if reach < 2e-3:
                break
        else:
            damping *= 10
            if damping > 1e3:
                break
    return best


def _back(matrix: Matrix, pixels: Pixels) -> tuple[Vector, Vector]:
    inverse = np.linalg.inv(matrix)
    depth = inverse[2, 0] * pixels.x + inverse[2, 1] * pixels.y + inverse[2, 2]
    x = (inverse[0, 0] * pixels.x + inverse[0, 1] * pixels.y + inverse[0, 2]) / depth
    y = (inverse[1, 0] * pixels.x + inverse[1, 1] * pixels.y + inverse[1, 2]) / depth
    return x, y


def _linearised(
    reference: Reference, pixels: Pixels, state: State, parameters: int, weight: Vector | None
) -> Linearised:
    x, y = _back(state.matrix, pixels)
    sharp, wide = np.empty((4, x.size)), np.empty((4, x.size))
    sampling.sample(sampling.coefficients(reference.picture, state.blur), x, y, sharp)
    sampling.sample(reference.halo, x, y, wide)
    u = 2 * (pixels.x - pixels.x.mean()) / np.ptp(pixels.x)
    v = 2 * (pixels.y - pixels.y.mean()) / np.ptp(pixels.y)
    figure = sharp[0]
    linear = np.stack(
        [np.ones_like(u), u, v, u * u, u * v, v * v, figure, figure * u, figure * v, figure * figure, wide[0]]
    )
    used = np.ones_like(u) if weight is None else weight
    weighted = linear * used
    gram = weighted @ linear.T
    gram[np.diag_indices_from(gram)] *= 1 + 1e-9
    amplitudes = np.linalg.solve(gram, weighted @ pixels.value)
    residual = pixels.value - amplitudes @ linear
    a, b, c, d, e = amplitudes[_BACKGROUND_TERMS:]
    tone = a + b * u + c * v + 2 * d * figure
    slope_x = tone * sharp[1] + e * wide[1]
    slope_y = tone * sharp[2] + e * wide[2]
    frame = reference.frame
    speeds = velocities((x - frame.x) / frame.radius, (y - frame.y) / frame.radius, parameters)
    slopes = np.stack([-frame.radius * (slope_x * p + slope_y * q) for p, q in speeds] + [tone * sharp[3] / 2])
    new = Linearised(state, linear, slopes, amplitudes, residual, used)
    return _reweighted(new) if weight is None else new


def _reweighted(model: Linearised) -> Linearised:
    scale = 1.4826 * float(np.median(np.abs(model.residual))) + 1e-12 * float(np.abs(model.amplitudes).max())
    size = np.abs(model.residual) / max(scale, 1e-300)
    weight = np.where(size > _HUBER, _HUBER / np.maximum(size, 1e-12), 1.0)
    return Linearised(model.state, model.linear, model.slopes, model.amplitudes, model.residual, weight)


def normal_equations(model: Linearised) -> tuple[Vector, Vector]:
    """Return the information of motion and blur with the linear terms projected out, and the slopes so projected."""
    weighted = model.linear * model.weight
    gram = weighted @ model.linear.T
    gram[np.diag_indices_from(gram)] *= 1 + 1e-9
    projected = model.slopes - np.linalg.solve(gram, weighted @ model.slopes.T).T @ model.linear
    return (projected * model.weight) @ projected.T, projected


def _solved(model: Linearised, damping: float) -> Vector:
    information, projected = normal_equations(model)
    right = (projected * model.weight) @ model.residual
    diagonal = np.diag(information)
    information = information + np.diag(damping * diagonal + 1e-12 * diagonal.max() + 1e-300)
    return np.asarray(np.linalg.solve(information, right))
