"""Pairs of a simulated picture and a measured frame with the motion between them known.

Drawn from vector figures, not with the code under test: the figure is rastered eight times finer
than the pixels, the measured frame is integrated over its own pixels through the true motion, and
blur, halo, beam, background, tone and noise are laid on in that order.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

FINE = 8
SPECKLE_PX = 0.8
SPECKLE_SHARE = (0.2, 0.7)
BANDS = ("small", "medium", "large", "affine", "homography")
SNR_DB = (40.0, 20.0, 10.0, 5.0, 0.0)
TARGETS = ("diver", "slit", "bars", "polygons")


@dataclass(frozen=True)
class Pair:
    """A clean picture, a frame of it, and the truth."""

    fixed: NDArray[np.float64]
    moving: NDArray[np.generic]
    matrix: NDArray[np.float64]
    lit: NDArray[np.bool_]
    target: str
    band: str
    snr_db: float

    @property
    def model(self) -> str:
        return self.band if self.band in ("affine", "homography") else "similarity"

    def corner_error(self, matrix: NDArray[np.float64]) -> float:
        """Mean distance of the four mapped corners in pixels of the frame."""
        rows, cols = self.fixed.shape
        corners = np.array([[0, 0], [cols - 1, 0], [0, rows - 1], [cols - 1, rows - 1]], float)
        return float(np.linalg.norm(mapped(matrix, corners) - mapped(self.matrix, corners), axis=1).mean())

    def target_error(self, matrix: NDArray[np.float64]) -> float:
        """Root mean square distance over the pixels of the figure."""
        rows, cols = np.nonzero(self.lit)
        points = np.column_stack([cols, rows]).astype(float)
        gap = mapped(matrix, points) - mapped(self.matrix, points)
        return float(np.sqrt((gap**2).sum(axis=1).mean()))


def mapped(matrix: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
    homogeneous = np.column_stack([points, np.ones(len(points))]) @ np.asarray(matrix, float).T
    return homogeneous[:, :2] / homogeneous[:, 2:]


def draw_figure(rng: np.random.Generator, name: str, size: int = 200) -> NDArray[np.float32]:
    """Raster one figure, 1 on 0, FINE times finer than the pixels."""
    canvas = np.zeros((size * FINE, size * FINE), np.uint8)
    unit = size * FINE / 200.0
    centre = np.array([100.0, 100.0]) + rng.uniform(-8, 8, 2)
    length = rng.uniform(80, 130)
    polygons = {"diver": _diver, "slit": _slit, "bars": _bars, "polygons": _polygons}[name](rng)
    for polygon in polygons:
        points = (centre + np.asarray(polygon) * length) * unit
        cv2.fillPoly(canvas, [np.round(points).astype(np.int32)], 1)
    return canvas.astype(np.float32)


def make_pair(
    seed: int,
    *,
    band: str = "small",
    snr_db: float = 20.0,
    target: str = "diver",
    dark: bool = False,
    frame_shape: tuple[int, int] | None = None,
) -> Pair:
    """Draw one pair; ``dark`` puts a dark figure on a bright ground."""
    scene = make_scene(seed, band=band, snr_db=snr_db, target=target, dark=dark, frame_shape=frame_shape)
    light = through(scene.albedo, scene.matrix, scene.shape)
    moving = _measured(scene.rng, light, snr_db)
    return Pair(scene.fixed, moving, scene.matrix, scene.lit, target, band, snr_db)


class Scene(NamedTuple):
    """A drawn target and the motion, before light and noise are laid on."""

    albedo: NDArray[np.float32]
    fixed: NDArray[np.float64]
    lit: NDArray[np.bool_]
    matrix: NDArray[np.float64]
    shape: tuple[int, int]
    rng: np.random.Generator


def make_scene(
    seed: int,
    *,
    band: str,
    snr_db: float,
    target: str,
    dark: bool,
    frame_shape: tuple[int, int] | None = None,
) -> Scene:
    """Draw what :func:`make_pair` then photographs."""
    rng = np.random.default_rng([seed, BANDS.index(band), int(snr_db), TARGETS.index(target)])
    fine = draw_figure(rng, target)
    albedo = 1.0 - 0.85 * fine if dark else 0.05 + 0.95 * fine
    clean = _binned(_blur(albedo, rng.uniform(0.6, 1.3) * FINE)).astype(np.float64)
    contrast = float(np.abs(clean - np.median(clean)).max())
    fixed = clean + rng.normal(0, 0.01 * contrast, clean.shape) * np.sqrt(np.maximum(clean, 0.05))
    shape = frame_shape or ((200, 200) if rng.random() < 0.5 else (256, 320))
    return Scene(albedo, fixed, _binned(fine) > 0.5, _motion(rng, band, shape), shape, rng)


def target_free_frame(seed: int, shape: tuple[int, int] = (256, 320)) -> NDArray[np.generic]:
    """Beam, background, speckle and dead pixels, but no figure."""
    rng = np.random.default_rng([seed, 77])
    return _measured(
        rng, np.full(shape, rng.uniform(0.0, 1.0), np.float32), 10.0, noise=rng.uniform(0.02, 0.3)
    )


def decoy_frames(seed: int) -> dict[str, NDArray[np.generic]]:
    """Frames that show something, but not the target of pair ``seed``."""
    rng = np.random.default_rng([seed, 5])
    rows, cols = 200, 200
    v, u = np.mgrid[:rows, :cols]
    speckle = _blur(rng.normal(size=(rows, cols)).astype(np.float32), rng.uniform(2, 12))
    spot = 40 * np.exp(-((u - 100) ** 2 + (v - 90) ** 2) / 2 / rng.uniform(20, 80) ** 2)
    fringes = 20 * np.sin(u / rng.uniform(4, 20) + v / rng.uniform(6, 30))
    return {
        "empty water": target_free_frame(seed),
        "noise": rng.normal(100, 10, (rows, cols)),
        "fringes": 100 + fringes + rng.normal(0, 5, (rows, cols)),
        "speckle": 100 + 10 * speckle / speckle.std() + rng.normal(0, 4, (rows, cols)),
        "beam spot": 100 + u * rng.uniform(-0.3, 0.3) + 0.2 * v + spot + rng.normal(0, 3, (rows, cols)),
        "another target": make_pair(seed, band="small", target=TARGETS[(seed + 1) % 4]).moving,
    }


def _binned(fine: NDArray[np.float32], factor: int = FINE) -> NDArray[np.float32]:
    rows, cols = fine.shape
    return fine.reshape(rows // factor, factor, cols // factor, factor).mean(axis=(1, 3))


def _blur(picture: NDArray[np.float32], sigma: float) -> NDArray[np.float32]:
    return np.asarray(cv2.GaussianBlur(picture, (0, 0), sigma, borderType=cv2.BORDER_REPLICATE))


def _motion(rng: np.random.Generator, band: str, shape: tuple[int, int]) -> NDArray[np.float64]:
    shift, turn, zoom = {"small": (5, 2, 0.03), "medium": (14, 8, 0.12)}.get(band, (12, 8, 0.10))
    angle = np.deg2rad(rng.uniform(-turn, turn))
    scale = 1 + rng.uniform(-zoom, zoom)
    if band == "large":
        shift = 22
        angle = np.deg2rad(rng.uniform(10, 25) * rng.choice([-1, 1]))
        scale = np.exp(rng.uniform(np.log(0.7), np.log(1.4)))
    linear = scale * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    if band in ("affine", "homography"):
        linear = linear @ (np.eye(2) + rng.uniform(-0.06, 0.06, (2, 2)))
    middle = np.array([shape[1] - 1, shape[0] - 1]) / 2
    offset = middle + rng.uniform(-shift, shift, 2)
    matrix = np.eye(3)
    matrix[:2, :2] = linear
    to_centre = np.array([[1, 0, -99.5], [0, 1, -99.5], [0, 0, 1.0]])
    perspective = np.eye(3)
    if band == "homography":
        perspective[2, :2] = rng.uniform(-6e-4, 6e-4, 2)
    back = np.array([[1, 0, offset[0]], [0, 1, offset[1]], [0, 0, 1.0]])
    total = back @ matrix @ perspective @ to_centre
    return np.asarray(total / total[2, 2])


def through(
    albedo: NDArray[np.float32], matrix: NDArray[np.float64], shape: tuple[int, int]
) -> NDArray[np.float32]:
    """Integrate the fine raster over the pixels of the frame, through the motion."""
    over = 4
    rows, cols = shape
    from_fine = np.array([[1 / FINE, 0, 0.5 / FINE - 0.5], [0, 1 / FINE, 0.5 / FINE - 0.5], [0, 0, 1]])
    to_fine = np.array([[over, 0, (over - 1) / 2], [0, over, (over - 1) / 2], [0, 0, 1]])
    fine_matrix = to_fine @ matrix @ from_fine
    soft = _blur(albedo, FINE / over / 2)
    warped = cv2.warpPerspective(
        soft, fine_matrix, (cols * over, rows * over), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    return _binned(np.asarray(warped, np.float32), over)


def brightness(
    rng: np.random.Generator, light: NDArray[np.float32], largest: float | None = None
) -> tuple[NDArray[np.float64], float]:
    """Lay on blur, halo, beam, background and tone; also return the largest value before the tone.

    Given ``largest``, that is the value brightness is measured by, whatever the light.
    """
    rows, cols = light.shape
    core, wide = rng.uniform(0.0, 3.0), rng.uniform(6, 14)
    share = rng.uniform(0.08, 0.43)
    seen = (1 - share) * (_blur(light, core) if core > 0.2 else light) + share * _blur(light, wide)
    v, u = np.mgrid[:rows, :cols]
    beam_centre = np.array([cols, rows]) * rng.uniform(0.35, 0.65, 2)
    beam_width = rng.uniform(0.45, 0.9) * max(rows, cols)
    beam = np.exp(-((u - beam_centre[0]) ** 2 + (v - beam_centre[1]) ** 2) / (2 * beam_width**2))
    veil = rng.uniform(0.1, 0.8) * beam + rng.uniform(0, 0.4) * u / cols + rng.uniform(-0.2, 0.2) * v / rows
    picture = np.asarray(seen * beam + np.maximum(veil, 0), np.float64)
    largest = float(picture.max()) if largest is None else largest
    return (picture / largest) ** rng.uniform(0.5, 2.0), largest


def noise_strength(
    picture: NDArray[np.float64], snr_db: float, noise: float | None = None
) -> NDArray[np.float64]:
    """Standard deviation of the noise at each pixel.

    The signal of the ratio is the standard deviation of the whole frame without its wide background.
    """
    signal = float((picture - _blur(picture.astype(np.float32), 40)).std())
    level = noise if noise is not None else signal / 10 ** (snr_db / 20)
    return np.asarray(level * np.sqrt(0.25 + 0.75 * picture / picture.mean()))


def _measured(
    rng: np.random.Generator, light: NDArray[np.float32], snr_db: float, noise: float | None = None
) -> NDArray[np.generic]:
    rows, cols = light.shape
    picture, _ = brightness(rng, light)
    grain = rng.normal(size=(rows, cols))
    speckle = _blur(rng.normal(size=(rows, cols)).astype(np.float32), SPECKLE_PX)
    speckle = speckle / speckle.std()
    share_speckle = rng.uniform(*SPECKLE_SHARE)
    strength = noise_strength(picture, snr_db, noise)
    picture = picture + strength * (np.sqrt(1 - share_speckle) * grain + np.sqrt(share_speckle) * speckle)
    bits, kind = (8, np.uint8) if rng.random() < 0.5 else (12, np.uint16)
    full = 2**bits - 1
    lowest, highest = np.quantile(picture, [0.0005, 0.9995])
    counts = np.round((0.04 + 0.8 * (picture - lowest) / (highest - lowest)) * full)
    hot = rng.random((rows, cols))
    counts[hot < 5e-4] = full
    counts[hot > 1 - 3e-4] = 0
    return np.clip(counts, 0, full).astype(kind)


def _diver(rng: np.random.Generator) -> list[NDArray[np.float64]]:
    turn = np.linspace(0, 2 * np.pi, 60)
    body = np.column_stack([0.32 * np.cos(turn), 0.10 * np.sin(turn)])
    head = np.column_stack([0.40 + 0.075 * np.cos(turn), 0.02 + 0.075 * np.sin(turn)])
    tank = np.array([[-0.2, -0.18], [0.12, -0.16], [0.12, -0.09], [-0.2, -0.09]])
    bend = rng.uniform(-0.08, 0.12, 4)
    arm = np.array([[0.2, 0.05], [0.34, 0.28 + bend[0]], [0.29, 0.30 + bend[0]], [0.12, 0.06]])
    leg = np.array([[-0.25, 0.05], [-0.55, 0.14 + bend[1]], [-0.55, 0.09 + bend[1]], [-0.25, -0.04]])
    fin = np.array([[-0.53, 0.06 + bend[1]], [-0.70, 0.02 + bend[2]], [-0.68, 0.24 + bend[3]]])
    return [body, head, tank, arm, leg, fin]


def _slit(rng: np.random.Generator) -> list[NDArray[np.float64]]:
    width, gap, height = rng.uniform(0.08, 0.18), rng.uniform(0.10, 0.22), rng.uniform(0.35, 0.5)
    box = np.array([[-width / 2, -height], [width / 2, -height], [width / 2, height], [-width / 2, height]])
    aside = np.array([(gap + width) / 2, 0.0])
    return [box - aside, box + aside]


def _bars(rng: np.random.Generator) -> list[NDArray[np.float64]]:
    polygons = []
    for x, y, mean_width, upright in (
        (-0.28, -0.25, 0.07, 1),
        (0.26, -0.26, 0.055, 0),
        (-0.3, 0.3, 0.04, 0),
        (0.25, 0.27, 0.03, 1),
    ):
        width = mean_width * rng.uniform(0.85, 1.2)
        for k in (-1, 0, 1):
            box = np.array([[-0.5, -2.5], [0.5, -2.5], [0.5, 2.5], [-0.5, 2.5]]) * width + [2 * k * width, 0]
            polygons.append((box if upright else box[:, ::-1]) + [x, y])
    return polygons


def _polygons(rng: np.random.Generator) -> list[NDArray[np.float64]]:
    shapes = []
    for _ in range(4):
        turn = np.sort(rng.uniform(0, 2 * np.pi, 5))
        radius = rng.uniform(0.08, 0.28, 5)
        middle = rng.uniform(-0.32, 0.32, 2)
        shapes.append(middle + np.column_stack([radius * np.cos(turn), radius * np.sin(turn)]))
    return shapes
