"""From a fit to a result: how sure it is, and whether to believe it.

A rich model of the appearance can imitate a spot, fringes or another target, so what it explains
decides nothing. Five things together do: the picture itself, with one amplitude, must explain most
of the structure on coarse pixels; it must stand out of the noise; the motion must be sharp; the
blur must leave something to recognise; and half of the target must be inside the frame.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from imclab.registration.appearance import ridge
from imclab.registration.fit import Linearised, Pixels, likeness
from imclab.registration.motion import PARAMETERS, Frame, Matrix, Prior, displacements, magnification
from imclab.registration.reference import Reference
from imclab.registration.result import Registration
from imclab.registration.uncertainty import Leftover, covariance

_LEAST_QUALITY = 0.84
"""Frames with the target gave 0.85 and more, 450 frames with another one 0.83 and less."""
_LEAST_CONTRAST = 30.0
"""Frames with the target at 0 dB gave 35 and more, plain noise and empty water 12 and less."""
_LARGEST_STDERR = 0.04
"""At the target, of its radius: with the target 0.031 and less, in 1000 pairs."""
_LARGEST_BLUR = 0.16
"""Of the target's radius: with the target 0.124 and less; a spot that passed by the rest had 0.19."""

_LEAST_SHOWN = 0.5
"""Share of the target inside the frame: part of a target, blown up and blurred, passed for a beam spot."""


class Found(NamedTuple):
    """A fitted motion with the pixels it was fitted to and what it left over."""

    model: Linearised
    pixels: Pixels
    left: Leftover
    prior: Prior
    name: str

    def ridge(self, count: int) -> NDArray[np.float64]:
        """Return what ``count`` amplitudes of a further fit cost beside those found here."""
        return ridge(self.model.linear, self.model.amplitudes, self.left.noise, count)


Shapes = tuple[tuple[int, ...], tuple[int, ...]]


def judged(reference: Reference, found: Found, coarse: Pixels, noise: float, shapes: Shapes) -> Registration:
    """Return the result of a fit; ``coarse`` are binned pixels and ``noise`` the variance of one."""
    fitted, frame = found.model, reference.frame
    matrix = fitted.state.matrix
    spread = covariance(fitted, found.left, reference=reference, prior=found.prior)
    rows, cols = shapes[0]
    corners = np.array([[0, 0], [cols - 1, 0], [0, rows - 1], [cols - 1, rows - 1]], dtype=np.float64)
    figure = np.argwhere(reference.target)[:, ::-1].astype(np.float64)
    thin = slice(None, None, max(len(figure) // 500, 1))
    at_corners = _stderr(matrix, corners, frame, spread)
    at_target = float(np.sqrt(np.mean(_stderr(matrix, figure[thin], frame, spread) ** 2)))
    share = fitted.explained()
    signal = share / max(1 - share, 1e-12) * fitted.cost(fitted.weight)
    contrast = float(np.sqrt(signal / max(found.left.noise, 1e-300)))
    quality = likeness(reference, coarse, fitted.state, noise)
    blur = float(np.sqrt(max(fitted.state.blur, 0.0)))
    relative = at_target / (frame.radius * magnification(matrix))
    shown = _share_inside(matrix, figure, shapes[1])
    reason = _doubt(quality, contrast, relative, blur / frame.radius, shown)
    return Registration(
        matrix=_frozen(matrix),
        model=found.name,
        ok=not reason,
        reason=reason,
        quality=quality,
        contrast=contrast,
        covariance=_frozen(spread),
        stderr_px=float(np.sqrt(np.mean(at_corners**2))),
        corner_stderr_px=_frozen(at_corners),
        target_stderr_px=at_target,
        blur_px=blur,
        fixed_shape=(rows, cols),
        moving_shape=(shapes[1][0], shapes[1][1]),
        frame=frame,
    )


def nothing(reason: str, model: str, shapes: Shapes) -> Registration:
    """Return the result when no motion was found at all."""
    count = PARAMETERS[model]
    return Registration(
        matrix=_frozen(np.full((3, 3), np.nan)),
        model=model,
        ok=False,
        reason=reason,
        quality=0.0,
        contrast=0.0,
        covariance=_frozen(np.full((count, count), np.inf)),
        stderr_px=np.inf,
        corner_stderr_px=_frozen(np.full(4, np.inf)),
        target_stderr_px=np.inf,
        blur_px=np.nan,
        fixed_shape=(shapes[0][0], shapes[0][1]),
        moving_shape=(shapes[1][0], shapes[1][1]),
        frame=Frame(0.0, 0.0, 1.0),
    )


def _share_inside(matrix: Matrix, points: NDArray[np.float64], shape: tuple[int, ...]) -> float:
    """Return the share of points (n, 2) that a motion leaves inside a frame."""
    moved = np.column_stack([points, np.ones(len(points))]) @ matrix.T
    in_front = moved[:, 2] > 0.0
    at = moved[:, :2] / np.where(in_front, moved[:, 2], 1.0)[:, None]
    inside = in_front & np.all((at >= 0.0) & (at <= [shape[1] - 1, shape[0] - 1]), axis=1)
    return float(np.mean(inside))


def _doubt(quality: float, contrast: float, stderr: float, blur: float, shown: float) -> str:
    """Say why a fit is not believed; empty when it is. Stderr and blur in target radii."""
    doubts = []
    if quality < _LEAST_QUALITY:
        doubts.append(f"the picture explains {quality:.2f} of the frame's structure (least {_LEAST_QUALITY})")
    if contrast < _LEAST_CONTRAST:
        doubts.append(f"the target stands {contrast:.1f} times over the noise (least {_LEAST_CONTRAST:g})")
    if not stderr < _LARGEST_STDERR:
        doubts.append(f"its place is uncertain by {stderr:.3f} of its radius (most {_LARGEST_STDERR})")
    if blur > _LARGEST_BLUR:
        doubts.append(f"the blur is {blur:.2f} of its radius (most {_LARGEST_BLUR})")
    if shown < _LEAST_SHOWN:
        doubts.append(f"only {shown:.2f} of it would be inside the frame (least {_LEAST_SHOWN})")
    return f"the frame does not show the target: {', '.join(doubts)}" if doubts else ""


def _stderr(
    matrix: Matrix, points: NDArray[np.float64], frame: Frame, spread: NDArray[np.float64]
) -> NDArray[np.float64]:
    slope = displacements(matrix, points, frame, len(spread))
    return np.asarray(np.sqrt(np.einsum("nik,kl,nil->n", slope, spread, slope)))


def _frozen(array: NDArray[np.float64]) -> NDArray[np.float64]:
    array.flags.writeable = False
    return array
