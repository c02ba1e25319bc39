"""Where the target may be, without a guess: rotation x scale x place by normalised correlation."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from imclab.registration.motion import Matrix, moved
from imclab.registration.reference import Reference

ROTATIONS_DEG = np.arange(-30.0, 31.0, 5.0)
SCALE_STEP = 1.08
_SMALLEST_SCALE, _LARGEST_SCALE = 0.6, 1.65
_TEMPLATE_RADIUS = 16.0
"""Radius of the target in the reduced pictures, in pixels."""
_FLAT_SHARE = 0.2
"""Width of the background that is taken off, of the picture's size (40 px in 200)."""


class Candidate(NamedTuple):
    """A similarity that may be the motion, and its correlation."""

    matrix: Matrix
    score: float


def candidates(reference: Reference, moving: NDArray[np.float64], *, count: int) -> list[Candidate]:
    """Return the most correlated distinct similarities, best first.

    The simulated picture is rotated and the measured frame is resized, so that one small template a
    rotation serves all scales, and larger scales cost less.
    """
    reduction = max(reference.frame.radius / _TEMPLATE_RADIUS, 1.0)
    templates = [_template(reference, angle, reduction) for angle in ROTATIONS_DEG]
    flat = _flattened(moving)
    largest = max(_LARGEST_SCALE, 1.15 * min(moving.shape) / min(reference.picture.shape))
    steps = int(np.ceil(np.log(largest / _SMALLEST_SCALE) / np.log(SCALE_STEP)))
    found: list[Candidate] = []
    for scale in np.geomspace(_SMALLEST_SCALE, largest, steps + 1):
        found.extend(_at_scale(reference, flat, float(scale), reduction, templates))
    return _distinct(found, reference, count)


def _template(reference: Reference, angle_deg: float, reduction: float) -> NDArray[np.float32]:
    """Rotate and reduce the target's surroundings, with the target's centre in the middle."""
    half = int(np.ceil(_extent(reference, angle_deg) / reduction)) + 3
    turn = np.deg2rad(angle_deg)
    inverse = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]) * reduction
    centre = np.array([reference.frame.x, reference.frame.y])
    matrix = np.column_stack([inverse, centre - inverse @ [half, half]])
    soft = cv2.GaussianBlur(
        _flattened(reference.picture), (0, 0), max(1.2, 0.6 * reduction), borderType=cv2.BORDER_REPLICATE
    )
    size = 2 * half + 1
    return np.asarray(
        cv2.warpAffine(
            soft,
            matrix,
            (size, size),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REPLICATE,
        )
    )


def _extent(reference: Reference, angle_deg: float) -> float:
    y, x = np.nonzero(reference.target)
    turn = np.deg2rad(angle_deg)
    right, low = x - reference.frame.x, y - reference.frame.y
    across = np.abs(np.cos(turn) * right - np.sin(turn) * low).max()
    down = np.abs(np.sin(turn) * right + np.cos(turn) * low).max()
    return float(max(across, down))


def _flattened(picture: NDArray[np.float64]) -> NDArray[np.float32]:
    single = np.ascontiguousarray(picture, dtype=np.float32)
    shrunk = cv2.resize(single, None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA)
    wide = cv2.GaussianBlur(
        shrunk, (0, 0), _FLAT_SHARE / 4 * np.sqrt(single.size), borderType=cv2.BORDER_REPLICATE
    )
    smooth = cv2.resize(wide, single.shape[::-1], interpolation=cv2.INTER_LINEAR)
    return np.asarray(single - smooth)


def _at_scale(
    reference: Reference,
    flat: NDArray[np.float32],
    scale: float,
    reduction: float,
    templates: list[NDArray[np.float32]],
) -> list[Candidate]:
    rows, cols = flat.shape
    shrink = 1.0 / (reduction * scale)
    size = (max(round(cols * shrink), 4), max(round(rows * shrink), 4))
    small = cv2.resize(flat, size, interpolation=cv2.INTER_AREA)
    ratio = np.array([cols / size[0], rows / size[1]])
    found = []
    for angle, template in zip(ROTATIONS_DEG, templates, strict=True):
        half = template.shape[0] // 2
        pad = half
        wide = cv2.copyMakeBorder(small, pad, pad, pad, pad, cv2.BORDER_CONSTANT, value=0.0)
        score = _correlation(wide, template)
        _, best, _, place = cv2.minMaxLoc(score)
        middle = (np.array(place) + half - pad + 0.5) * ratio - 0.5
        turn = np.deg2rad(angle)
        linear = scale * np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        matrix = np.eye(3)
        matrix[:2, :2] = linear
        matrix[:2, 2] = middle - linear @ [reference.frame.x, reference.frame.y]
        found.append(Candidate(matrix, float(best)))
    return found


def _correlation(picture: NDArray[np.float32], template: NDArray[np.float32]) -> NDArray[np.float32]:
    """Normalised correlation, with a floor under the local variance so that empty places score low."""
    rows, cols = template.shape
    count = template.size
    product = cv2.matchTemplate(picture, template, cv2.TM_CCOEFF)
    mean = cv2.blur(picture, (cols, rows), borderType=cv2.BORDER_CONSTANT)
    square = cv2.blur(picture * picture, (cols, rows), borderType=cv2.BORDER_CONSTANT)
    top, left = rows // 2, cols // 2
    here = (slice(top, top + product.shape[0]), slice(left, left + product.shape[1]))
    variance = np.maximum(square - mean * mean, 0)[here] + 0.05 * float(picture.var()) + 1e-30
    deviation = float(template.std()) + 1e-30
    return np.asarray(product / (count * deviation * np.sqrt(variance)))


def _distinct(found: list[Candidate], reference: Reference, count: int) -> list[Candidate]:
    """Keep the best candidates that put the target's rim at clearly different places."""
    frame = reference.frame
    rim = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]]) * frame.radius + [frame.x, frame.y]
    kept: list[Candidate] = []
    for candidate in sorted(found, key=lambda one: -one.score):
        place = moved(candidate.matrix, rim)
        if all(np.abs(place - moved(other.matrix, rim)).max() > 0.25 * frame.radius for other in kept):
            kept.append(candidate)
        if len(kept) == count:
            break
    return kept
