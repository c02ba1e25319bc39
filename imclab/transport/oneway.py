"""The estimator of one-way transmission: lanes for what scatters, quadrature for what does not."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from imclab.optics.phase_table import PhaseTable
from imclab.transport import lane_arrays, unscattered
from imclab.transport.lanes import follow
from imclab.transport.media import Water
from imclab.transport.runner import Estimator, Tally
from imclab.transport.scattering import HenyeyGreensteinLaw
from imclab.transport.setup import Beam

FloatArray = NDArray[np.float64]

_LARGEST_EXPONENT = 32.0 * math.log(2.0)
"""Greatest -log of a random number in single precision: no beam angle lies farther out than it gives."""
_ENDLESS = 1e30


def radial_edges(radial_scale: float) -> FloatArray:
    """Return the edges of the radial bins, m; the last is infinite."""
    return _edges(radial_scale, lane_arrays.RADIAL_BINS)


def delay_edges(delay_scale: float) -> FloatArray:
    """Return the edges of the bins in path beyond the plane's distance, m; the last is infinite."""
    return _edges(delay_scale, lane_arrays.DELAY_BINS)


def _edges(scale: float, bins: int) -> FloatArray:
    place = np.arange(bins) / bins
    return np.append(scale * place / (1.0 - place), np.inf)


def radial_scale_of(beam: Beam, farthest: float) -> float:
    """Return the radius that falls on the middle of the radial histogram: four widths of the beam."""
    return 4.0 * math.hypot(beam.spot_sigma, farthest * beam.divergence_sigma)


def make(
    water: Water,
    phase: HenyeyGreensteinLaw | PhaseTable,
    beam: Beam,
    *,
    planes: Sequence[float],
    delay_scale: float,
) -> tuple[Estimator, float]:
    """Return the estimator of what crosses planes for the first time, and the share that it samples.

    Its quantities are those of :class:`lane_arrays.Sums`: per packet that is scattered before the last
    plane, of which there are ``sampled``. The share of such packets is known and returned.

    Parameters
    ----------
    water, phase, beam
        Parts of a set-up.
    planes : sequence of float
        Distances, rising, m.
    delay_scale : float
        Path, m, that falls on the middle of the delay histogram.
    """
    farthest = planes[-1]
    steepest = beam.divergence_sigma * math.sqrt(2.0 * _LARGEST_EXPONENT)
    longest = farthest / math.cos(steepest) if steepest < 1.5 else math.inf
    followed = -math.expm1(-water.scattering * longest) if water.scattering > 0.0 else 0.0
    roulette = (
        -math.log(lane_arrays.ROULETTE_WEIGHT) / water.absorption if water.absorption > 0.0 else _ENDLESS
    )
    single = np.float32
    slab = lane_arrays.Slab(
        phase,
        np.array(planes, dtype=single),
        single(water.absorption),
        single(min(roulette, _ENDLESS)),
        single(1.0 / max(water.scattering, 1.0 / _ENDLESS)),
        single(followed),
        single(beam.spot_sigma),
        single(beam.divergence_sigma),
        single(radial_scale_of(beam, farthest)),
        single(delay_scale),
    )

    def batch(seed: int, first_history: int, count: int) -> Tally:
        sums = _empty_sums(len(planes))
        followed_count = math.ceil(count * followed)
        if followed > 0.0:
            work = lane_arrays.room(len(planes))
            follow(slab, np.uint64(seed), np.uint64(first_history), followed_count, sums, work)
        return sums._asdict()

    notes = () if followed > 0.0 else ("nothing is scattered: all of it is computed",)
    exact = _unscattered_sums(water, beam, planes, slab)
    batch_size = round(lane_arrays.FOLLOWED_PER_BATCH / max(followed, 1e-9))
    estimator = Estimator("one-way", batch, batch_size, exact=exact._asdict(), notes=notes)
    return estimator, unscattered.scattered_share(unscattered.rays_of(beam), water.scattering, farthest)


def _empty_sums(planes: int) -> lane_arrays.Sums:
    return lane_arrays.Sums(
        np.zeros((2 * planes, 4)),
        np.zeros((planes, lane_arrays.RADIAL_BINS)),
        np.zeros((planes, 2, lane_arrays.DELAY_BINS)),
        np.zeros(1),
        np.zeros(1),
        np.zeros(1),
    )


def _unscattered_sums(
    water: Water, beam: Beam, planes: Sequence[float], slab: lane_arrays.Slab
) -> lane_arrays.Sums:
    """Return what crosses unscattered, per emitted packet, in the shape of the kernel's sums."""
    sums = _empty_sums(len(planes))
    rays = unscattered.rays_of(beam)
    edges = radial_edges(float(slab.radial_scale))
    delays = delay_edges(float(slab.delay_scale))
    for row, distance in enumerate(planes):
        sums.moments[row] = unscattered.moments(rays, beam, water.attenuation, distance)
        sums.radial[row] = unscattered.radial_shares(
            rays, beam, water.attenuation, distance=distance, edges=edges
        )
        excess = unscattered.excess_path(rays, distance)
        weight = rays.share * np.exp(-water.attenuation * (distance + excess))
        place = np.minimum(np.searchsorted(delays, excess, side="right") - 1, lane_arrays.DELAY_BINS - 1)
        np.add.at(sums.delay[row, 0], place, weight)
        np.add.at(sums.delay[row, 1], place, weight * excess)
    sums.moments[len(planes), 0] = unscattered.backward_share(beam)
    sums.absorbed[0] = unscattered.absorbed_share(rays, water.absorption, water.scattering, planes[-1])
    return sums
