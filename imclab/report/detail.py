"""What a pair of pictures shows beyond its energies: profiles, contrast, edge response, SSIM map."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from imclab import metrics
from imclab.agreement import pixel_area
from imclab.comparison import Pair
from imclab.sharpness import EdgeResponse, Profile, contrast, find_edge, profile, slanted_edge
from imclab.uncertainty import Estimate

FloatArray = NDArray[np.float64]

BAND = 9
"""Rows, or columns, that a profile averages."""


@dataclass(frozen=True)
class Both:
    """The same thing of the measured and of the simulated picture."""

    measured: Profile
    simulated: Profile


@dataclass(frozen=True, kw_only=True)
class Detail:
    """What the report shows of one pair beside its energy.

    Attributes
    ----------
    across, down : Both
        Profiles along the columns and along the rows where they cross most of the figure, J per pixel.
    contrast : (measured, simulated) Estimate
        Michelson contrast between the pixels that the simulation shows bright and the others.
    edge : (measured, simulated) EdgeResponse, or None
        Response of one slanted edge; None when the picture holds no straight one.
    pixel_area : float
        See `imclab.agreement.pixel_area`.
    similarity : array (rows, columns)
        SSIM map; NaN where no whole window fits.
    range_advice : str
        Why the data range does not fit the pictures; empty when it does.
    """

    across: Both
    down: Both
    contrast: tuple[Estimate, Estimate]
    edge: tuple[EdgeResponse, EdgeResponse] | None
    pixel_area: float
    similarity: FloatArray
    range_advice: str


def detail(pair: Pair, *, data_range: float) -> Detail:
    """Look at one pair in detail; ``data_range`` is that of the comparison."""
    bright = _bright(pair)
    inside = pair.region
    measured, simulated = pair.measured_counts[inside], pair.simulated_counts[inside]
    return Detail(
        across=_profiles(pair, bright, axis=0),
        down=_profiles(pair, bright, axis=1),
        contrast=_contrasts(pair, bright),
        edge=_edges(pair),
        pixel_area=pixel_area(pair),
        similarity=_similarity(pair, data_range),
        range_advice=metrics.range_advice(measured, simulated, data_range=data_range),
    )


def _bright(pair: Pair) -> NDArray[np.bool_]:
    """Pixels that the simulation shows above the threshold that parts its two levels best (Otsu)."""
    from skimage.filters import threshold_otsu

    inside = pair.simulated[pair.region]
    if np.ptp(inside) == 0:
        return pair.region
    return np.asarray(pair.region & (pair.simulated > threshold_otsu(inside)))


def _profiles(pair: Pair, bright: NDArray[np.bool_], *, axis: int) -> Both:
    """Average the band that crosses most of the figure; the middle one of several."""
    crossed = np.convolve(bright.sum(axis=1 - axis), np.ones(BAND), mode="same")
    best = np.flatnonzero(crossed == crossed.max())
    centre = int(best[best.size // 2])
    band = slice(max(centre - BAND // 2, 0), centre + BAND // 2 + 1)
    return Both(
        profile(pair.measured, pair.measured_stderr, pair.region, axis=axis, band=band),
        profile(pair.simulated, pair.simulated_stderr, pair.region, axis=axis, band=band),
    )


def _contrasts(pair: Pair, bright: NDArray[np.bool_]) -> tuple[Estimate, Estimate]:
    dark = pair.region & ~bright
    if not dark.any():
        unknown = Estimate(math.nan, math.nan)
        return unknown, unknown
    return (
        contrast(pair.measured, pair.measured_stderr, bright=bright, dark=dark),
        contrast(pair.simulated, pair.simulated_stderr, bright=bright, dark=dark),
    )


def _edges(pair: Pair) -> tuple[EdgeResponse, EdgeResponse] | None:
    window = find_edge(pair.simulated, pair.region)
    if window is None:
        return None
    measured = slanted_edge(pair.measured[window], pair.measured_stderr[window])
    simulated = slanted_edge(pair.simulated[window], pair.simulated_stderr[window])
    return None if measured is None or simulated is None else (measured, simulated)


def _similarity(pair: Pair, data_range: float) -> FloatArray:
    padded = np.full(pair.region.shape, np.nan)
    margin = 5  # of the 11 x 11 window
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", metrics.DataRangeWarning)  # told on the page by range_advice
        padded[margin:-margin, margin:-margin] = metrics.mssim_map(
            pair.simulated_counts, pair.measured_counts, data_range=data_range, mask=pair.region
        )
    return padded
