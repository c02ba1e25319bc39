"""The arrays of the forward engine: what it is given, what it works in, and what it sums up."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from imclab.optics.phase_table import PhaseTable
from imclab.transport.scattering import HenyeyGreensteinLaw

FOLLOWED_PER_BATCH = 1 << 16
LANES = 1024
"""Packets in flight: their properties, 57 kB, and the buffers beside them stay in the second cache."""
RECORDS = 2048
RADIAL_BINS = 1024
DELAY_BINS = 512
ROULETTE_WEIGHT = 1e-3

PROPERTIES = 11
"""Rows of single-precision properties of a packet."""
NUMBERS = 5
"""Rows of whole numbers of a packet."""


class Slab(NamedTuple):
    """What the kernel needs of a scene; lengths in metres, single precision where the lanes use it.

    ``farthest`` bounds the first free path of the packets that are followed, ``roulette_path`` is where
    the weight reaches ROULETTE_WEIGHT. Radius and excess path fall on the middle of their histograms
    at ``radial_scale`` and ``delay_scale``: bin numbers go as r / (r + scale).
    """

    phase: HenyeyGreensteinLaw | PhaseTable
    planes: NDArray[np.float32]
    absorption: np.float32
    roulette_path: np.float32
    mean_free_path: np.float32
    followed: np.float32
    spot_sigma: np.float32
    divergence_sigma: np.float32
    radial_scale: np.float32
    delay_scale: np.float32


class Records(NamedTuple):
    """Crossings not yet summed: where, after which path, and to which row of the sums they belong."""

    x: NDArray[np.float32]
    y: NDArray[np.float32]
    path: NDArray[np.float32]
    excess: NDArray[np.float32]
    row: NDArray[np.int32]
    weight: NDArray[np.float32]
    square: NDArray[np.float32]
    radial_bin: NDArray[np.int32]
    delay_bin: NDArray[np.int32]


class Work(NamedTuple):
    """Room for a kernel to work in: a pool of launched packets, the lanes, and crossings."""

    pool: NDArray[np.float32]
    pool_numbers: NDArray[np.uint32]
    lanes: NDArray[np.float32]
    numbers: NDArray[np.uint32]
    plane: NDArray[np.int32]
    crossed: NDArray[np.bool_]
    records: Records


def room(planes: int) -> Work:
    """Return the arrays that one call of the kernel works in; not to be shared between threads."""
    size = RECORDS + planes + 1
    integer, single = np.int32, np.float32
    kinds = (single, single, single, single, integer, single, single, integer, integer)
    return Work(
        np.zeros(PROPERTIES * LANES, single),
        np.zeros(NUMBERS * LANES, np.uint32),
        np.zeros(PROPERTIES * LANES, single),
        np.zeros(NUMBERS * LANES, np.uint32),
        np.zeros(LANES, integer),
        np.zeros(LANES, np.bool_),
        Records._make(np.zeros(size, kind) for kind in kinds),
    )


class Sums(NamedTuple):
    """Sums over packets, of n planes.

    ``moments`` has a row for light through each plane and then one for light out of z = 0 that had
    crossed 0, 1, ... n - 1 planes; its columns are weight, weight r^2, weight p, weight p^2, where p is
    the path beyond the plane's distance. ``radial`` (n, bins) sums weights, ``delay`` (n, 2, bins)
    weights and weights times p. ``absorbed`` energy, packets ``sampled`` and ``collisions`` are one number
    each.
    """

    moments: NDArray[np.float64]
    radial: NDArray[np.float64]
    delay: NDArray[np.float64]
    absorbed: NDArray[np.float64]
    sampled: NDArray[np.float64]
    collisions: NDArray[np.float64]
