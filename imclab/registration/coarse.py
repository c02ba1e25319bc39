"""Where the target may be, without a guess: rotation x scale x place by normalised correlation."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from imclab.registration.motion import Matrix, moved
from imclab.registration.reference import Reference

ROTATIONS_DEG = np.arange(-32.0, 33.0, 6.4)
SCALE_STEP = 1.1
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
    templates = _templates(reference, reduction)
    flat = _flattened(moving)
    largest = max(_LARGEST_SCALE, 1.15 * min(moving.shape) / min(reference.picture.shape))
    steps = int(np.ceil(np.log(largest / _SMALLEST_SCALE) / np.log(SCALE_STEP)))
    found: list[Candidate] = []
    for scale in np.geomspace(_SMALLEST_SCALE, largest, steps + 1):
        found.extend(_at_scale(reference, flat, float(scale), reduction, templates))
    return _distinct(found, reference, count)


def _templates(reference: Reference, reduction: float) -> list[NDArray[np.float32]]:
    """Rotate and reduce the target's surroundings, its centre in the middle, all of one size."""
    frame = reference.frame
    y, x = np.nonzero(reference.target)
    extent = max(
        float(np.abs(np.cos(turn) * (x - frame.x) + np.sin(turn) * (y - frame.y)).max())
        for turn in np.deg2rad([*ROTATIONS_DEG, *(ROTATIONS_DEG + 90)])
    )
    half = int(np.ceil(extent / reduction)) + 3
    flat = _flattened(reference.picture)
    soft = cv2.GaussianBlur(flat, (0, 0), max(1.2, 0.6 * reduction), borderType=cv2.BORDER_REPLICATE)
    centre = np.array([frame.x, frame.y])
    found = []
    for turn in np.deg2rad(ROTATIONS_DEG):
        inverse = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]) * reduction
        matrix = np.column_stack([inverse, centre - inverse @ [half, half]])
        how = {"flags": cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP, "borderMode": cv2.BORDER_REPLICATE}
        found.append(np.asarray(cv2.warpAffine(soft, matrix, (2 * half + 1, 2 * half + 1), **how)))
    return found


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
    half = templates[0].shape[0] // 2
    padded = cv2.copyMakeBorder(small, half, half, half, half, cv2.BORDER_CONSTANT, value=0.0)
    spread = _local_deviation(padded, templates[0].shape)
    found = []
    for turn, template in zip(np.deg2rad(ROTATIONS_DEG), templates, strict=True):
        score = cv2.matchTemplate(padded, template, cv2.TM_CCOEFF) / spread
        _, best, _, place = cv2.minMaxLoc(score)
        middle = (np.array(place) + 0.5) * ratio - 0.5
        linear = scale * np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        matrix = np.eye(3)
        matrix[:2, :2] = linear
        matrix[:2, 2] = middle - linear @ [reference.frame.x, reference.frame.y]
        found.append(Candidate(matrix, float(best) / (template.size * max(float(template.std()), 1e-30))))
    return found


def _local_deviation(picture: NDArray[np.float32], shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Standard deviation under a template everywhere, with a floor so that empty places score low."""
    rows, cols = shape
    box = [
        cv2.blur(field, (cols, rows), borderType=cv2.BORDER_CONSTANT)
        for field in (picture, picture * picture)
    ]
    variance = np.maximum(box[1] - box[0] * box[0], 0) + 0.05 * float(picture.var()) + 1e-30
    inner = variance[rows // 2 : picture.shape[0] - rows // 2, cols // 2 : picture.shape[1] - cols // 2]
    return np.asarray(np.sqrt(inner))


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
