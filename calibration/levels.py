"""The light levels that the response is solved from, and the means of noisy light set straight."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.interpolate import PchipInterpolator

Floats = NDArray[np.float64]
Integers = NDArray[np.intp]

QUANTILES = 24
SHIFT_ERROR = 0.1  # of the mean's shift by a bent response: how well its noise law is known


@dataclass(frozen=True)
class Levels:
    """The runs that the response is solved from.

    Attributes
    ----------
    counts, counts_stderr : Floats
        Mean counts above dark of each run and their standard error.
    shot_variance : Floats
        Temporal variance that the light's own noise gives one pixel, counts squared; 0 if unknown.
    setting, level : Integers
        Which gain setting and which light level the run belongs to (indices).
    log_energy : Floats
        Logarithm of the stated energy of each level; NaN when not known.
    gains : tuple of float
        The settings.
    reference : int
        Index of the setting with relative gain 1.
    saturation : float
        Counts above dark at which the sensor saturates.
    level_stderr : float, optional
        Relative standard uncertainty of each level, when stated.
    known_log_gain, known_stderr
        Logarithms of gains that are known beforehand (NaN elsewhere), and their standard error.
    """

    counts: Floats
    counts_stderr: Floats
    shot_variance: Floats
    setting: Integers
    level: Integers
    log_energy: Floats
    gains: tuple[float, ...]
    reference: int
    saturation: float
    level_stderr: float | None = None
    known_log_gain: Floats | None = None
    known_stderr: float = 1e-3


class Straightened(NamedTuple):
    """Levels with straightened means; the response's slope there; the shift as relative exposure."""

    levels: Levels
    slope: Floats
    shift: Floats


def straightened(measured: Levels, curve: PchipInterpolator) -> Straightened:
    """Take off what a bent response adds to the mean counts of noisy light.

    Light that varies has a mean answer other than the answer to its mean. Its events are taken as
    gamma distributed with the variance that the counts show; their mean answer is a sum over
    quantiles, not a second derivative, which a fitted curve does not give.
    """
    counts = measured.counts
    low, high = curve.x[0], curve.x[-1]
    for _ in range(3):
        width = np.clip(np.sqrt(measured.shot_variance) / counts, 0.1, 0.5)
        below, above = (
            np.clip(np.log(counts * (1 - width)), low, high),
            np.clip(np.log(counts * (1 + width)), low, high),
        )
        slope = np.clip((curve(above) - curve(below)) / np.maximum(above - below, 1e-9), 0.05, 20.0)
        centre = np.asarray(curve(np.clip(np.log(counts), low, high)))
        relative = np.clip(measured.shot_variance * (slope / counts) ** 2, 1e-12, 1.0)
        share = (np.arange(QUANTILES) + 0.5) / QUANTILES
        drawn = stats.gamma.ppf(share, 1.0 / relative[:, None]) * relative[:, None]
        drawn /= drawn.mean(axis=1, keepdims=True)
        answers = _answer(curve, centre[:, None] + np.log(np.maximum(drawn, 1e-6)))
        shift = np.mean(answers, axis=1) - _answer(curve, centre)
        counts = np.maximum(measured.counts - shift, 0.5 * measured.counts)
    error = np.hypot(measured.counts_stderr, SHIFT_ERROR * np.abs(shift))
    relative_shift = np.abs(shift) / counts * slope
    return Straightened(replace(measured, counts=counts, counts_stderr=error), slope, relative_shift)


def _answer(curve: PchipInterpolator, log_exposure: Floats) -> Floats:
    """Counts at a logarithm of exposure; straight in both logarithms beyond the curve's ends."""
    at = np.linspace(curve.x[0], curve.x[-1], 2048)
    values = np.asarray(curve(at))
    inside = np.interp(log_exposure, values, at)
    inside += np.minimum(log_exposure - values[0], 0.0) * (at[60] - at[0]) / (values[60] - values[0])
    inside += np.maximum(log_exposure - values[-1], 0.0) * (at[-1] - at[-60]) / (values[-1] - values[-60])
    return np.asarray(np.exp(inside))
