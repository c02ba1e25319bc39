"""From two pictures to a motion: check, search, fit, judge."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from imclab.errors import Fault, InputError
from imclab.registration.appearance import FULL, PLAIN, ridge
from imclab.registration.coarse import candidates
from imclab.registration.fit import Linearised, Pixels, State, choose_pixels, fit
from imclab.registration.motion import PARAMETERS, Matrix, Prior, magnification, simplified
from imclab.registration.reference import Reference, prepare
from imclab.registration.result import Registration
from imclab.registration.uncertainty import leftover
from imclab.registration.verdict import Found, judged, nothing
from imclab.registration.whitening import grid_of, noise_of

_CANDIDATES = 3
_COARSE_RADIUS = 8.0
"""Radius of the target, in binned pixels, at which candidates are judged."""
_MOST_PIXELS = 80_000
"""Above this the frame is binned once more: edges that are blurred over pixels lose nothing."""
_FEWEST_PIXELS = 80
_OUTLIER = 4.0
"""Standard deviations at which a residual is cut before the noise is read from it."""
_SMALLEST_SIDE = 24


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
        of them that explains the frame (Schwarz's criterion, with the noise of independent pixels).

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
        return nothing("the simulated picture shows no target", wanted, shapes)
    if usable.mean() < 0.5 or np.ptp(frame[usable]) == 0:
        return nothing("the frame is blank: no usable pixel differs from another", wanted, shapes)
    clean = cv2.medianBlur(frame.astype(np.float32), 3).astype(np.float64)
    start = _best_start(reference, clean, "homography" if model == "auto" else model)
    if start is None:
        return nothing("the target was not found in the frame", wanted, shapes)
    pyramid = _Pyramid(frame, clean, usable)
    chosen = _simplest(reference, pyramid, start) if model == "auto" else model
    found = _refined(reference, pyramid, start, chosen)
    if found is None:
        return nothing("too little of the target lies inside the frame", chosen, shapes)
    matrix = found.model.state.matrix
    noise = _coarse_noise(clean, _coarse_width(reference, matrix))
    return judged(reference, found, _coarse_pixels(reference, clean, matrix), noise, shapes)


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


def _coarse_pixels(reference: Reference, clean: NDArray[np.float64], matrix: Matrix) -> Pixels:
    """Bin the frame until the target is small, and keep its surroundings."""
    return choose_pixels(_binned(clean, _coarse_width(reference, matrix)), reference, matrix)


def _coarse_width(reference: Reference, matrix: Matrix) -> int:
    return int(max(reference.frame.radius * magnification(matrix) / _COARSE_RADIUS, 1))


def _coarse_noise(clean: NDArray[np.float64], width: int) -> float:
    """Variance of the noise of binned pixels, from second differences over all of the frame.

    Their median passes over the few that a target's edges make large.
    """
    rows, cols = (size // width for size in clean.shape)
    value = _binned(clean, width).value.reshape(rows, cols)
    middle = [
        float(np.median(np.abs(np.diff(value, 2, axis=axis)))) if value.shape[axis] > 2 else np.inf
        for axis in (0, 1)
    ]
    return (1.4826 * min(middle)) ** 2 / 6 if np.isfinite(min(middle)) else 0.0


def _best_start(reference: Reference, clean: NDArray[np.float64], model: str) -> State | None:
    """Refine the coarse candidates on binned pixels; return what explains most.

    A similarity first. Where the motion may be freer, an affine one follows with the plain
    appearance: what a similarity leaves of a sheared figure the full appearance would imitate.
    """
    best, best_share = None, 0.0
    for candidate in candidates(reference, clean, count=_CANDIDATES):
        pixels = _coarse_pixels(reference, clean, candidate.matrix)
        if pixels.x.size < _FEWEST_PIXELS:
            continue
        plain = partial(fit, reference, pixels, steps=8, term_count=PLAIN)
        fitted = plain(State(candidate.matrix, 9.0), parameters=PARAMETERS["similarity"])
        if PARAMETERS[model] > PARAMETERS["similarity"]:
            prior = Prior(leftover(fitted, pixels).noise, reference.perspective)
            fitted = plain(fitted.state, parameters=PARAMETERS["affine"], prior=prior)
        share = fitted.explained()
        if share > best_share:
            best, best_share = fitted.state, share
    return best


def _refined(reference: Reference, pyramid: _Pyramid, start: State, model: str) -> Found | None:
    """Fit on half-size pixels, on the raw ones, and on these with their noise made white."""
    first = _unweighted(reference, pyramid, start, model)
    return None if first is None else _whitened(reference, first, model)


def _unweighted(reference: Reference, pyramid: _Pyramid, start: State, model: str) -> Found | None:
    """Fit with equal weights, the appearance plain and then full; prior and ridge follow the noise."""
    state = State(simplified(start.matrix, model, reference.frame), min(start.blur, 4.0))
    radius = reference.frame.radius * magnification(state.matrix)
    finest = int(max(np.ceil(np.sqrt((2.5 * radius) ** 2 / _MOST_PIXELS)), 1))
    found: Found | None = None
    for width, steps, terms in ((2 * finest, 8, PLAIN), (2 * finest, 8, FULL), (finest, 4, FULL)):
        pixels = choose_pixels(pyramid.pixels(width), reference, state.matrix)
        if pixels.x.size < _FEWEST_PIXELS:
            continue
        fitted = fit(
            reference,
            pixels,
            state,
            parameters=PARAMETERS[model],
            steps=steps,
            term_count=terms,
            prior=None if found is None else found.prior,
            ridge=None if found is None else found.ridge(terms),
        )
        state = fitted.state
        found = _found(reference, fitted, pixels, model)
    return found


def _whitened(reference: Reference, first: Found, model: str) -> Found:
    """Fit a motion once more with the noise that a first fit left over; outliers are cut before."""
    fitted, pixels = first.model, first.pixels
    brightness = pixels.value - fitted.residual
    most = _OUTLIER * 1.4826 * float(np.median(np.abs(fitted.residual)))
    kept = np.clip(fitted.residual, -most, most)
    again = fit(
        reference,
        pixels._replace(value=brightness + kept),
        State(simplified(fitted.state.matrix, model, reference.frame), fitted.state.blur),
        parameters=PARAMETERS[model],
        steps=8,
        prior=first.prior._replace(noise=1.0),
        noise=noise_of(kept, brightness, grid_of(pixels.x, pixels.y, pixels.width)),
        ridge=ridge(fitted.linear, fitted.amplitudes, 1.0),
    )
    return _found(reference, again, pixels, model)


def _found(reference: Reference, model: Linearised, pixels: Pixels, name: str) -> Found:
    left = leftover(model, pixels)
    return Found(model, pixels, left, Prior(left.noise, reference.perspective), name)


def _simplest(reference: Reference, pyramid: _Pyramid, start: State) -> str:
    """Choose the motion by Schwarz's criterion, all measured with the noise the freest one left."""
    first = _unweighted(reference, pyramid, start, "homography")
    if first is None:
        return "similarity"
    results = {model: _whitened(reference, first, model) for model in PARAMETERS}
    pixels = first.pixels.x.size
    scores = {
        model: pixels * found.model.mean_cost() / results["homography"].left.noise
        + np.log(pixels) * PARAMETERS[model]
        for model, found in results.items()
    }
    return min(scores, key=lambda model: scores[model])
