"""How the virtual camera sees the object plane: its own geometry, shared with no registration."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

Energies = NDArray[np.float64]
SHRINK = 0.82  # camera pixels per pixel of the simulated picture


def mounted(picture: tuple[int, ...], camera: tuple[int, int], rng: np.random.Generator) -> Energies:
    """Simulated pixel centre (x, y, 1) -> camera pixel centre: scale, rotation and shift."""
    angle = np.deg2rad(rng.uniform(-2.5, 2.5))
    scale = SHRINK * (1 + rng.uniform(-0.02, 0.02))
    turn = scale * np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    middle = (np.array(camera[::-1]) - 1) / 2 + rng.uniform(-4, 4, 2)
    shift = middle - turn @ ((np.array(picture[::-1]) - 1) / 2)
    matrix = np.eye(3)
    matrix[:2, :2], matrix[:2, 2] = turn, shift
    return matrix


def project(energy: Energies, matrix: Energies, shape: tuple[int, int], *, fine: int = 4) -> Energies:
    """Return the energy per camera pixel of a picture seen through ``matrix``.

    Each camera pixel is the mean of ``fine`` x ``fine`` points of the picture's density times the
    area that it covers, so that energy is conserved.
    """
    offsets = (np.arange(fine) + 0.5) / fine - 0.5
    rows = (np.arange(shape[0])[:, None] + offsets).ravel()
    columns = (np.arange(shape[1])[:, None] + offsets).ravel()
    y, x = np.meshgrid(rows, columns, indexing="ij")
    back = np.linalg.inv(matrix)
    source_x = back[0, 0] * x + back[0, 1] * y + back[0, 2]
    source_y = back[1, 0] * x + back[1, 1] * y + back[1, 2]
    seen = map_coordinates(energy, [source_y, source_x], order=1, mode="constant", cval=0.0)
    area = abs(np.linalg.det(back[:2, :2]))
    return np.asarray(seen.reshape(shape[0], fine, shape[1], fine).mean(axis=(1, 3)) * area)
