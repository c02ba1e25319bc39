"""Corrections of single pixels: which are bad, and the flat field.

A pixel is judged against its neighbours (median of 5 x 5), so that shading and fixed patterns of
the fibre optics pass, and against the robust spread of all pixels, so that bad pixels do not hide
each other.
"""

from __future__ import annotations

from enum import IntFlag

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, stats

BAD_SIGMAS = 6.0
LEAST_FLAT_DEVIATION = 0.15  # of the neighbours' sensitivity: less is a pixel that the flat field mends
MAD_TO_SIGMA = 1.4826

Map = NDArray[np.float32]
Codes = NDArray[np.uint8]


class Defect(IntFlag):
    """Why a pixel is bad; a pixel can be bad in several ways."""

    HOT = 1
    DEAD = 2
    BLINKING = 4


def above_neighbours(picture: Map) -> Map:
    """Give each pixel minus the median of the 5 x 5 pixels around it."""
    return np.asarray(picture - ndimage.median_filter(picture, size=5, mode="mirror"))


def robust_spread(values: NDArray[np.floating]) -> float:
    """Standard deviation of the bulk of the values, by their median absolute deviation."""
    return MAD_TO_SIGMA * float(np.median(np.abs(values - np.median(values))))


def hot_pixels(dark: Map, *, mean_stderr: float) -> NDArray[np.bool_]:
    """Find pixels whose dark level stands out from their neighbours'.

    Parameters
    ----------
    dark : Map
        Mean dark picture, counts.
    mean_stderr : float
        Standard error of one pixel of it (temporal), counts.
    """
    rest = above_neighbours(dark)
    spread = max(robust_spread(rest), mean_stderr, 0.05)
    return np.asarray(np.abs(rest) > BAD_SIGMAS * spread)


def blinking_pixels(noise: Map, *, jumps: int) -> NDArray[np.bool_]:
    """Find pixels whose temporal variance cannot be chance.

    Parameters
    ----------
    noise : Map
        Temporal variance of each pixel, its largest jumps left out (``JumpTally``).
    jumps : int
        Number of frame differences in it; with fewer than five nothing can be told.
    """
    if jumps < 5:
        return np.zeros(noise.shape, dtype=np.bool_)
    usual = float(np.median(noise))
    # Successive differences share frames: about 2/3 as many independent ones.
    freedom = max(2.0, (jumps - 2) * 2.0 / 3.0)
    chance = stats.chi2.isf(1e-7, freedom) / stats.chi2.isf(0.5, freedom)
    # Neighbouring pixels' noise differs (amplifiers, fixed pattern): the bulk's own spread counts too.
    bulk = float(np.quantile(noise, 0.999)) / max(usual, 1e-12)
    return np.asarray(noise > max(usual, 1.0 / 12.0) * max(chance, min(bulk, 1.5 * chance), 3.0))


def dead_pixels(flat: Map) -> NDArray[np.bool_]:
    """Find pixels whose answer to light stands out from their neighbours' (dead, dim or too bright).

    Parameters
    ----------
    flat : Map
        Mean picture of even light, dark taken off, counts.
    """
    level = float(np.median(flat))
    rest = above_neighbours(flat) / np.float32(level)
    limit = max(BAD_SIGMAS * robust_spread(rest), LEAST_FLAT_DEVIATION)
    return np.asarray(np.abs(rest) > limit)


def typical_pixels(flat: Map, good: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Find the half of the good pixels whose sensitivity is nearest the median.

    The response is read from these alone: the mean of a curved response over pixels of unequal
    sensitivity is not the response at their mean.
    """
    low, high = np.quantile(flat[good], [0.25, 0.75])
    return np.asarray(good & (flat >= low) & (flat <= high))


def fixed_pattern(picture: Map, *, noise_of_mean: float) -> tuple[float, float]:
    """Spatial standard deviation of a mean picture without its temporal noise, with standard error.

    EMVA 1288 (DSNU of a dark picture, PRNU of a flat one). When the temporal noise explains all of
    it, the value is 0 and the standard error says how large it could be; never NaN.
    """
    total = float(np.var(picture, ddof=1))
    variance = total - noise_of_mean**2
    variance_stderr = np.sqrt(2.0 / picture.size) * total
    if variance <= variance_stderr:
        return max(0.0, variance) ** 0.5, float(np.sqrt(variance_stderr))
    return float(np.sqrt(variance)), float(variance_stderr / (2.0 * np.sqrt(variance)))
