"""From two pictures to a motion: check, search, fit, judge."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from imclab.errors import Fault, InputError
from imclab.registration.appearance import PLAIN
from imclab.registration.coarse import candidates
from imclab.registration.fit import Linearised, Pixels, State, choose_pixels, fit
from imclab.registration.motion import PARAMETERS, Matrix, Prior, displacements, simplified
from imclab.registration.reference import Reference, prepare
from imclab.registration.result import Registration
from imclab.registration.uncertainty import Leftover, covariance, leftover

_CANDIDATES = 3
_COARSE_RADIUS = 8.0
"""Radius of the target, in binned pixels, at which candidates are judged."""
_MOST_PIXELS = 80_000
"""Above this the frame is binned once more: edges that are blurred over pixels lose nothing."""
_FEWEST_PIXELS = 150
_SMALLEST_SIDE = 24
_LEAST_QUALITY = 0.25
_LEAST_CONTRAST = 20.0
_LARGEST_STDERR = 0.5
"""Of the target's radius: beyond this a motion is no answer."""


class Found(NamedTuple):
    """A fitted motion with the pixels it was fitted to and what it left over."""

    model: Linearised
    pixels: Pixels
    left: Leftover
    prior: Prior


def register(fixed: ArrayLike, moving: ArrayLike, model: str = "similarity") -> Registration:
    """Find the motion from a simulated picture to a measured frame.

    Parameters
    ----------
    fixed : array_like (rows, cols)
        The clean simulated picture. Any unit; all pixels finite.
    moving : array_like (rows, cols)
        The raw measured frame, of any size. Pixels that are not finite are left out.
    model : str
        "translation", "euclidean", "similarity", "affine", "homography", or "auto" for the simplest
        of them that explains the frame (Akaike's criterion on independent pixels).

    Returns
    -------
    Registration
        With ``ok`` False and a ``reason`` when the frame does not show the target.

    Raises
    ------
    InputError
        (A ValueError.) Pictures that are not two-dimensional, real and large enough; a simulated
        picture that is not finite; an unknown model.
    """
    simulated, frame, usable = _checked(fixed, moving, model)
    shapes = (simulated.shape, frame.shape)
    wanted = "similarity" if model == "auto" else model
    reference = prepare(simulated)
    if reference is None:
        return _nothing("the simulated picture shows no target", wanted, shapes)
    if usable.mean() < 0.5 or np.ptp(frame[usable]) == 0:
        return _nothing("the frame is blank: no usable pixel differs from another", wanted, shapes)
    clean = cv2.medianBlur(frame.astype(np.float32), 3).astype(np.float64)
    start = _best_start(reference, clean)
    if start is None:
        return _nothing("the target was not found in the frame", wanted, shapes)
    pyramid = _Pyramid(frame, clean, usable)
    chosen = _simplest(reference, pyramid, start) if model == "auto" else model
    found = _refined(reference, pyramid, start, chosen)
    if found is None:
        return _nothing("too little of the target lies inside the frame", chosen, shapes)
    return _judged(reference, found, chosen, shapes)


class _Pyramid(NamedTuple):
    frame: NDArray[np.float64]
    clean: NDArray[np.float64]
    usable: NDArray[np.bool_]

    def pixels(self, width: int) -> Pixels:
        if width > 1:
            return _binned(self.clean, width)
        y, x = np.nonzero(self.usable)
        return Pixels(x.astype(float), y.astype(float), self.frame[self.usable], 1)


def _checked(
    fixed: ArrayLike, moving: ArrayLike, model: str
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    faults = []
    if model != "auto" and model not in PARAMETERS:
        faults.append(Fault("model", repr(model), "auto, " + ", ".join(PARAMETERS)))
    arrays = {"fixed": np.asarray(fixed), "moving": np.asarray(moving)}
    for name, array in arrays.items():
        if array.dtype.kind not in "biuf":
            faults.append(Fault(name, f"pixels of type {array.dtype}", "real numbers"))
        elif array.ndim != 2 or min(array.shape) < _SMALLEST_SIDE:
            wanted = f"one grey picture of at least {_SMALLEST_SIDE} x {_SMALLEST_SIDE} pixels"
            faults.append(Fault(name, f"shape {array.shape}", wanted))
    if not faults and not np.isfinite(arrays["fixed"]).all():
        count = int((~np.isfinite(arrays["fixed"])).sum())
        faults.append(Fault("fixed", f"{count} pixels NaN or infinite", "a finite simulated picture"))
    if faults:
        raise InputError("registration", faults)
    frame = arrays["moving"].astype(np.float64)
    usable = np.isfinite(frame)
    if not usable.all():
        frame = np.where(usable, frame, np.median(frame[usable]) if usable.any() else 0.0)
    return arrays["fixed"].astype(np.float64), frame, usable


def _binned(picture: NDArray[np.float64], width: int) -> Pixels:
    rows, cols = (size // width for size in picture.shape)
    value = picture[: rows * width, : cols * width].reshape(rows, width, cols, width).mean(axis=(1, 3))
    y, x = (place.ravel() * width + (width - 1) / 2 for place in np.mgrid[:rows, :cols])
    return Pixels(x, y, value.ravel(), width)


def _magnification(matrix: Matrix) -> float:
    return float(np.sqrt(abs(np.linalg.det(matrix[:2, :2]))))


def _best_start(reference: Reference, clean: NDArray[np.float64]) -> State | None:
    """Refine the coarse candidates as similarities on binned pixels; return what explains most."""
    best, best_share = None, 0.0
    for candidate in candidates(reference, clean, count=_CANDIDATES):
        radius = reference.frame.radius * _magnification(candidate.matrix)
        width = int(max(radius / _COARSE_RADIUS, 1))
        pixels = choose_pixels(_binned(clean, width), reference, candidate.matrix)
        if pixels.x.size < _FEWEST_PIXELS:
            continue
        start = State(candidate.matrix, 9.0)
        model = fit(reference, pixels, start, parameters=PARAMETERS["similarity"], steps=8, term_count=PLAIN)
        share = model.explained(pixels.value)
        if share > best_share:
            best, best_share = model.state, share
    return best


def _refined(reference: Reference, pyramid: _Pyramid, start: State, model: str) -> Found | None:
    """Fit on half-size pixels, then on the raw ones, with the prior scaled by the noise found."""
    state = State(simplified(start.matrix, model, reference.frame), min(start.blur, 4.0))
    count = PARAMETERS[model]
    radius = reference.frame.radius * _magnification(state.matrix)
    finest = int(max(np.ceil(np.sqrt((2.5 * radius) ** 2 / _MOST_PIXELS)), 1))
    prior, found = None, None
    for width, steps in ((2 * finest, 10), (finest, 4), (finest, 8)):
        pixels = choose_pixels(pyramid.pixels(width), reference, state.matrix)
        if pixels.x.size < _FEWEST_PIXELS:
            return None
        fitted = fit(reference, pixels, state, parameters=count, steps=steps, prior=prior)
        state = fitted.state
        left = leftover(fitted, pixels)
        prior = Prior(left.noise, reference.perspective)
        found = Found(fitted, pixels, left, prior)
    return found


def _simplest(reference: Reference, pyramid: _Pyramid, start: State) -> str:
    """Choose the motion by Akaike's criterion, counting independent pixels only."""
    results = {model: _refined(reference, pyramid, start, model) for model in PARAMETERS}
    freest = results["homography"]
    if freest is None:
        return "similarity"
    noise = freest.left.noise
    scores = {
        model: found.model.cost(found.model.weight) / noise + 2 * PARAMETERS[model]
        for model, found in results.items()
        if found is not None
    }
    return min(scores, key=lambda model: scores[model])


def _judged(
    reference: Reference, found: Found, model: str, shapes: tuple[tuple[int, ...], tuple[int, ...]]
) -> Registration:
    fitted, frame = found.model, reference.frame
    matrix = fitted.state.matrix
    spread = covariance(fitted, found.left, reference=reference, prior=found.prior)
    rows, cols = shapes[0]
    corners = np.array([[0, 0], [cols - 1, 0], [0, rows - 1], [cols - 1, rows - 1]], dtype=np.float64)
    figure = np.argwhere(reference.target)[:, ::-1].astype(np.float64)
    thin = slice(None, None, max(len(figure) // 500, 1))
    at_corners = _stderr(matrix, corners, reference, spread)
    at_target = float(np.sqrt(np.mean(_stderr(matrix, figure[thin], reference, spread) ** 2)))
    share = fitted.explained(found.pixels.value)
    signal = share / max(1 - share, 1e-12) * fitted.cost(fitted.weight)
    contrast = float(np.sqrt(signal / max(found.left.noise, 1e-300)))
    reason = ""
    if share < _LEAST_QUALITY or contrast < _LEAST_CONTRAST:
        reason = (
            f"the frame does not show the target: it explains {share:.2f} of the structure "
            f"(least {_LEAST_QUALITY}), {contrast:.1f} times the noise (least {_LEAST_CONTRAST:g})"
        )
    elif at_target > _LARGEST_STDERR * frame.radius * _magnification(matrix):
        reason = f"the motion is too uncertain: {at_target:.1f} px at the target"
    return Registration(
        matrix=_frozen(matrix),
        model=model,
        ok=not reason,
        reason=reason,
        quality=share,
        contrast=contrast,
        covariance=_frozen(spread),
        stderr_px=float(np.sqrt(np.mean(at_corners**2))),
        corner_stderr_px=_frozen(at_corners),
        target_stderr_px=at_target,
        blur_px=float(np.sqrt(max(fitted.state.blur, 0.0))),
        fixed_shape=(rows, cols),
        moving_shape=(shapes[1][0], shapes[1][1]),
        frame=frame,
    )


def _stderr(
    matrix: Matrix, points: NDArray[np.float64], reference: Reference, spread: NDArray[np.float64]
) -> NDArray[np.float64]:
    slope = displacements(matrix, points, reference.frame, len(spread))
    return np.asarray(np.sqrt(np.einsum("nik,kl,nil->n", slope, spread, slope)))


def _nothing(reason: str, model: str, shapes: tuple[tuple[int, ...], tuple[int, ...]]) -> Registration:
    from imclab.registration.motion import Frame

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


def _frozen(array: NDArray[np.float64]) -> NDArray[np.float64]:
    array.flags.writeable = False
    return array
