"""The generative fit: the clean simulated picture, moved, blurred and lit until it is the raw frame.

The frame is never resampled. The amplitudes of the appearance are solved at every step (variable
projection); motion and blur are stepped by damped Gauss–Newton with Huber weights against hot
pixels. Where the data say little about perspective and stretch, a weak prior on them does.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from imclab.registration import sampling
from imclab.registration.appearance import BACKGROUND, FULL, PLAIN, Fields, slopes, terms
from imclab.registration.motion import Matrix, Prior, moved_back, stepped, velocities
from imclab.registration.reference import Reference
from imclab.registration.whitening import Noise

Vector = NDArray[np.float64]

_HUBER = 3.0
"""Residuals beyond so many standard deviations count linearly."""
_MOST_EXCUSED = 0.1
_CONVERGED_PX = 2e-3
_LONGEST_STEP_PX = 3.0
_SHARPEST = -0.8
"""Variance of the blur when the frame is sharper than the simulated picture, in px²."""
_LARGEST_BLUR = 0.25
"""Of the target's radius: beyond this nothing of the figure is left to recognise."""


class Pixels(NamedTuple):
    """Pixels of the frame that take part: places (x, y), values, and the width of a pixel."""

    x: Vector
    y: Vector
    value: Vector
    width: int


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
        Terms of the appearance, background first.
    slopes : float64 array (parameters + 1, n)
        Derivatives of the model by motion and blur.
    amplitudes : float64 array (terms,)
    value, residual, weight : float64 arrays (n,)
        What was measured, what the model leaves of it, and how much each pixel counts.
    ridge : float64 array (terms,)
        What the square of each amplitude costs.

    All are whitened where the fit was given a noise.
    """

    state: State
    linear: Vector
    slopes: Vector
    amplitudes: Vector
    value: Vector
    residual: Vector
    weight: Vector
    ridge: Vector

    def cost(self, weight: Vector) -> float:
        """Weighted sum of squares of the residual."""
        return float(weight @ self.residual**2)

    def mean_cost(self) -> float:
        """Weighted mean square of the residual."""
        return self.cost(self.weight) / self.weight.size

    def penalty(self) -> float:
        """What the amplitudes cost."""
        return float(self.ridge @ self.amplitudes**2)

    def projected_slopes(self) -> tuple[Vector, Vector]:
        """Return the slopes without what the amplitudes could explain, and the information that leaves.

        The information counts the ridge as well: amplitudes that may not move freely explain less.
        """
        coupling = _least_squares(self.linear, self.weight, self.slopes.T, self.ridge)
        return self.slopes - coupling.T @ self.linear, coupling.T @ (self.ridge[:, None] * coupling)

    def explained(self) -> float:
        """Share of the frame's structure, beyond the background, that the figure explains."""
        return _explained(self.linear, self.weight, self.value)


class Task(NamedTuple):
    """What stays the same during a fit."""

    reference: Reference
    pixels: Pixels
    parameters: int
    term_count: int
    noise: Noise | None
    ridge: Vector

    def linearised(self, state: State, weight: Vector) -> Linearised:
        """Return the model at a state, its amplitudes solved for under the weights."""
        x, y = moved_back(state.matrix, self.pixels.x, self.pixels.y)
        fields = _fields(self.reference, self.pixels, state.blur, x, y)
        linear = self._whitened(terms(fields, self.term_count))
        value = self._whitened(self.pixels.value[None])[0]
        amplitudes = _least_squares(linear, weight, value, self.ridge)
        by_x, by_y, by_blur = slopes(fields, amplitudes)
        frame = self.reference.frame
        speeds = velocities((x - frame.x) / frame.radius, (y - frame.y) / frame.radius, self.parameters)
        by_motion = [-frame.radius * (by_x * p + by_y * q) for p, q in speeds]
        by_all = self._whitened(np.stack([*by_motion, by_blur]))
        residual = value - amplitudes @ linear
        return Linearised(state, linear, by_all, amplitudes, value, residual, weight, self.ridge)

    def _whitened(self, fields: Vector) -> Vector:
        return fields if self.noise is None else self.noise.whitened(fields)


def choose_pixels(frame: Pixels, reference: Reference, matrix: Matrix) -> Pixels:
    """Keep the pixels that see the target or its surroundings, under a first motion."""
    rows, cols = reference.picture.shape
    x, y = moved_back(matrix, frame.x, frame.y)
    near = (x > 2.5) & (x < cols - 3.5) & (y > 2.5) & (y < rows - 3.5)
    distance = reference.distance[y[near].round().astype(int), x[near].round().astype(int)]
    near[near] = distance < reference.margin
    return Pixels(frame.x[near], frame.y[near], frame.value[near], frame.width)


def likeness(reference: Reference, pixels: Pixels, state: State, noise: float) -> float:
    """Share of the frame's structure, beyond background and noise, that the picture itself explains.

    One amplitude: no halo, no tone, no illumination, which could imitate other structure. Negative
    when the frame shows the reverse of the picture. ``noise`` is the variance of a pixel; no more
    than a tenth of the structure is put down to it, or a wrong picture would be excused by noise.
    """
    x, y = moved_back(state.matrix, pixels.x, pixels.y)
    fields = _fields(reference, pixels, state.blur + pixels.width**2 / 12, x, y)
    linear = terms(fields, PLAIN)[: BACKGROUND + 1]
    weight = np.ones_like(pixels.value)
    sign = np.sign(_least_squares(linear, weight, pixels.value)[-1])
    left = 1 - _explained(linear, weight, pixels.value)
    background = linear[:BACKGROUND]
    rest = pixels.value - _least_squares(background, weight, pixels.value) @ background
    excused = min(noise / max(float(np.mean(rest * rest)), 1e-300), _MOST_EXCUSED, left)
    return float(sign * (1 - left) / (1 - excused))


def fit(
    reference: Reference,
    pixels: Pixels,
    start: State,
    *,
    parameters: int,
    steps: int,
    term_count: int = FULL,
    prior: Prior | None = None,
    noise: Noise | None = None,
    ridge: Vector | None = None,
) -> Linearised:
    """Fit motion and blur from a start; return the model at the best state found."""
    task = Task(
        reference, pixels, parameters, term_count, noise, np.zeros(term_count) if ridge is None else ridge
    )
    best = _reweighted(task.linearised(start, np.ones_like(pixels.value)))
    damping = 1e-3
    largest = (_LARGEST_BLUR * reference.frame.radius) ** 2
    for _ in range(steps):
        step = _step(best, damping, reference, prior)
        reach = float(np.abs(step[:-1]).max()) * reference.frame.radius
        step = step * min(1.0, _LONGEST_STEP_PX / max(reach, 1e-12))
        blur = float(np.clip(best.state.blur + step[-1], *_near(best.state.blur)))
        state = State(stepped(best.state.matrix, step[:-1], reference.frame), min(blur, largest))
        trial = task.linearised(state, best.weight)
        if _objective(trial, best.weight, reference, prior) <= _objective(
            best, best.weight, reference, prior
        ):
            best = _reweighted(trial)
            damping = max(damping / 5, 1e-6)
            if reach < _CONVERGED_PX:
                break
        else:
            damping *= 10
            if damping > 1e3:
                break
    return best


def _objective(model: Linearised, weight: Vector, reference: Reference, prior: Prior | None) -> float:
    penalty = 0.0 if prior is None else prior.penalty(model.state.matrix, reference.frame)
    return model.cost(weight) + model.penalty() + penalty


def _near(blur: float) -> tuple[float, float]:
    """Least and largest variance of the blur that one step may lead to."""
    return max(min(0.25 * blur, blur - 0.3), _SHARPEST), 4 * max(blur, 0.0) + 0.5


def _fields(reference: Reference, pixels: Pixels, blur: float, x: Vector, y: Vector) -> Fields:
    sampled = np.empty((3, 4, x.size))
    for spline, out in zip(
        (sampling.coefficients(reference.picture, blur), reference.halo, reference.veil), sampled, strict=True
    ):
        sampling.sample(spline, x, y, out)
    u, v = (2 * (place - place.mean()) / max(np.ptp(place), 1.0) for place in (pixels.x, pixels.y))
    return Fields(sampled[0], sampled[1], sampled[2], u, v)


def _least_squares(linear: Vector, weight: Vector, target: Vector, ridge: Vector | None = None) -> Vector:
    """Solve for amplitudes; 1e-9 more keeps terms apart that a two-valued picture makes equal."""
    weighted = linear * weight
    gram = weighted @ linear.T
    gram[np.diag_indices_from(gram)] *= 1 + 1e-9
    gram[np.diag_indices_from(gram)] += 1e-300 if ridge is None else ridge + 1e-300
    return np.asarray(np.linalg.solve(gram, weighted @ target))


def _explained(linear: Vector, weight: Vector, value: Vector) -> float:
    background = linear[:BACKGROUND]
    rest = value - _least_squares(background, weight, value) @ background
    left = value - _least_squares(linear, weight, value) @ linear
    return max(1 - float(weight @ left**2) / max(float(weight @ rest**2), 1e-300), 0.0)


def _reweighted(model: Linearised) -> Linearised:
    floor = 1e-12 * float(np.abs(model.amplitudes).max()) + 1e-300
    size = np.abs(model.residual) / (1.4826 * float(np.median(np.abs(model.residual))) + floor)
    return replace(model, weight=_HUBER / np.maximum(size, _HUBER))


def _step(model: Linearised, damping: float, reference: Reference, prior: Prior | None) -> Vector:
    projected, information = model.projected_slopes()
    information = information + (projected * model.weight) @ projected.T
    right = (model.slopes * model.weight) @ model.residual
    if prior is not None:
        pull, stiffness = prior.pull(model.state.matrix, reference.frame, len(right))
        information, right = information + np.diag(stiffness), right + pull
    diagonal = np.diag(information)
    return np.asarray(
        np.linalg.solve(information + np.diag(damping * diagonal + 1e-12 * diagonal.max() + 1e-300), right)
    )
