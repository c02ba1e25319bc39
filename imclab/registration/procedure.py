"""From two pictures to a motion: check, search, fit, judge."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from imclab.errors import Fault, InputError
from imclab.registration.appearance import PLAIN, ridge
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
    start = _best_start(reference, clean)
    if start is None:
        return nothing("the target was not found in the frame", wanted, shapes)
    pyramid = _Pyramid(frame, clean, usable)
    chosen = _simplest(reference, pyramid, start) if model == "auto" else model
    found = _refined(reference, pyramid, start, chosen)
    if found is None:
        return nothing("too little of the target lies inside the frame", chosen, shapes)
    return judged(reference, found, _coarse_pixels(reference, clean, found.model.state.matrix), shapes)


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
    width = int(max(reference.frame.radius * magnification(matrix) / _COARSE_RADIUS, 1))
    return choose_pixels(_binned(clean, width), reference, matrix)


def _best_start(reference: Reference, clean: NDArray[np.float64]) -> State | None:
    """Refine the coarse candidates as similarities on binned pixels; return what explains most."""
    best, best_share = None, 0.0
    for candidate in candidates(reference, clean, count=_CANDIDATES):
        pixels = _coarse_pixels(reference, clean, candidate.matrix)
        if pixels.x.size < _FEWEST_PIXELS:
            continue
        start = State(candidate.matrix, 9.0)
        model = fit(reference, pixels, start, parameters=PARAMETERS["similarity"], steps=8, term_count=PLAIN)
        share = model.explained()
        if share > best_share:
            best, best_share = model.state, share
    return best


def _refined(reference: Reference, pyramid: _Pyramid, start: State, model: str) -> Found | None:
    """Fit on half-size pixels, then on the raw ones, with the prior scaled by the noise found."""
    state = State(simplified(start.matrix, model, reference.frame), min(start.blur, 4.0))
    count = PARAMETERS[model]
    radius = reference.frame.radius * magnification(state.matrix)
    finest = int(max(np.ceil(np.sqrt((2.5 * radius) ** 2 / _MOST_PIXELS)), 1))
    prior, found = None, None
    for width, steps in ((2 * finest, 10), (finest, 4), (finest, 8)):
        pixels = choose_pixels(pyramid.pixels(width), reference, state.matrix)
        if pixels.x.size < _FEWEST_PIXELS:
            continue
        if found is not None and found.pixels.width == width:
            fitted = _whitened_fit(reference, found, steps)
            pixels = found.pixels
        else:
            fitted = fit(reference, pixels, state, parameters=count, steps=steps, prior=prior)
        state = fitted.state
        left = leftover(fitted, pixels)
        prior = Prior(left.noise, reference.perspective)
        found = Found(fitted, pixels, left, prior, model)
    return found


def _whitened_fit(reference: Reference, found: Found, steps: int) -> Linearised:
    """Fit once more with the noise that the last fit left over; outliers are cut first."""
    model, pixels = found.model, found.pixels
    brightness = pixels.value - model.residual
    spread = _OUTLIER * 1.4826 * float(np.median(np.abs(model.residual)))
    kept = np.clip(model.residual, -spread, spread)
    noise = noise_of(kept, brightness, grid_of(pixels.x, pixels.y, pixels.width))
    return fit(
        reference,
        pixels._replace(value=brightness + kept),
        model.state,
        parameters=PARAMETERS[found.name],
        steps=steps,
        prior=found.prior._replace(noise=1.0),
        noise=noise,
        ridge=ridge(model.linear, model.amplitudes, 1.0),
    )


def _simplest(reference: Reference, pyramid: _Pyramid, start: State) -> str:
    """Choose the motion by Schwarz's criterion, with the noise of independent pixels."""
    results = {model: _refined(reference, pyramid, start, model) for model in PARAMETERS}
    freest = results["homography"]
    if freest is None:
        return "similarity"
    noise = freest.left.noise
    scores = {
        model: freest.pixels.x.size * found.model.mean_cost() / noise
        + np.log(freest.pixels.x.size) * PARAMETERS[model]
        for model, found in results.items()
        if found is not None
    }
    return min(scores, key=lambda model: scores[model])
